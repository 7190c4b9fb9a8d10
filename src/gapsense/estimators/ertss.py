"""Extended Rauch-Tung-Striebel smoother: the filter of `ekf`, and each motion improved by what its landing teaches.

[RTS], Section III.  When the mover has landed the samples of its motion are smoothed, one of them with each new sample,
from the landing back to the take-off; then they are published one by one with their own times.  The speed of the impact
is known with the landing.  An operation that lands before the one before it is published takes its place, and one of
more than `LENGTH` samples in motion is not smoothed.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated, NamedTuple

from gapsense.derivative import linearise
from gapsense.estimators import ekf
from gapsense.estimators.ekf import Parameters, Tuning, physical, process_noise, tuning
from gapsense.estimators.kalman import Gaussian, predict, project, smooth
from gapsense.estimators.readings import told
from gapsense.estimators.reduced_model import (
    FLUX_LINKAGE,
    FORCE_ERROR,
    POSITION,
    POSITION_PREV,
    Held,
    Model,
    acceleration,
    gap_law,
    is_moving,
    limit,
    magnetic_force,
    normalised,
    transition,
)
from gapsense.linalg import matrix, vector
from gapsense.records import Array, Covariance, Memory, Scalar, Vector, record, triangle, zeros
from gapsense.trace import clip, cond, fabs, load, not_, store, where

LENGTH = 1024  # samples of one motion
WIDTH = 25  # numbers per sample: x, upper triangle of P, voltage, resistance, hysteresis, two standard deviations
STD = 23  # place of the standard deviations
SPARE = 2 * LENGTH  # sample that takes idle writes, and the filter while nothing is published
SIZE = (2 * LENGTH + 1) * WIDTH

__all__ = ["Inputs", "Outputs", "Parameters", "State", "initial", "step"]


class Estimate(NamedTuple):
    """State and covariance of one sample, normalised."""

    mean: Annotated[Array, Vector(5)]
    cov: Annotated[Array, Covariance(5)]


class Motion(NamedTuple):
    """The motion being recorded, or the last one."""

    half: Scalar  # half of the memory that is written: 0 or 1
    count: Scalar  # samples of the motion so far
    start: Scalar  # time of the last sample before it [s]


class Smoothed(NamedTuple):
    """The motion being smoothed and published."""

    smoothed_half: Scalar  # half of the memory that is smoothed
    length: Scalar  # samples of the motion there
    left: Scalar  # how many of them are not smoothed yet
    published: Scalar  # how many of them were published
    first: Scalar  # time of the last sample before it [s]


class Operation(NamedTuple):
    """The last complete operation."""

    takeoff_time: Scalar
    landing_time: Scalar
    impact_speed: Scalar


class State(NamedTuple):
    """The filter, the motion being recorded, the motion being smoothed and published."""

    filter: ekf.State
    motion: Motion
    smoothed: Smoothed
    later: Estimate  # smoothed, of the sample after the next one to smooth
    last: Operation
    samples: Annotated[Array, Memory(SIZE)]


class Inputs(NamedTuple):
    """Measurements; `time` is that of the sample."""

    time: Scalar
    voltage: Scalar
    current: Scalar
    mode: Scalar
    resistance: Scalar = 0.0


class Shown(NamedTuple):
    """The smoothed estimates at `smoothed_time`."""

    smoothed_position: Scalar
    smoothed_velocity: Scalar
    smoothed_flux_linkage: Scalar
    smoothed_current_error: Scalar
    smoothed_force_error: Scalar
    smoothed_position_std: Scalar
    smoothed_velocity_std: Scalar


class Outputs(NamedTuple):
    """The filter's estimates at the sample, the smoothed ones at `smoothed_time`, the last complete operation."""

    filter: ekf.Outputs
    smoothed_published: Scalar  # 1: values of a sample in motion; 0: there is none, they are the filter's
    smoothed_time: Scalar
    smoothed: Shown
    last: Operation


def initial(inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """As in `ekf`; no operation has ended."""
    filtered, outputs = ekf.initial(_measured(inputs), par)
    now = outputs.estimates
    rest = Shown(now.position, 0.0, now.flux_linkage, 0.0, now.force_error, 0.0, 0.0)
    last = Operation(inputs.time, inputs.time, 0.0)
    motion, smoothed = Motion(0.0, 0.0, inputs.time), Smoothed(0.0, 0.0, 0.0, 0.0, inputs.time)
    nowhere = Estimate(vector([0.0] * 5), matrix([[0.0] * 5] * 5))
    return State(filtered, motion, smoothed, nowhere, last, zeros(SIZE)), Outputs(outputs, 0.0, inputs.time, rest, last)


def step(state: State, inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """One sample of the filter, one of the backward pass if a motion is to be smoothed, one published."""
    m = normalised(par)
    now, outputs = ekf.step(state.filter, _measured(inputs), par)
    state, lands = _recorded(state, inputs, now, par)
    state = _smoothed(state, inputs, lands, outputs.estimates, m, par)
    motion = state.smoothed
    is_published = (motion.left <= 0.0) & (motion.published < motion.length)
    shown = _shown(state.samples, where(is_published, motion.smoothed_half * LENGTH + motion.published, SPARE), m)
    published = where(is_published, motion.published + 1.0, motion.published)
    time = where(is_published, motion.first + published * par.sample_time, inputs.time)
    state = state._replace(smoothed=motion._replace(published=published))
    return state, Outputs(outputs, where(is_published, 1.0, 0.0), time, shown, state.last)


def _measured(inputs: Inputs) -> ekf.Inputs:
    return ekf.Inputs(inputs.voltage, inputs.current, inputs.mode, inputs.resistance)


def _recorded(state: State, inputs: Inputs, now: ekf.State, par: Parameters) -> tuple[State, Scalar]:
    """The filtered sample kept, if the mover moves; at a landing the motion becomes the one to be smoothed.

    The second value says whether a motion ends with this sample.
    """
    motion, smoothed = state.motion, state.smoothed
    moves, moved = is_moving(now.mode), is_moving(state.filter.mode)
    takes_off = moves & not_(moved)
    half = where(takes_off, 1.0 - motion.half, motion.half)
    count = where(takes_off, 1.0, where(moves, motion.count + 1.0, motion.count))
    start = where(takes_off, inputs.time - par.sample_time, motion.start)
    slot = where(moves & (count <= LENGTH), half * LENGTH + count - 1.0, SPARE)
    entries = [*now.x, *(now.P[i, j] for i, j in triangle(5)), now.voltage, now.resistance, now.hysteresis]
    lands = moved & not_(moves) & (count > 0.0) & (count <= LENGTH)
    smoothed = Smoothed(
        smoothed_half=where(lands, half, smoothed.smoothed_half),
        length=where(lands, count, smoothed.length),
        left=where(lands, count, smoothed.left),
        published=where(lands, 0.0, smoothed.published),
        first=where(lands, start, smoothed.first),
    )
    samples = _stored(state.samples, slot, 0, entries)
    return State(now, Motion(half, count, start), smoothed, state.later, state.last, samples), lands


def _smoothed(state: State, inputs: Inputs, lands: Scalar, now: ekf.Estimates, m: Model, par: Parameters) -> State:
    """One sample of the backward pass, if one is left."""
    smoothed, x = state.smoothed, state.filter.x
    is_busy = smoothed.left > 0.0
    slot = where(is_busy, smoothed.smoothed_half * LENGTH + smoothed.left - 1.0, SPARE)

    def back() -> tuple[Estimate, Operation, Array, tuple[Scalar, Scalar]]:
        filtered, voltage, resistance, hysteresis = _loaded(state.samples, slot)
        held, then = Held(voltage, 2.0, hysteresis), m._replace(R=told(resistance, par.coil_resistance))
        later = cond(lands, lambda: Estimate(x, state.filter.P), lambda: state.later)
        found = backward(filtered, held, Gaussian(later.mean, later.cov), then, tuning(par))
        last = cond(
            lands,
            lambda: Operation(state.motion.start, *impact(found.mean, limit(state.filter.mode), inputs.time, m)),
            lambda: state.last,
        )
        shown = physical(found, m)
        return Estimate(found.mean, found.cov), last, found.mean, (shown.position_std, shown.velocity_std)

    later, last, mean, stds = cond(
        is_busy, back, lambda: (state.later, state.last, x, (now.position_std, now.velocity_std))
    )
    samples = _stored(_stored(state.samples, slot, 0, mean), slot, STD, stds)
    smoothed = smoothed._replace(left=where(is_busy, smoothed.left - 1.0, smoothed.left))
    return state._replace(smoothed=smoothed, later=later, last=last, samples=samples)


def backward(filtered: Gaussian, held: Held, later: Gaussian, m: Model, tuned: Tuning) -> Gaussian:
    """Smoothed and projected estimate of a sample (44)-(46), from that of the next one; the prediction is repeated."""
    x, F = linearise(transition, filtered.mean, held, m)
    Q = process_noise(m, tuned)
    predicted = Gaussian(x, predict(filtered.cov, F, Q))
    return project(smooth(filtered, predicted, F, Q, later), POSITION, 0.0, 1.0)


def impact(x: Array, stop: Scalar, time: Scalar, m: Model) -> tuple[Scalar, Scalar]:
    """Time of the landing [s] and speed before it [m/s], from the last state in motion, one sample before `time`."""
    z, mean_v = x[POSITION], (x[POSITION] - x[POSITION_PREV]) / m.T_s
    force = magnetic_force(gap_law(z, m)[1], x[FLUX_LINKAGE]) + x[FORCE_ERROR]
    a = acceleration(z, mean_v, force, m)
    v = mean_v + 0.5 * m.T_s * a
    approaches = (stop - z) * v > 0.0
    delay = clip(where(approaches, (stop - z) / where(approaches, v, 1.0), 0.0), 0.0, m.T_s)
    return time - m.T_s + delay, m.l_z * fabs(v + a * delay)


def _stored(samples: Array, slot: Scalar, place: int, entries: Iterable[Scalar]) -> Array:
    for k, value in enumerate(entries):
        samples = store(samples, slot * WIDTH, value, place + k)
    return samples


def _loaded(samples: Array, slot: Scalar) -> tuple[Gaussian, Scalar, Scalar, Scalar]:
    """Filtered estimate, voltage, resistance and hysteresis of a sample."""
    values = [load(samples, slot * WIDTH, k) for k in range(STD)]
    estimate = record(Estimate, values)
    return Gaussian(estimate.mean, estimate.cov), *values[-3:]


def _shown(samples: Array, slot: Scalar, m: Model) -> Shown:
    """Smoothed values of a sample in SI units."""
    x = [load(samples, slot * WIDTH, k) for k in range(5)]
    stds = [load(samples, slot * WIDTH, STD + k) for k in range(2)]
    at = physical(Gaussian(vector(x), matrix([[0.0] * 5] * 5)), m)
    return Shown(at.position, at.velocity, at.flux_linkage, at.current_error, at.force_error, *stds)
