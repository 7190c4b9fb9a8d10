"""Filter and smoother over a record: a Python function from arrays to the posterior, [RTS], Section III.

In a co-simulation the component `Ertss` does the same sample by sample.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gapsense.estimators import ekf, kinks
from gapsense.estimators.ekf import Parameters, physical, tuning
from gapsense.estimators.ertss import Estimate, backward, fix_on_stop, impact
from gapsense.estimators.kalman import Gaussian
from gapsense.estimators.motions import Motion
from gapsense.estimators.reduced_model import Held, limit, normalise_model
from gapsense.kernels.emit import compile_graph
from gapsense.kernels.kernel import Kernel, trace
from gapsense.kernels.layout import Scalar, flat, names, record, triangle
from gapsense.kernels.linalg import vector

MOTION, BOUNCE, GLITCH = "motion", "bounce", "glitch"

Floats = NDArray[np.float64]


class Estimates(NamedTuple):
    """Estimates of all samples; `mean` and `cov` normalised, the others in SI units."""

    mean: Floats  # (N, 5)
    cov: Floats  # (N, 5, 5)
    position: Floats  # (N,), as the following
    velocity: Floats
    flux_linkage: Floats
    current_error: Floats
    force_error: Floats
    position_std: Floats
    velocity_std: Floats
    flux_linkage_std: Floats
    current_error_std: Floats
    force_error_std: Floats


class Reading(NamedTuple):
    """A reading of the current [A]."""

    value: Scalar


class Operation(NamedTuple):
    """One motion: samples `first` to `landed - 1` are in motion."""

    first: int
    landed: int  # first sample on the stop, or after an impact that the contact has missed
    takeoff_time: float  # of the last sample at rest [s]
    landing_time: float  # between two samples [s]
    impact_speed: float  # [m/s]
    bounces: int
    rest_time: float  # of the last contact [s]


class Posterior(NamedTuple):
    """What filter and smoother make of a record; outside complete motions the smoothed are the filtered estimates."""

    filtered: Estimates
    smoothed: Estimates
    operations: list[Operation]


def smooth_record(
    voltage: ArrayLike, current: ArrayLike, mode: ArrayLike, par: Parameters, debounce: float = 0.0
) -> Posterior:
    """Filter the record, and smooth every motion of it that lands.

    Parameters
    ----------
    voltage, current, mode : (N,) arrays
        Samples at 0, T_s, 2 T_s, ... [V, A, 1]; the first one at rest on a stop. Lost ones are not a number.
    par : Parameters
        Those of the component `Ekf`; `option_force_error` and `option_current_error` 0 for the paper's ablations.
    debounce : float
        A mover that is back on its stop within this time has bounced [s]; 0 as in the paper.
    """
    inputs = (np.asarray(signal, float).tolist() for signal in (voltage, current, mode))
    rows = [(*given, 0.0) for given in zip(*inputs)]
    states = _filter(rows, par)
    width = len(names(Estimate))  # of what a state begins with
    places = [names(ekf.State).index(name) for name in Held._fields]
    filtered, held = [s[:width] for s in states], [Held(*(s[place] for place in places)) for s in states]
    smoothed, T_s, q = list(filtered), par.sample_time, [at.mode for at in held]
    operations: list[Operation] = []
    told = kinks.no_kink()
    for first, end, kind in _moving(q, debounce / T_s):
        if kind == MOTION:
            landed, later, is_told = end, filtered[end], False
            if debounce > 0.0:
                landed, later, is_told, told = _landing(first, end, rows, states, told, par)
            for k in range(landed - 1, first - 1, -1):
                smoothed[k] = later = _backward()(filtered[k], held[k], later, par)
            operations.append(_operation(first, landed, end, smoothed[landed - 1], limit(q[end]), par))
            if is_told:
                last, before, after = operations[-1], _gaussian(smoothed[landed - 1]), _gaussian(filtered[end])
                time, m = last.rest_time - last.landing_time, normalise_model(par)
                told = kinks.learnt(told, before, last.impact_speed, time, after, limit(q[end]), m)
        elif operations and kind == BOUNCE:
            operations[-1] = operations[-1]._replace(bounces=operations[-1].bounces + 1, rest_time=end * T_s)
    return Posterior(_estimates(filtered, par), _estimates(smoothed, par), operations)


def _operation(
    first: int, landed: int, contact: int, last: tuple[float, ...], stop: float, par: Parameters
) -> Operation:
    """A motion that lands on a stop, by the last smoothed estimate in it; `contact` is later if that missed it."""
    T_s, has_bounced = par.sample_time, contact > landed
    time, speed = impact(vector(last[:5]), stop, landed * T_s, normalise_model(par))
    rest_time = contact * T_s if has_bounced else time
    return Operation(
        first=first,
        landed=landed,
        takeoff_time=(first - 1) * T_s,
        landing_time=time,
        impact_speed=speed,
        bounces=int(has_bounced),
        rest_time=rest_time,
    )


def _landing(
    first: int,
    end: int,
    rows: list[tuple[float, ...]],
    states: list[tuple[float, ...]],
    told: kinks.Told,
    par: Parameters,
) -> tuple[int, tuple[float, ...], bool, kinks.Told]:
    """Sample of the landing, and its estimate; it is at `end`, or at an impact that the contact has missed.

    Also whether the current has shown it, and what that says about the next one.
    """
    kink, stop = tuple(flat(kinks.nothing())), limit(states[end][names(ekf.State).index("mode")])
    for k in range(first + 1, end + 1):
        motion = Motion(place=0.0, count=float(k - first), start=0.0, stop=1.0 - stop, contact=0.0)
        kink = _seek_kink()(kink, motion, (rows[k][1],), states[k - 1], states[k], par)
    m = normalise_model(par)
    seen, whole = record(kinks.Kink, kink), float(end - first)
    kinked = _gaussian(states[first + int(kinks.suppose_impact(seen, whole))])
    found = kinks.credible(seen, kinked, record(ekf.State, states[end]), stop, m, par)
    count = kinks.suppose_impact(found, whole)
    verdict = kinks.judge_landing(found, _gaussian(states[first + int(count)]), stop, told, m, par)
    if not verdict.is_missed:
        return end, states[end][: len(names(Estimate))], False, verdict.told
    if not verdict.is_told:
        before = _gaussian(states[first + int(found.arrival) - 1])
        count = kinks.hidden_impact(whole, found.arrival, before, _gaussian(states[end]), stop, verdict.told, m)
    at = first + int(count)
    return at, tuple(flat(fix_on_stop(_gaussian(states[at]), stop))), bool(verdict.is_told), verdict.told


def _gaussian(state: tuple[float, ...]) -> Gaussian:
    """Of what a state begins with."""
    estimate: Estimate = record(Estimate, state[: len(names(Estimate))])
    return Gaussian(*estimate)


def motions(mode: ArrayLike, debounce: float = 0.0) -> list[tuple[int, int]]:
    """First sample and landing sample of every motion that starts and ends at rest.

    Not counted are a glitch of at most `debounce` samples, and a bounce that begins within as many after a landing, if
    they end on the stop where they began.
    """
    return [(first, end) for first, end, kind in _moving(mode, debounce) if kind == MOTION]


def _moving(mode: ArrayLike, debounce: float) -> Iterator[tuple[int, int, str]]:
    """First sample of every time in motion, the sample at rest that ends it, and what it was."""
    q = np.asarray(mode, float)
    moving = (q > 1.5) & (q < 2.5)
    change = np.flatnonzero(moving[1:] != moving[:-1]) + 1
    starts, ends = change[moving[change]], change[~moving[change]]
    contact = ends[0] if len(ends) and (not len(starts) or ends[0] < starts[0]) else 0
    ends = ends[ends > starts[0]] if len(starts) else ends[:0]
    for a, b in zip(starts, ends):
        is_back = limit(q[a - 1]) == limit(q[b])
        is_bounce = is_back and debounce > 0.0 and a - 1 - contact - 0.5 <= debounce
        kind = BOUNCE if is_bounce else GLITCH if is_back and b - a - 0.5 <= debounce else MOTION
        contact = contact if kind == GLITCH else b
        yield int(a), int(b), kind


def _filter(inputs: list[tuple[float, ...]], par: Parameters) -> list[tuple[float, ...]]:
    """Flat states of the filter at all samples."""
    scalar = _kernel().scalar
    advance, constants = scalar["advance"], scalar["constants"](tuple(par))
    state, _ = scalar["initial"](inputs[0], tuple(par))
    states = [state]
    for given in inputs[1:]:
        state, _ = advance(state, given, constants)
        states.append(state)
    return states


@cache
def _kernel() -> Kernel:
    return Kernel(ekf)


@cache
def _seek_kink() -> Callable[..., tuple[float, ...]]:
    """`kinks.seek` as scalar Python on flat tuples."""

    def sought(
        kink: kinks.Kink, motion: Motion, current: Reading, before: ekf.State, now: ekf.State, par: Parameters
    ) -> kinks.Kink:
        return kinks.seek(kink, motion, current.value, before, now, normalise_model(par), par)

    states = {"before": ekf.State, "now": ekf.State}
    return compile_graph(
        trace(sought, {"kink": kinks.Kink, "motion": Motion, "current": Reading, **states, "par": Parameters})
    )


@cache
def _backward() -> Callable[..., tuple[float, ...]]:
    """`ertss.backward` as scalar Python on flat tuples."""

    def smoothed(before: Estimate, held: Held, after: Estimate, par: Parameters) -> Estimate:
        filtered, later = (Gaussian(e.mean, e.cov) for e in (before, after))
        found = backward(filtered, held, later, normalise_model(par), tuning(par))
        return Estimate(found.mean, found.cov)

    arguments = {"before": Estimate, "held": Held, "after": Estimate, "par": Parameters}
    return compile_graph(trace(smoothed, arguments))


@cache
def _physical() -> Callable[..., tuple[float, ...]]:
    """`ekf.physical` as scalar Python on flat tuples."""

    def told(at: Estimate, par: Parameters) -> ekf.Estimates:
        return physical(Gaussian(at.mean, at.cov), normalise_model(par))

    return compile_graph(trace(told, {"at": Estimate, "par": Parameters}))


def _estimates(entries: list[tuple[float, ...]], par: Parameters) -> Estimates:
    values = np.array(entries, float)
    mean, cov = values[:, :5], np.empty((len(values), 5, 5))
    for k, (i, j) in enumerate(triangle(5)):
        cov[:, i, j] = cov[:, j, i] = values[:, 5 + k]
    told = _physical()
    rows = [told(entry, par) for entry in entries]
    return Estimates(mean, cov, **dict(zip(ekf.Estimates._fields, np.array(rows, float).T)))
