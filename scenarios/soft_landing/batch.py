"""One sample of filter, smoother and open loop of [RTS] for many runs at once, made from the kernels.

All runs see the same sequence of modes, so one function is made for each pair of modes of two consecutive samples, with
the modes and the options as plain constants.  The conditions on them then vanish, and so does all that they make zero:
at rest the positions are known exactly and three of the five states are left, without e_i or e_F one less.

An estimate is a flat row: the five means, and the upper triangle of the covariance of those states that are not known
exactly; each is an array (runs,) or a number.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cache
from typing import Annotated, Any, NamedTuple

import numpy as np

from gapsense.estimators import ekf, ertss
from gapsense.estimators.ekf import Measured, forward
from gapsense.estimators.kalman import Gaussian
from gapsense.estimators.reduced_model import (
    CURRENT_ERROR,
    FLUX_LINKAGE,
    FORCE_ERROR,
    POSITION,
    POSITION_PREV,
    Held,
    Model,
    is_moving,
    limit,
    rest,
    transition,
)
from gapsense.kernels.kernel import trace
from gapsense.kernels.lanes import Code, Row
from gapsense.kernels.layout import Array, Covariance, Scalar, Vector, names
from gapsense.kernels.linalg import ldl, matrix, solve, vector
from gapsense.kernels.trace import clip, sqrt, square

MOVING = 2.0


class Varied(NamedTuple):
    """The part of `Model` that differs from run to run, each (runs,)."""

    m: Scalar
    k_sp: Scalar
    z_sp: Scalar
    c_f: Scalar
    R_c0: Scalar
    lam_sat: Scalar
    gap_offset: Scalar
    gap_tilt: Scalar


class Tuning(NamedTuple):
    """Standard deviations: of the process noises per sample (60), and of the measured current (58)."""

    process_flux_linkage: Scalar  # [Wb]
    process_current_error: Scalar  # [A]
    process_force_error: Scalar  # [N]
    noise_current: Scalar  # [A]


class Variant(NamedTuple):
    """Which error states the estimator has; 0.0 for none, (64)-(66)."""

    option_current_error: float = 1.0
    option_force_error: float = 1.0


class Given(NamedTuple):
    """Voltage of the sample before, held until this one, and current of this one."""

    voltage: Scalar
    current: Scalar


class Plain(NamedTuple):
    """State of the model without e_i and e_F."""

    z: Scalar
    z_prev: Scalar
    lam: Scalar


class Squares(NamedTuple):
    """Sums of squared errors of the position, and of its change since the sample before."""

    position: Scalar
    velocity: Scalar


class Positions(NamedTuple):
    """At a sample and at the one before."""

    z: Scalar
    z_prev: Scalar


class Normalised(NamedTuple):
    """Squared error in units of its covariance (62), and the error of each state in units of its deviation (63)."""

    nees: Scalar
    nee: Annotated[Array, Vector(5)]


@cache
def start(m: Model, variant: Variant, mode: float) -> Code:
    """Code of the estimate (61) from `Varied`: at rest without flux, nothing uncertain."""
    n = len(uncertain(variant, mode))

    def at_rest(varied: Varied) -> Any:
        return estimate_record(n)(rest(mode, 0.0, varied_model(m, varied, variant)), matrix([[0.0] * n] * n))

    return compiled(at_rest, varied=Varied)


@cache
def forward_step(m: Model, variant: Variant, mode_before: float, mode: float) -> Code:
    """Code of one sample of the filter, from the row before, `Given`, `Varied` and `Tuning` to the row."""
    before, now = uncertain(variant, mode_before), uncertain(variant, mode)
    now = now if mode_before != MOVING or mode == MOVING else before  # the smoother needs all of a landing

    def filtered(row: Any, given: Given, varied: Varied, tuning: Tuning) -> Any:
        """The row after a sample."""
        held, measured = Held(given.voltage, mode_before), Measured(given.current, mode)
        model = varied_model(m, varied, variant)
        new = forward(embedded(row, before), held, measured, model, _tuned(tuning, variant))
        return extracted(new.filtered, now)

    return compiled(filtered, row=estimate_record(len(before)), given=Given, varied=Varied, tuning=Tuning)


@cache
def backward_step(m: Model, variant: Variant) -> Code:
    """Code of one sample of the smoother in motion, from the filtered row, its voltage and the later smoothed row."""
    states = uncertain(variant, MOVING)

    def smoothed(row: Any, given: _Voltage, later: Any, varied: Varied, tuning: Tuning) -> Any:
        """The smoothed row, from the later one."""
        model, held = varied_model(m, varied, variant), Held(given.voltage, MOVING)
        after, tuned = embedded(later, states), _tuned(tuning, variant)
        return extracted(ertss.backward(embedded(row, states), held, after, model, tuned), states)

    estimate = estimate_record(len(states))
    return compiled(smoothed, row=estimate, given=_Voltage, later=estimate, varied=Varied, tuning=Tuning)


@cache
def open_step(m: Model, mode_before: float, mode: float) -> Code:
    """Code of one sample of the model without e_i and e_F, on the stop that the mode names or between the stops."""

    def predicted(row: Plain, given: _Voltage, varied: Varied) -> Plain:
        """The row after a sample."""
        x = vector([*row, 0.0, 0.0])
        model = varied_model(m, varied, Variant(0.0, 0.0))
        z, z_prev, lam, _, _ = transition(x, Held(given.voltage, mode_before), model)
        return Plain(clip(z, 0.0, 1.0) if is_moving(mode) else limit(mode), z_prev, lam)

    return compiled(predicted, row=Plain, given=_Voltage, varied=Varied)


@cache
def squared_errors() -> Code:
    """Code of one more sample in the sums of squared errors."""

    def added(sums: Squares, found: Positions, true: Positions) -> Squares:
        change = (found.z - found.z_prev) - (true.z - true.z_prev)
        return Squares(sums.position + square(found.z - true.z), sums.velocity + square(change))

    return compiled(added, sums=Squares, found=Positions, true=Positions)


@cache
def normalised_errors(variant: Variant) -> Code:
    """Code of `Normalised` in motion, from a row and the true states; NaN for a state that is known exactly."""
    states = uncertain(variant, MOVING)

    def normalised(row: Any, true: _True) -> Normalised:
        """Squared normalised error of all states, and that of each in deviations."""
        error, deviations = row.x - true.x, vector([math.nan] * 5)
        deviations[states] = [sqrt(variance) for variance in row.P.diagonal()]
        nees = error[states] @ solve(ldl(row.P), error[states])
        return Normalised(nees, error / deviations)

    return compiled(normalised, row=estimate_record(len(states)), true=_True)


def landed(row: Row, variant: Variant, mode: float) -> Row:
    """The estimate of a landing without what is known at rest, so that the filter goes on with it."""
    at = dict(zip(names(estimate_record(len(uncertain(variant, MOVING)))), row))
    n, m = len(uncertain(variant, MOVING)), len(uncertain(variant, mode))
    return (*row[:5], *(at[f"P_{i}{j}"] for i in range(n - m, n) for j in range(i, n)))


def uncertain(variant: Variant, mode: float) -> list[int]:
    """States that are not known exactly in a mode; without e_i or e_F that one is zero."""
    errors = [k for k, option in zip((CURRENT_ERROR, FORCE_ERROR), variant) if option > 0.0]
    return [*((POSITION, POSITION_PREV) if is_moving(mode) else ()), FLUX_LINKAGE, *errors]


def varied_model(m: Model, varied: Varied, variant: Variant) -> Model:
    """The model of a run."""
    return m._replace(**varied._asdict(), has_force_error=variant.option_force_error)


def _tuned(tuning: Tuning, variant: Variant) -> ekf.Tuning:
    return ekf.Tuning(**tuning._asdict(), **variant._asdict())


@cache
def estimate_record(n: int) -> Any:
    """Class of an estimate of which `n` states are uncertain."""
    return NamedTuple("Estimate", [("x", Annotated[Array, Vector(5)]), ("P", Annotated[Array, Covariance(n)])])


def embedded(row: Any, states: Sequence[int]) -> Gaussian:
    """Estimate with the covariance of all five states."""
    P = matrix([[0.0] * 5] * 5)
    P[np.ix_(states, states)] = row.P
    return Gaussian(row.x, P)


def extracted(estimate: Gaussian, states: Sequence[int]) -> Any:
    """Estimate with the covariance of some states."""
    return estimate_record(len(states))(estimate.mean, estimate.cov[np.ix_(states, states)])


def compiled(function: Callable[..., Any], **arguments: type) -> Code:
    """A function on records, for flat rows."""
    return Code(trace(function, arguments))


class _Voltage(NamedTuple):
    """That of a sample, held until the next."""

    voltage: Scalar


class _True(NamedTuple):
    """Reference states of one sample."""

    x: Annotated[Array, Vector(5)]
