"""Reference states and process noise of the reduced model, [RTS] Sections IV-A and IV-C.

What the estimator's states would have to be for its model to give the samples of a simulated or measured cycle, and
what is then left of its transition from sample to sample.  For one model or for many at once, with wrong parameters.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from itertools import pairwise
from typing import Annotated, Any, NamedTuple

import numpy as np

from gapsense.estimators.reduced_model import Held, Model, current, gap_law, transition
from gapsense.kernels.lanes import Code, Plan, Row, plan
from gapsense.kernels.layout import Array, Scalar, Vector
from gapsense.kernels.linalg import vector

from .batch import Variant, Varied, compiled, varied_model
from .rts import Floats


class Reference(NamedTuple):
    """States (47) of all samples: (N,), and the two errors (runs, N)."""

    position: Floats
    position_prev: Floats
    flux_linkage: Floats
    current_error: Floats
    force_error: Floats


def reference_states(samples: Any, varied: Varied, m: Model) -> Reference:
    """States of the reduced model that give the samples, (47).

    The current error is i - f_i*(z, lambda, 0) (47c); the force error is what the position of the next sample needs,
    m (z_next - f_z*(z, z_prev, lambda, 0, q)) / T_s^2 (47d), so that the position has no process noise.
    The samples, of SI units, are at multiples of T_s, and the mover rests at both ends of them.
    """
    at, errors = _at(samples, m), _run(plan_of_errors, samples, varied, m)
    return Reference(at.z, at.z_prev, at.lam, *np.split(errors.T, 2, axis=1))


def _run(made: Callable[[Model, int], Plan], samples: Any, varied: Varied, m: Model) -> Floats:
    """What a plan over the samples gives, (results, runs)."""
    columns = np.stack([np.atleast_1d(value) for value in varied])
    return made(m, samples.time.size).run(columns.shape[1], varied=columns, **_at(samples, m)._asdict())


@cache
def plan_of_errors(m: Model, count: int) -> Plan:
    """The plan of both errors of so many samples; each entry of `_At` is a column."""

    def errors(varied: Row, **at: Row) -> Row:
        """Those of the current of all samples, then those of the force."""
        each = [_error_code(m)(_At(*row), varied) for row in zip(*at.values())]
        return tuple(error for errors in zip(*each) for error in errors)

    return plan(errors, varied=len(Varied._fields), **dict.fromkeys(_At._fields, count))


def reference_state(samples: Any, k: int, varied: Varied, m: Model) -> Row:
    """The states of one sample, of arrays or of what stands for them in a plan."""
    at = _At(*(float(values[k]) for values in _at(samples, m)))
    return at.z, at.z_prev, at.lam, *_error_code(m)(at, varied)


def process_noise(samples: Any, varied: Varied, m: Model) -> Floats:
    """Diagonal (5,) of Q: mean of w^2 over runs and the whole cycle, contacts included, (59)-(60).

    The states are those of each run's own model, so that the positions have no noise; that of e_F is in (N m)^2.
    """
    squares = squared_noise(samples, varied, m)
    return np.asarray(squares.sum(axis=1) / (squares.shape[1] * (samples.time.size - 1)))


def squared_noise(samples: Any, varied: Varied, m: Model) -> Floats:
    """Sums of w^2 over the cycle, w_k = x_(k+1) - f(x_k, u_k) (59), of all states and runs: (5, runs)."""
    return _run(plan_of_noise, samples, varied, m)


@cache
def plan_of_noise(m: Model, count: int) -> Plan:
    """The plan of `squared_noise` for so many samples; each entry of `_At` is a column."""

    def sums(varied: Row, **at: Row) -> Row:
        """Sums over the samples of a run."""
        samples = [_At(*row) for row in zip(*at.values())]
        states = ((row.z, row.z_prev, row.lam, *_error_code(m)(row, varied)) for row in samples)
        total: Row = (0.0,) * 5
        for row, (now, after) in zip(samples, pairwise(states)):
            total = _noise_code(m)(total, now, (row.voltage, row.mode), after, varied)
        return total

    return plan(sums, varied=len(Varied._fields), **dict.fromkeys(_At._fields, count))


def _at(samples: Any, m: Model) -> _At:
    z = (samples.position - m.z_min) / m.l_z
    before, after = np.append(z[0], z[:-1]), np.append(z[1:], z[-1])
    return _At(
        z=z,
        z_prev=before,
        z_next=after,
        lam=samples.flux_linkage,
        voltage=samples.voltage,
        current=samples.current,
        mode=samples.mode,
    )


class _At(NamedTuple):
    """A sample, its neighbours' positions and the inputs."""

    z: Scalar
    z_prev: Scalar
    z_next: Scalar
    lam: Scalar
    voltage: Scalar
    current: Scalar
    mode: Scalar


class _Errors(NamedTuple):
    current: Scalar
    force: Scalar


class _Input(NamedTuple):
    """u_k (21)."""

    voltage: Scalar
    mode: Scalar


class _State(NamedTuple):
    x: Annotated[Array, Vector(5)]


@cache
def _error_code(m: Model) -> Code:
    def errors(at: _At, varied: Varied) -> _Errors:
        """The errors e_i and e_F that explain a sample."""
        model = varied_model(m, varied, Variant())
        x = vector([at.z, at.z_prev, at.lam, 0.0, 0.0])
        predicted = transition(x, Held(at.voltage, at.mode), model)[0]
        e_i = at.current - current(gap_law(at.z, model)[0], at.lam, 0.0, model)
        return _Errors(e_i, model.m * (at.z_next - predicted) / (model.T_s * model.T_s))

    return compiled(errors, at=_At, varied=Varied)


@cache
def _noise_code(m: Model) -> Code:
    def added(total: _State, now: _State, held: _Input, after: _State, varied: Varied) -> _State:
        w = after.x - transition(now.x, Held(*held), varied_model(m, varied, Variant()))
        return _State(total.x + w * w)

    return compiled(added, total=_State, now=_State, held=_Input, after=_State, varied=Varied)
