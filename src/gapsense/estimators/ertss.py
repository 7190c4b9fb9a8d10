"""Extended Rauch-Tung-Striebel smoother: the filter of `ekf`, and a smoothed trajectory after each landing.

[RTS], Section III.  When the mover has landed, the samples of its motion are smoothed from the landing back to the
take-off, one with each new sample. Then they are published one by one with their own times.  The speed of the impact is
known with the landing.  Operations that follow each other fast wait for their turn, and all are published; of a motion
of more than `motion.memory` samples only the last ones.  `motions` says what is a motion and whose turn it is.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from gapsense.estimators import ekf, kinks, motions, readings
from gapsense.estimators.ekf import ROWS as ROWS
from gapsense.estimators.ekf import Arrays, Tuning, physical, process_noise, tuning
from gapsense.estimators.kalman import Gaussian, fix, predict, project, smooth
from gapsense.estimators.reduced_model import (
    FLUX_LINKAGE,
    FORCE_ERROR,
    POSITION,
    POSITION_PREV,
    Held,
    Model,
    acceleration,
    gap_law,
    limit,
    magnetic_force,
    normalise_model,
    transition,
)
from gapsense.kernels.derivative import linearise
from gapsense.kernels.interface import output, parameter, part, ports, same
from gapsense.kernels.layout import Array, Covariance, Memory, Scalar, Vector, blank, flat, names, record, zeros
from gapsense.kernels.trace import clip, cond, fabs, load, store, where

__all__ = ["Inputs", "Outputs", "Parameters", "State", "initial", "step"]


@ports()
class Parameters(NamedTuple):
    """Parameters of the filter, the shortest time away from a stop that counts as a motion, and how long one may be."""

    filter: ekf.Parameters = ekf.Parameters()
    contact_debounce: Scalar = parameter(
        "s", "A mover that leaves its stop and is back in this time has bounced", 0.2e-3, min=0.0
    )
    motion_memory: Scalar = parameter(
        "1",
        "Samples of a motion that are kept, the last ones; exported C has memory for no more",
        float(motions.LENGTH),
        min=2.0,
        max=float(motions.LENGTH),
    )


class Estimate(NamedTuple):
    """State and covariance of one sample, normalised."""

    mean: Annotated[Array, Vector(5)]
    cov: Annotated[Array, Covariance(5)]


class Sample(NamedTuple):
    """One sample in memory: the estimate, filtered and later smoothed, and the inputs until the next sample."""

    kept: Estimate
    held_voltage: Scalar
    held_resistance: Scalar
    held_hysteresis: Scalar


@ports()
class Operation(NamedTuple):
    """The last complete operation."""

    takeoff_time: Scalar = output("s", "Last sample at rest before the last motion that has landed", nominal=0.01)
    landing_time: Scalar = output("s", "Landing of the last motion", nominal=0.01)
    impact_speed: Scalar = output("m/s", "Speed before that landing", min=0.0)
    bounces: Scalar = output("1", "How often the mover came off its stop again after it", min=0.0)
    rest_time: Scalar = output("s", "Last contact after it; the landing if there was no bounce", nominal=0.01)


class Landing(NamedTuple):
    """Where a motion has landed."""

    count: Scalar  # samples of the motion before it
    estimate: Estimate  # at it
    missed: Scalar  # samples from it to the contact; 0: the contact has shown it
    is_doubtful: Scalar  # 1: there may have been an impact before it that nothing has shown
    is_told: Scalar  # 1: the current has shown that there was an impact before the contact
    told: kinks.Told


WIDTH = len(names(Sample))
SIZE = motions.RING * WIDTH


class State(NamedTuple):
    """The filter, the motion being recorded, and the motions that wait to be smoothed and published."""

    filter: ekf.State
    motion: motions.Motion
    queue: motions.Queue
    kink: kinks.Kink
    last: Operation
    is_doubtful: Scalar  # 1: the last landing may not have been the first impact
    told: kinks.Told
    samples: Annotated[Array, Memory(SIZE, used="motion_memory")]


EKF = same(ekf.Inputs)


@ports()
class Inputs(NamedTuple):
    """Measurements; `time` is that of the sample."""

    time: Scalar
    voltage: Scalar = EKF
    current: Scalar = EKF
    mode: Scalar = EKF
    resistance: Scalar = EKF


@ports()
class Shown(NamedTuple):
    """The smoothed estimates at `smoothed_time`."""

    smoothed_position: Scalar = output("m", "Smoothed position", nominal=1e-3)
    smoothed_velocity: Scalar = output("m/s", "Smoothed mean velocity since the sample before", nominal=0.5)
    smoothed_flux_linkage: Scalar = output("Wb", "Smoothed flux linkage", nominal=0.02)
    smoothed_current_error: Scalar = output("A", "Smoothed error of the model's current", nominal=0.1)
    smoothed_force_error: Scalar = output("N", "Smoothed error of the model's force")
    smoothed_position_std: Scalar = output("m", "Its standard deviation", nominal=1e-4, min=0.0)
    smoothed_velocity_std: Scalar = output("m/s", "Its standard deviation", nominal=0.1, min=0.0)


@ports(feedthrough=("current", "mode"))
class Outputs(NamedTuple):
    """The filter's estimates at the sample, the smoothed ones at `smoothed_time`, the last complete operation."""

    filter: ekf.Outputs
    smoothed_published: Scalar = output(
        "1", "1: smoothed values of the sample at smoothed_time; 0: those of the filter, now", min=0.0, max=1.0
    )
    smoothed_time: Scalar = output("s", "Time of the sample that the smoothed values belong to", nominal=0.01)
    smoothed: Shown = part()
    last: Operation = part()


def initial(inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """As in `ekf`; no operation has ended."""
    filtered, outputs = ekf.initial(_measure(inputs), par.filter)
    now = outputs.estimates
    rest = blank(
        Shown,
        smoothed_position=now.position,
        smoothed_flux_linkage=now.flux_linkage,
        smoothed_force_error=now.force_error,
    )
    last = Operation(
        takeoff_time=inputs.time, landing_time=inputs.time, impact_speed=0.0, bounces=0.0, rest_time=inputs.time
    )
    state = State(
        filtered,
        *motions.nothing(inputs.time),
        kink=kinks.nothing(),
        last=last,
        is_doubtful=0.0,
        told=kinks.no_kink(),
        samples=zeros(SIZE),
    )
    return state, Outputs(filter=outputs, smoothed_published=0.0, smoothed_time=inputs.time, smoothed=rest, last=last)


def step(state: State, inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """One sample of the filter, one of the backward pass if a motion is to be smoothed, one published if one is."""
    m, kept = normalise_model(par.filter), motions.room_for(par.motion_memory)
    filtered, outputs = ekf.step(state.filter, _measure(inputs), par.filter)
    contact = motions.Contact(
        time=inputs.time,
        mode=filtered.mode,
        mode_prev=state.filter.mode,
        sample_time=par.filter.sample_time,
        debounce=par.contact_debounce,
        room=kept,
    )
    now = motions.follow(state.motion, contact)
    kink = kinks.seek(state.kink, state.motion, inputs.current, state.filter, filtered, m, par.filter)
    landing = _landing(state, now, kink, contact, filtered, m, par)
    now, estimate = now._replace(motion=now.motion._replace(count=landing.count)), landing.estimate
    new = Sample(estimate, filtered.voltage, filtered.resistance, filtered.hysteresis)
    samples = _store(state.samples, motions.to_keep(now, contact), new, kept)
    queue, turn = motions.to_smooth(motions.join(state.queue, now, contact), now, kept)
    found = cond(turn.is_due, lambda: _smooth(samples, turn.place, m, par, kept), lambda: estimate)
    samples = _store(samples, turn, found, kept)
    last = _last(state, now, contact, landing, found, m)
    told = _note_bounces(landing, last, found, Estimate(filtered.x, filtered.P), limit(contact.mode), m)
    outputs = outputs._replace(health=readings.worse(outputs.health, readings.IMPACT, landing.is_doubtful))
    queue, turn, time = motions.to_show(queue, contact)
    shown = cond(
        turn.is_due, lambda: physical(Gaussian(*_load(samples, turn.place, kept).kept), m), lambda: outputs.estimates
    )
    is_published, time = where(turn.is_due, 1.0, 0.0), where(turn.is_due, time, inputs.time)
    return State(
        filter=filtered,
        motion=now.motion,
        queue=queue,
        kink=kink,
        last=last,
        is_doubtful=landing.is_doubtful,
        told=told,
        samples=samples,
    ), Outputs(
        filter=outputs, smoothed_published=is_published, smoothed_time=time, smoothed=_outputs_of(shown), last=last
    )


def _measure(inputs: Inputs) -> ekf.Inputs:
    return ekf.Inputs(inputs.voltage, inputs.current, inputs.mode, inputs.resistance)


def _landing(
    state: State,
    now: motions.Followed,
    kink: kinks.Kink,
    contact: motions.Contact,
    filtered: ekf.State,
    m: Model,
    par: Parameters,
) -> Landing:
    """The landing of a motion that lands: where the contact says, or at an impact that only the current has shown."""
    motion, estimate = now.motion, Estimate(filtered.x, filtered.P)

    def here(is_doubtful: Scalar, told: kinks.Told) -> Landing:
        return Landing(
            count=motion.count, estimate=estimate, missed=0.0, is_doubtful=is_doubtful, is_told=0.0, told=told
        )

    def kept(count: Scalar) -> Gaussian:
        return Gaussian(*_load(state.samples, motion.place + count, contact.room).kept)

    def judged(believed: kinks.Kink, count: Scalar) -> Landing:
        """The landing at the impact of the current, where the contact closed too late."""
        stop = limit(contact.mode)
        verdict = kinks.judge_landing(believed, kept(count), stop, state.told, m, par.filter)
        is_doubtful = where(verdict.is_doubtful, 1.0, 0.0)

        def guessed() -> Scalar:
            before, end = kept(kink.arrival - 1.0), Gaussian(*estimate)
            return kinks.hidden_impact(motion.count, kink.arrival, before, end, stop, verdict.told, m)

        def missed() -> Landing:
            first = cond(verdict.is_told, lambda: count, guessed)
            return Landing(
                count=first,
                estimate=fix_on_stop(kept(first), stop),
                missed=motion.count - first,
                is_doubtful=is_doubtful,
                is_told=where(verdict.is_told, 1.0, 0.0),
                told=verdict.told,
            )

        return cond(verdict.is_missed, missed, lambda: here(is_doubtful, verdict.told))

    def landed() -> Landing:
        at = kept(kinks.suppose_impact(kink, motion.count))
        believed = kinks.credible(kink, at, filtered, limit(contact.mode), m, par.filter)
        count = kinks.suppose_impact(believed, motion.count)
        is_kept = motion.count - count < contact.room.length
        return cond(is_kept, lambda: judged(believed, count), lambda: here(1.0, state.told))

    return cond(now.lands & (par.contact_debounce > 0.0), landed, lambda: here(state.is_doubtful, state.told))


def _note_bounces(
    landing: Landing, last: Operation, found: Estimate, end: Estimate, stop: Scalar, m: Model
) -> kinks.Told:
    """Note what a sample tells of bounces."""
    before, after, time = Gaussian(*found), Gaussian(*end), last.rest_time - last.landing_time

    def learnt() -> kinks.Told:
        return kinks.learnt(landing.told, before, last.impact_speed, time, after, stop, m)

    return cond(landing.is_told > 0.0, learnt, lambda: landing.told)


def _last(
    state: State, now: motions.Followed, contact: motions.Contact, landing: Landing, found: Estimate, m: Model
) -> Operation:
    """The last operation: a new one after a landing; one bounce more if the mover has come back from a bounce."""
    last, bounces = state.last, now.bounces & (state.queue.landed > 0.0)

    def landed() -> Operation:
        shown = contact.time - landing.missed * contact.sample_time
        time, speed = impact(found.mean, limit(contact.mode), shown, m)
        has_bounced = landing.missed > 0.0
        rest_time = where(has_bounced, contact.time, time)
        return Operation(
            takeoff_time=now.motion.start,
            landing_time=time,
            impact_speed=speed,
            bounces=where(has_bounced, 1.0, 0.0),
            rest_time=rest_time,
        )

    def rested() -> Operation:
        count, time = where(bounces, last.bounces + 1.0, last.bounces), where(bounces, contact.time, last.rest_time)
        return last._replace(bounces=count, rest_time=time)

    return cond(now.lands, landed, rested)


def _smooth(samples: Array, place: Scalar, m: Model, par: Parameters, room: motions.Room) -> Estimate:
    """Smoothed estimate of a sample, from that of the next one."""
    at, later = _load(samples, place, room), _load(samples, place + 1.0, room)
    held, m = Held(at.held_voltage, 2.0, at.held_hysteresis), m._replace(R=at.held_resistance)
    return Estimate(*backward(Gaussian(*at.kept), held, Gaussian(*later.kept), m, tuning(par.filter)))


def backward(filtered: Gaussian, held: Held, later: Gaussian, m: Model, tuned: Tuning) -> Gaussian:
    """Smoothed and projected estimate of a sample (44)-(46), from that of the next one; the prediction is repeated."""
    x, F = linearise(transition, filtered.mean, held, m)
    Q = process_noise(m, tuned)
    predicted = Gaussian(x, predict(filtered.cov, F, Q))
    return project(smooth(filtered, predicted, F, Q, later), POSITION, 0.0, 1.0)


def fix_on_stop(at: Gaussian, stop: Scalar) -> Estimate:
    """Estimate, given that the mover is on its stop."""
    return Estimate(*fix(at, POSITION, stop))


def impact(x: Array, stop: Scalar, time: Scalar, m: Model) -> tuple[Scalar, Scalar]:
    """Time of the landing [s] and speed before it [m/s], from the last state in motion, one sample before `time`."""
    z, mean_v = x[POSITION], (x[POSITION] - x[POSITION_PREV]) / m.T_s
    force = magnetic_force(gap_law(z, m)[1], x[FLUX_LINKAGE]) + x[FORCE_ERROR]
    a = acceleration(z, mean_v, force, m)
    v = mean_v + 0.5 * m.T_s * a
    approaches = (stop - z) * v > 0.0
    delay = clip(where(approaches, (stop - z) / where(approaches, v, 1.0), 0.0), 0.0, m.T_s)
    return time - m.T_s + delay, m.l_z * fabs(v + a * delay)


def _store(samples: Array, turn: motions.Turn, values: Sample | Estimate, room: motions.Room) -> Array:
    """Store a sample, or its estimate, when its turn has come."""

    def kept() -> Array:
        kept, start = samples, motions.slot(turn.place, room) * WIDTH
        for k, value in enumerate(flat(values)):
            kept = store(kept, start, value, k)
        return kept

    return cond(turn.is_due, kept, lambda: samples)


def _load(samples: Array, place: Scalar, room: motions.Room) -> Sample:
    start = motions.slot(place, room) * WIDTH
    found: Sample = record(Sample, [load(samples, start, k) for k in range(WIDTH)])
    return found


def _outputs_of(estimate: ekf.Estimates) -> Shown:
    """Outputs of an estimate."""
    return Shown(*(getattr(estimate, name.partition("_")[2]) for name in Shown._fields))


def arrays(state: State, par: Parameters) -> Arrays:
    """Those of the filter, for hosts that read arrays."""
    return ekf.arrays(state.filter, par.filter)
