"""First impacts that the contact did not show, told by the current.

A mover that hits a stop is suddenly slower, or moves back. So the slope of the current changes by the slope of the
reluctance times the flux linkage times the change of the speed. A contact that closes only after the bounce does not
show this impact.

The kink is looked for in every window of `TAPS` readings, by a fit of two lines that meet in the middle, where the
voltage has not jumped for a while. If a motion that lands has a kink of the right sign and size near its stop, it has
landed there.

Such a landing gives the coefficient of restitution. Where the spring drives the mover the kink is too small. There the
restitution says how long before the contact the first impact was.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np

from gapsense.estimators import ekf, readings
from gapsense.estimators.kalman import Gaussian
from gapsense.estimators.motions import Motion
from gapsense.estimators.reduced_model import (
    FLUX_LINKAGE,
    FORCE_ERROR,
    POSITION,
    POSITION_PREV,
    Model,
    acceleration,
    gap_law,
    is_moving,
    magnetic_force,
)
from gapsense.kernels.layout import Array, Count, Scalar, Vector, blank
from gapsense.kernels.linalg import deviation, total, vector
from gapsense.kernels.trace import clip, cond, fabs, loop, not_, sqrt, square, where

SIDE = 7  # samples on each side of a kink
TAPS = 2 * SIDE + 1
SETTLING = 20.0  # samples after a jump of the voltage in which eddy currents bend the current as an impact does
CLEAR = 4.0  # standard deviations of a kink that is none of noise
SURE = 10.0  # the same where the spring drives the mover, and of one that would have shown
HARD = 0.3  # least energy of the mover at an impact that the current tells, over what the spring takes along the stroke
LEAST = 0.5  # share of the kink of a mover that stops dead
SEEN = 0.7  # share that would be clear where none has been: then there was no bounce
ROUGH = 2.0, 0.3  # what the readings may be off the two lines: in deviations of the noise, in kinks
NEAR = 0.5  # largest distance from the stop, in strokes, of an estimate whose kink is an impact on it
UNSURE = 0.2  # least standard deviation of the position, in strokes: that of the filter may be too small
PULLED = 0.5  # least magnetic force on the stop, in those of the spring, with which the magnet drives the mover
BEYOND_PULLED = 2.0  # deviations by which the estimate may pass the stop before the contact closes
BEYOND_FREE = 0.8  # the same where the spring drives the mover, as long as the current has told nothing of bounces
BEYOND_STILL, BEYOND_BOUNCING = 1.2, 0.2  # the same after a landing where it has told that there was none, or one
BY_BOUNCE = 0.8  # weight of the time that bounces take, against that at which the estimate was on the stop
APART = 0.15  # most that the mover may move between these two times, in strokes
FARTHEST = 64  # the same in samples
MOST = 0.9  # largest restitution that is learnt
NEWEST = 0.5  # weight of the newest restitution

_TIMES = np.arange(SIDE, -SIDE - 1.0, -1.0)
_LINES = np.array([np.ones(TAPS), _TIMES, _TIMES.clip(0.0)]).T
KINK = np.linalg.pinv(_LINES)[2].tolist()  # weights of the readings, newest first
BASIS = np.linalg.qr(_LINES)[0].T.tolist()  # of all pairs of lines
SPREAD = float(np.linalg.norm(KINK))  # deviation of the kink in those of a reading


class Kink(NamedTuple):
    """What the current has told of the motion so far."""

    currents: Annotated[Array, Vector(TAPS)]  # last readings, newest first [A]
    steady: Annotated[Scalar, Count]  # samples without a loss or a jump of the voltage; a motion begins with some
    size: Scalar  # the clearest kink [A per sample]; 0: none
    flight: Annotated[Scalar, Count]  # samples of the motion before it
    arrival: Annotated[Scalar, Count]  # samples of the motion before the estimate reached the stop; 0: it did not
    beyond: Scalar  # how far the estimate would have passed the stop, in its standard deviations
    was_steady: Scalar  # 1: since it first would have, a kink could be seen


class Told(NamedTuple):
    """What the landings so far have told of the next one that the spring drives."""

    free: Scalar  # deviations by which the estimate may pass the stop in it
    restitution: Scalar  # speed after an impact over that before it; 0: not known


class Verdict(NamedTuple):
    """What a landing turns out to be."""

    is_missed: Scalar  # there was an impact before it
    is_told: Scalar  # the current has shown that
    is_doubtful: Scalar  # there may have been one
    told: Told


class Settling(NamedTuple):
    """A mover that comes to rest on its stop in ever smaller bounces, normalised."""

    speed: Scalar  # before the first impact [1/s]
    pull: Scalar  # acceleration onto the stop [1/s^2]
    drag: Scalar  # rate at which damping takes speed away [1/s]


def nothing() -> Kink:
    """No reading."""
    return blank(Kink, steady=SETTLING, was_steady=1.0)


def no_kink() -> Told:
    """Kink of which nothing is known."""
    return Told(free=BEYOND_FREE, restitution=0.0)


def seek(
    kink: Kink, motion: Motion, current: Scalar, before: ekf.State, now: ekf.State, m: Model, par: ekf.Parameters
) -> Kink:
    """Look for a kink with the reading of one more sample; `motion` is that before it."""
    most = readings.most_current(par.range_current, par.range_voltage, par.coil_resistance)
    is_read = readings.can_be_read(current, most) & (now.watch.far < 0.5)
    shifted = vector([where(is_read, current, kink.currents[0]), *kink.currents[:-1]])

    def flying() -> Kink:
        """The kink in the currents of a motion, as far as its samples tell."""
        z, z_prev, lam = (now.x[place] for place in (POSITION, POSITION_PREV, FLUX_LINKAGE))
        noise = _noise(now, par)
        jump = m.T_s * (now.voltage - before.voltage) * shifted[0]  # of the current's slope, times the flux linkage
        is_steady = is_read & (fabs(jump) <= SPREAD * noise * fabs(lam))
        steady = where(is_steady, kink.steady + 1.0, 0.0)
        can_see = (steady >= TAPS + SETTLING) & (motion.count >= TAPS)
        slope = total(w * i for w, i in zip(KINK, shifted))
        size = where(lam * (z - z_prev) < 0.0, slope, -slope)
        is_large = can_see & (size > kink.size) & (size >= CLEAR * SPREAD * noise)
        is_clear = cond(is_large, lambda: _is_two_lines(shifted, size, noise), lambda: False)
        passes = is_moving(now.mode) & (fabs(z - motion.stop) >= 1.0)
        std = deviation(now.P[POSITION, POSITION])
        step = fabs(z - z_prev) / where(std > UNSURE, std, UNSURE)
        return kink._replace(
            currents=shifted,
            steady=steady,
            size=where(is_clear, size, kink.size),
            flight=where(is_clear, motion.count + 1.0 - SIDE, kink.flight),
            arrival=where(passes & (kink.arrival == 0.0), motion.count, kink.arrival),
            beyond=kink.beyond + where(passes, step, 0.0),
            was_steady=where(passes & not_(can_see), 0.0, kink.was_steady),
        )

    return cond(is_moving(before.mode), flying, nothing)


def _is_two_lines(currents: Array, kink: Scalar, noise: Scalar) -> Scalar:
    """Whether the readings are near two lines; with a wild reading among them they are not."""
    off = [i - currents[SIDE] for i in currents]
    along = total(square(total(w * i for w, i in zip(line, off))) for line in BASIS)
    return total(square(i) for i in off) - along <= TAPS * square(ROUGH[0] * noise + ROUGH[1] * kink)


def credible(kink: Kink, at: Gaussian, end: ekf.State, stop: Scalar, m: Model, par: ekf.Parameters) -> Kink:
    """The kink before a landing, where the estimate was `at`; `end` is the state at the contact.

    An unsure one is none where the spring drives the mover. None is that of a mover with little energy: a voltage that
    brakes it bends the current as much.
    """
    speed, spring = (at.mean[POSITION] - at.mean[POSITION_PREV]) / m.T_s, fabs(m.k_sp * (m.z_sp - stop))
    is_soft = 0.5 * m.m * square(speed) < HARD * spring
    is_unsure = kink.size < SURE * SPREAD * _noise(end, par)
    is_none = is_soft | (is_unsure & _is_sprung(end.x[FLUX_LINKAGE], stop, m))
    return kink._replace(size=where(is_none, 0.0, kink.size))


def _dead_stop(at: Gaussian, stop: Scalar, m: Model) -> Scalar:
    """Kink of a mover that stops dead [A per sample]."""
    return fabs(gap_law(stop, m)[1] * at.mean[FLUX_LINKAGE] * (at.mean[POSITION] - at.mean[POSITION_PREV]))


def _noise(now: ekf.State, par: ekf.Parameters) -> Scalar:
    """Deviation of the readings [A], larger where the filter is surprised."""
    return par.noise_current * sqrt(where(now.watch.surprise > 1.0, now.watch.surprise, 1.0))


def _is_sprung(lam: Scalar, stop: Scalar, m: Model) -> Scalar:
    """Whether the spring drives a mover onto the stop."""
    return fabs(magnetic_force(gap_law(stop, m)[1], lam)) < PULLED * fabs(m.k_sp * (m.z_sp - stop))


def suppose_impact(kink: Kink, count: Scalar) -> Scalar:
    """Samples of a motion of `count` before an impact that the contact has missed, if there was one."""
    return where(kink.size > 0.0, kink.flight, where(kink.arrival > 0.0, kink.arrival, count - 1.0))


def settling(before: Gaussian, speed: Scalar, end: Gaussian, stop: Scalar, m: Model) -> Settling:
    """From the estimates before the first impact and at the end, with the mean of the magnetic forces there."""
    lam = sqrt(0.5 * (square(before.mean[FLUX_LINKAGE]) + square(end.mean[FLUX_LINKAGE])))
    force = magnetic_force(gap_law(stop, m)[1], lam) + before.mean[FORCE_ERROR]
    return Settling(speed=speed, pull=fabs(acceleration(stop, 0.0, force, m)), drag=m.c_f / m.m)


def duration(settled: Settling, e: Scalar) -> Scalar:
    """Time of all bounces [s], 2 v (e + e^2 + ...) / a, with a restitution e; damping adds to a in the first flight."""
    pull = settled.pull + 0.5 * settled.drag * settled.speed * e
    return 2.0 * settled.speed * e / ((1.0 - e) * pull)


def restitution(settled: Settling, time: Scalar) -> Scalar:
    """Coefficient of restitution of a mover whose bounces have taken a time [s]: the inverse of `duration`."""
    e = _restitution(settled, settled.pull, time)
    return _restitution(settled, settled.pull + 0.5 * settled.drag * settled.speed * e, time)


def _restitution(settled: Settling, pull: Scalar, time: Scalar) -> Scalar:
    return time * pull / (2.0 * settled.speed + time * pull)


def learnt(told: Told, before: Gaussian, speed: Scalar, time: Scalar, end: Gaussian, stop: Scalar, m: Model) -> Told:
    """With the bounces of a landing that the current has told: the speed before them [m/s], and their time [s]."""
    e = clip(restitution(settling(before, speed / m.l_z, end, stop, m), time), 0.0, MOST)
    return told._replace(
        restitution=where(told.restitution > 0.0, told.restitution + NEWEST * (e - told.restitution), e)
    )


def hidden_impact(
    count: Scalar, first: Scalar, before: Gaussian, end: Gaussian, stop: Scalar, told: Told, m: Model
) -> Scalar:
    """Samples of a motion of `count` before an impact that the current does not show.

    The estimate was on the stop after `first` samples.  A mover that bounces as it did where the current has told it
    needs a time until its contact closes.  If that says something else altogether, this stop is another one.
    """
    settled = settling(before, fabs(before.mean[POSITION] - before.mean[POSITION_PREV]) / m.T_s, end, stop, m)
    later = count - duration(settled, told.restitution) / m.T_s - first
    is_alike = (told.restitution > 0.0) & (fabs(later) * settled.speed * m.T_s <= APART)
    target = where(is_alike, clip(first + BY_BOUNCE * later, 1.0, count - 1.0), first)

    def nearer(at: Scalar) -> tuple[tuple[Scalar], Scalar]:
        step = where(target > at + 0.5, 1.0, where(target < at - 0.5, -1.0, 0.0))
        return (at + step,), step == 0.0

    (at,) = loop(FARTHEST, nearer, (first,))  # counted, since it is a place in memory
    return at


def judge_landing(kink: Kink, at: Gaussian, stop: Scalar, told: Told, m: Model, par: ekf.Parameters) -> Verdict:
    """Judge a landing on `stop`; `at` is the estimate at the supposed impact, `told` what earlier landings have told.

    Where the spring drives the mover the kink is too small, and the standard deviation of the position far larger than
    its error. There, if the estimate was on the stop well before the contact, so was the mover.  How well depends on
    whether the mover has bounced where the current tells it, at the other stop; if it has not, the landing is mostly
    only doubtful. Without e_i or e_F the estimate has a bias.
    """
    dead, clear = _dead_stop(at, stop, m), SURE * SPREAD * par.noise_current
    is_kinked = (kink.size > 0.0) & (kink.size >= LEAST * dead)
    is_told = is_kinked & (fabs(at.mean[POSITION] - stop) <= NEAR)
    is_free = (
        _is_sprung(at.mean[FLUX_LINKAGE], stop, m) & (par.option_current_error > 0.0) & (par.option_force_error > 0.0)
    )
    would_show = (kink.was_steady > 0.5) & (LEAST * dead >= clear)
    is_beyond = not_(would_show) & (kink.beyond >= where(is_free, told.free, BEYOND_PULLED))
    is_likely = (told.free <= BEYOND_BOUNCING) | (kink.beyond >= BEYOND_PULLED)
    is_guessed = (kink.size == 0.0) & is_beyond & is_free & is_likely
    is_still = (kink.was_steady > 0.5) & (SEEN * dead >= clear) & (kink.size == 0.0)
    return Verdict(
        is_missed=is_told | is_guessed,
        is_told=is_told,
        is_doubtful=not_(is_told) & (is_kinked | is_beyond),
        told=Told(
            free=where(is_told, BEYOND_BOUNCING, where(is_still, BEYOND_STILL, told.free)),
            restitution=where(is_still, 0.0, told.restitution),
        ),
    )
