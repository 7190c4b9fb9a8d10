"""Extended Rauch-Tung-Striebel smoother: the filter of `ekf`, and each motion improved by what its landing teaches.

[RTS], Section III.  When the mover has landed the samples of its motion are smoothed, one of them with each new sample,
from the landing back to the take-off; then they are published one by one with their own times.  The speed of the impact
is known with the landing.  An operation that lands before the one before it is published takes its place, and one of
more than `LENGTH` samples in motion is not smoothed.
"""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

from gapsense.derivative import linearise
from gapsense.estimators import ekf
from gapsense.estimators.ekf import Parameters, physical, process_noise
from gapsense.estimators.kalman import Gaussian, predict, project, smooth
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
from gapsense.records import Array, Covariance, Memory, Scalar, Vector, triangle, zeros
from gapsense.trace import clip, cond, fabs, load, not_, store, where

LENGTH = 1024  # samples of one motion
WIDTH = 23  # numbers per sample: x, upper triangle of P, voltage, two standard deviations
STD = 21  # place of the standard deviations
SPARE = 2 * LENGTH  # sample that takes idle writes, and the filter while nothing is published
SIZE = (2 * LENGTH + 1) * WIDTH

__all__ = ["Inputs", "Outputs", "Parameters", "State", "initial", "step"]


class State(NamedTuple):
    """The filter, the motion being recorded, the motion being smoothed and published."""

    x: Annotated[Array, Vector(5)]
    P: Annotated[Array, Covariance(5)]
    voltage: Scalar
    mode: Scalar
    surprise: Scalar
    half: Scalar  # half of the memory that is written: 0 or 1
    count: Scalar  # samples of the motion so far
    start: Scalar  # time of the last sample before it [s]
    smoothed_half: Scalar  # half of the memory that is smoothed
    length: Scalar  # samples of the motion there
    left: Scalar  # how many of them are not smoothed yet
    published: Scalar  # how many of them were published
    first: Scalar  # time of the last sample before it [s]
    later_mean: Annotated[Array, Vector(5)]  # smoothed estimate of the sample after the next one to smooth
    later_cov: Annotated[Array, Covariance(5)]
    takeoff_time: Scalar
    landing_time: Scalar
    impact_speed: Scalar
    samples: Annotated[Array, Memory(SIZE)]


class Inputs(NamedTuple):
    """Measurements; `time` is that of the sample."""

    time: Scalar
    voltage: Scalar
    current: Scalar
    mode: Scalar


class Outputs(NamedTuple):
    """The filter's estimates at the sample, the smoothed ones at `smoothed_time`, the last complete operation."""

    position: Scalar
    velocity: Scalar
    flux_linkage: Scalar
    current_error: Scalar
    force_error: Scalar
    position_std: Scalar
    velocity_std: Scalar
    flux_linkage_std: Scalar
    current_error_std: Scalar
    force_error_std: Scalar
    innovation: Scalar
    innovation_std: Scalar
    health: Scalar
    smoothed_published: Scalar  # 1: values of a sample in motion; 0: there is none, they are the filter's
    smoothed_time: Scalar
    smoothed_position: Scalar
    smoothed_velocity: Scalar
    smoothed_flux_linkage: Scalar
    smoothed_current_error: Scalar
    smoothed_force_error: Scalar
    smoothed_position_std: Scalar
    smoothed_velocity_std: Scalar
    takeoff_time: Scalar
    landing_time: Scalar
    impact_speed: Scalar


def initial(inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """As in `ekf`; no operation has ended."""
    filtered, outputs = ekf.initial(ekf.Inputs(inputs.voltage, inputs.current, inputs.mode), par)
    none = (0.0, 0.0, inputs.time, 0.0, 0.0, 0.0, 0.0, inputs.time)
    nowhere = (vector([0.0] * 5), matrix([[0.0] * 5] * 5))
    times = (inputs.time, inputs.time, 0.0)
    rest = (outputs.position, 0.0, outputs.flux_linkage, 0.0, outputs.force_error, 0.0, 0.0)
    return State(*(*filtered, *none, *nowhere, *times, zeros(SIZE))), Outputs(
        *(*outputs, 0.0, inputs.time, *rest, *times)
    )


class _Motion(NamedTuple):
    """Counters of the motion that is recorded and of the one that is smoothed, after this sample."""

    half: Scalar
    count: Scalar
    start: Scalar
    lands: Scalar  # truth value: a motion ends with this sample
    smoothed_half: Scalar
    length: Scalar
    left: Scalar
    first: Scalar
    samples: Array


def step(state: State, inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """One sample of the filter, one of the backward pass if a motion is to be smoothed, one published."""
    m = normalised(par)
    before = ekf.State(state.x, state.P, state.voltage, state.mode, state.surprise)
    now, outputs = ekf.step(before, ekf.Inputs(inputs.voltage, inputs.current, inputs.mode), par)
    motion = _recorded(state, inputs, now, par)
    left, samples, later, landing = _smoothed(state, inputs, now, outputs, motion, m, par)

    published = where(motion.lands, 0.0, state.published)
    is_published = (left <= 0.0) & (published < motion.length)
    shown = _shown(samples, where(is_published, motion.smoothed_half * LENGTH + published, SPARE), m)
    published = where(is_published, published + 1.0, published)
    time = where(is_published, motion.first + published * par.sample_time, inputs.time)
    counters = (motion.half, motion.count, motion.start, motion.smoothed_half, motion.length, left)
    new = State(*(*now, *counters, published, motion.first, *later, *landing, samples))
    return new, Outputs(*(*outputs, where(is_published, 1.0, 0.0), time, *shown, *landing))


def _recorded(state: State, inputs: Inputs, now: ekf.State, par: Parameters) -> _Motion:
    """The filtered sample kept, if the mover moves; at a landing the motion becomes the one to be smoothed."""
    moves, moved = is_moving(inputs.mode), is_moving(state.mode)
    takes_off = moves & not_(moved)
    half = where(takes_off, 1.0 - state.half, state.half)
    count = where(takes_off, 1.0, where(moves, state.count + 1.0, state.count))
    start = where(takes_off, inputs.time - par.sample_time, state.start)
    slot = where(moves & (count <= LENGTH), half * LENGTH + count - 1.0, SPARE)
    entries = [*now.x, *(now.P[i, j] for i, j in triangle(5)), inputs.voltage]
    lands = moved & not_(moves) & (count > 0.0) & (count <= LENGTH)
    return _Motion(
        half,
        count,
        start,
        lands,
        smoothed_half=where(lands, half, state.smoothed_half),
        length=where(lands, count, state.length),
        left=where(lands, count, state.left),
        first=where(lands, start, state.first),
        samples=_stored(state.samples, slot, 0, entries),
    )


def _smoothed(
    state: State, inputs: Inputs, now: ekf.State, outputs: ekf.Outputs, motion: _Motion, m: Model, par: Parameters
) -> tuple[Scalar, Array, Any, Any]:
    """One sample of the backward pass, if one is left: samples left, the memory, the later estimate, the landing."""
    is_busy = motion.left > 0.0
    slot = where(is_busy, motion.smoothed_half * LENGTH + motion.left - 1.0, SPARE)
    last_landing = (state.takeoff_time, state.landing_time, state.impact_speed)
    last = (state.later_mean, state.later_cov)

    def back() -> Any:
        x, P, voltage = _loaded(motion.samples, slot)
        later = Gaussian(*cond(motion.lands, lambda: (now.x, now.P), lambda: last))
        found = backward(Gaussian(x, P), Held(voltage, 2.0), later, m, par)
        landing = cond(
            motion.lands,
            lambda: (motion.start, *impact(found.mean, limit(inputs.mode), inputs.time, m)),
            lambda: last_landing,
        )
        return (found.mean, found.cov), landing, (*found.mean, *physical(found, m)[5:7])

    def idle() -> Any:
        return last, last_landing, (*now.x, outputs.position_std, outputs.velocity_std)

    later, landing, entries = cond(is_busy, back, idle)
    samples = _stored(motion.samples, slot, 0, entries[:5])
    samples = _stored(samples, slot, STD, entries[5:])
    return where(is_busy, motion.left - 1.0, motion.left), samples, later, landing


def backward(filtered: Gaussian, held: Held, later: Gaussian, m: Model, par: Any) -> Gaussian:
    """Smoothed and projected estimate of a sample (44)-(46), from that of the next one; the prediction is repeated."""
    x, F = linearise(transition, filtered.mean, held, m)
    Q = process_noise(m, par)
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


def _stored(samples: Array, slot: Scalar, place: int, entries: Any) -> Array:
    for k, value in enumerate(entries):
        samples = store(samples, slot * WIDTH, value, place + k)
    return samples


def _loaded(samples: Array, slot: Scalar) -> tuple[Array, Array, Scalar]:
    """Filtered estimate and voltage of a sample."""
    values = [load(samples, slot * WIDTH, k) for k in range(STD)]
    place = {pair: 5 + k for k, pair in enumerate(triangle(5))}
    P = matrix([[values[place[min(i, j), max(i, j)]] for j in range(5)] for i in range(5)])
    return vector(values[:5]), P, values[STD - 1]


def _shown(samples: Array, slot: Scalar, m: Model) -> tuple[Scalar, ...]:
    """Smoothed values of a sample in SI units."""
    x = [load(samples, slot * WIDTH, k) for k in range(5)]
    stds = [load(samples, slot * WIDTH, STD + k) for k in range(2)]
    nothing = matrix([[0.0] * 5] * 5)
    return (*physical(Gaussian(vector(x), nothing), m)[:5], *stds)
