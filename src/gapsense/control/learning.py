"""What a contact teaches: four mechanical numbers of an operation, from when the mover took off and landed.

The motion is computed without stops along the flux linkage that was measured, from rest at the take-off to the
landing.  There it should be at the stop.  (The impact speed and the time of the landing themselves have a cusp where
the landing is soft; this position has none.)
"""

from __future__ import annotations

from collections.abc import Sequence

from gapsense.control import laws
from gapsense.control.bend import SURE, speed_at
from gapsense.control.mover import NUMBERS, Motion, Mover, depth, make_mover, move, squared_flux, squares, start_at_rest
from gapsense.control.profile import stops
from gapsense.control.records import LONGEST, Law, Parameters, Pass, State
from gapsense.estimators.kalman import Gaussian, condition
from gapsense.kernels.elementary import log
from gapsense.kernels.layout import Array, Scalar, flat, record
from gapsense.kernels.linalg import diagonal, identity, matrix, vector
from gapsense.kernels.trace import clip, cond, fabs, load, not_, square, where, where_each

# part of a change that is expected again (of a half bridge, whose flux decays by itself), and kept; cycles until there
# is one
TREND, OF_HALF, KEEP, CLEAR = 0.1, 0.07, 0.95, 3.0
AT_ONCE = 2  # samples of a pass that are taken in a step
BALANCE, PART = 0.03, 0.6  # errors of ln(lambda^2) at the take-off: the model's, and of the change in its sample
# share by which slopes follow those of a soft landing, after the first cycles: slopes and landing share the noise of
# their cycle, and their product would move what no landing tells
EAGER, YOUNG, STEADY = 0.5, 10.0, 0.05
PLACE, NOISIER = 80e-6, 1.5  # error of the position at the landing [m]; times that with a noisy current
INSTANT = 0.5  # error of the time of the landing, in samples
UNKNOWN = 1e6  # variance of what was not measured
FLAT = 1e-9  # slope of the position at the landing by the balance [m]
SPEED = 0.2  # error of an impact speed that somebody has measured [m/s]
LEAST_FLUX = 1e-4  # flux linkage [Wb]
FARTHEST, LARGEST = 0.3, 0.8  # change at once, and value, of a, b, q
DRIFT = (0.005, 0.005, 0.005, 0.01)  # of a, b, q, r from operation to operation
# over that with a noisy current; openings with more of q, r would come to float, and then to be hard, in the plane that
# no landing in time tells
WILDER = ((4.0, 4.0, 1.0, 1.0), (4.0, 4.0, 4.0, 4.0))
# a, b, q, r of openings less those of closings: spring, mover and magnet are the same, only the core's past differs;
# how far from that they may be after a landing in time, and the error of what is beyond
APART, WITHIN, ALIKE = (0.03, -0.01, 0.035, 0.065), (0.07, 0.05, 0.09, 0.11), 0.15
STUCK = 0.05  # change of a where the mover did not leave its stop


def work(state: State, par: Parameters) -> State:
    """Do a piece of the pass; the last one gives its result."""
    is_due = state.course.last >= state.course.at
    return cond(is_due, lambda: _gone(state, par), lambda: state)


def _gone(state: State, par: Parameters) -> State:
    course, m = state.course, with_law(make_mover(par), laws.read(state.laws, state.course.half).mean)
    for _ in range(AT_ONCE):
        course = _next(course, state, m, par)
    state = state._replace(course=course)
    return cond(course.at > course.last, lambda: _conclude_pass(state, m, par), lambda: state)


def with_law(m: Mover, mean: Array) -> Mover:
    """A mover with a, b, q, r."""
    return m._replace(**dict(zip(("balance", "slope", "lightness", "drag"), mean)))


def flux_at(state: State, at: Scalar) -> Scalar:
    """Flux linkage of a sample of the pass, by the resistance that is known now [Wb]."""
    place = state.course.half * LONGEST + at
    return load(state.fluxes, place) - state.course.correction * load(state.charges, place)


def _next(course: Pass, state: State, m: Mover, par: Parameters) -> Pass:
    """The next sample, if there is one."""
    at = where(course.at <= course.last, course.at, course.last)
    squared = squares(flux_at(state, at - 1.0), flux_at(state, at))
    new = move(record(Motion, course.motion), squared, par.sample_time, m)
    is_new = course.at <= course.last
    motion = where_each(is_new, vector(flat(new)), course.motion)
    return course._replace(motion=motion, at=where(is_new, at + 1.0, course.at))


def begin_pass(state: State, half: Scalar, correction: Scalar, impact: Scalar, par: Parameters) -> State:
    """Begin a pass over the ended operation; none if the mover did not leave its stop while samples were kept."""
    contact, law = state.heard, laws.read(state.laws, half)
    # if something has changed in a cycle, only its ordinary operations tell what
    is_believed = (state.noted.changed < 1.0) | (state.running.is_plain > 0.0)
    has_left = is_believed & (contact.began > 0.0) & (contact.takeoff > 0.0) & (contact.takeoff < LONGEST)
    has_landed = has_left & (contact.landing > contact.takeoff) & (contact.landing < LONGEST)
    z0, _ = stops(half > 0.0, make_mover(par))
    last = where(has_landed, contact.landing, contact.takeoff)
    first = where(has_left, contact.takeoff, 0.0)
    span = (first, first, where(has_left, last, -1.0), where(has_landed, 1.0, 0.0))
    course = Pass(half, *span, correction, impact, vector(flat(start_at_rest(z0))))
    is_stuck = (contact.began > 0.0) & (contact.takeoff < 1.0) & (law.was_followed > 0.0)
    a = law.mean[0] + where(is_stuck, where(half > 0.0, STUCK, -STUCK), 0.0)
    law = law._replace(mean=vector([clip(a, -LARGEST, LARGEST), *law.mean[1:]]))
    return state._replace(course=course, laws=laws.write(state.laws, half, law))


def _conclude_pass(state: State, m: Mover, par: Parameters) -> State:
    """Update a, b, q, r by one step of a Kalman filter: take-off, landing, impact speed."""
    course, law = state.course, laws.read(state.laws, state.course.half)
    (z0, z1), (z, v, *slopes) = stops(course.half > 0.0, m), course.motion
    before, after = flux_at(state, course.left - 1.0), flux_at(state, course.left)
    mean, step = 0.5 * (before + after), fabs(after - before)
    mean = where(mean > LEAST_FLUX, mean, LEAST_FLUX)
    believed = squared_flux(z0, 0.0, 0.0, with_law(m, vector([0.0] * NUMBERS)))
    x0 = depth(z0, m)
    late = (course.last - course.left) * par.sample_time / law.travel
    late = where(late > 1.0, late, 1.0)
    has_landed, is_measured = course.landed > 0.0, course.impact > 0.0
    bent, doubt = speed_at(state, course.half, course.last, state.running.piece, par)
    heard = where(course.half > 0.0, -1.0, 1.0) * where(is_measured, course.impact, bent)
    doubt = where(is_measured, square(SPEED * late * late), square(SURE) + square(doubt))
    # a motion that is late at its stop is slower
    growth = slopes[NUMBERS] / where(fabs(slopes[0]) > FLAT, slopes[0], FLAT)
    balance = log(square(mean) / believed) - (law.mean[0] + law.mean[1] * x0)
    innovation = vector([balance, z1 - z, heard - v - growth * (z1 - z)])
    is_noisy = state.running.averaged > 0.0
    place = where(is_noisy, NOISIER * PLACE, PLACE)
    noise = vector(
        [
            square(BALANCE) + square(PART * step / mean),
            where(has_landed, square(place * late * late * late) + square(INSTANT * par.sample_time * v), UNKNOWN),
            where(has_landed & (is_measured | (law.was_plain < 1.0)), doubt, UNKNOWN),
        ]
    )
    by_law = _steady(law, slopes[:NUMBERS], where(state.since_plain < YOUNG, where(is_noisy, 1.0, EAGER), STEADY))
    is_soft = has_landed & (law.was_plain < 1.0) & (state.running.is_plain < 1.0)
    law = law._replace(slopes=where_each(is_soft, vector(by_law), law.slopes))
    by_speed = [change - growth * shift for change, shift in zip(slopes[NUMBERS:], slopes[:NUMBERS])]
    H = matrix([[1.0, x0, 0.0, 0.0], by_law, by_speed])
    is_steady = is_soft & not_(is_noisy) & (state.since_plain > CLEAR)
    wilder = [where(is_noisy, where(course.half > 0.0, closing, opening), 1.0) for opening, closing in zip(*WILDER)]
    again = where(is_steady, where(par.voltage_least < 0.0, TREND, OF_HALF), 0.0)
    within = where(is_noisy, UNKNOWN, 1.0 / (late * late * late))
    learnt = _learnt(law, _expected(state, course.half), (innovation, H, noise), within, again, vector(wilder))
    return state._replace(laws=laws.write(state.laws, course.half, learnt))


def _steady(law: Law, slopes: Sequence[Scalar], share: Scalar) -> Array:
    """The mean of late of a soft landing's slopes, if there is one; an ordinary landing has others."""
    is_first = (law.was_plain > 0.0) | (law.slopes[0] == 0.0)
    return vector([old + where(is_first, 1.0, share) * (new - old) for new, old in zip(slopes, law.slopes)])


def _expected(state: State, half: Scalar) -> Gaussian:
    """Numbers of an operation, by those of the other kind."""
    other, sign = laws.read(state.laws, 1.0 - half), where(half > 0.0, -1.0, 1.0)
    return Gaussian(vector([there + sign * apart for there, apart in zip(other.mean, APART)]), other.cov)


def draw_near(own: Gaussian, other: Gaussian, within: Scalar) -> Gaussian:
    """Draw numbers towards those of the other kind of operation, where they are too far from them.

    What no landing in time tells could go anywhere else, and a stop that is hit, and left again at once, unheard, tells
    wrong numbers for ever.  After a late landing, which tells little, they are drawn from nearer by.
    """
    off = [there - here for there, here in zip(other.mean, own.mean)]
    beyond = [x - clip(x, -within * most, within * most) for x, most in zip(off, WITHIN)]
    noise = [where(x == 0.0, UNKNOWN, square(ALIKE) + other.cov[k, k]) for k, x in enumerate(beyond)]
    return condition(own, vector(beyond), identity(NUMBERS), vector(noise))


def _learnt(
    law: Law, other: Gaussian, told: tuple[Array, Array, Array], within: Scalar, again: Scalar, wilder: Array
) -> Law:
    """No number changes by much at once; a part of a change is expected again."""
    q, P = draw_near(condition(Gaussian(law.mean, law.cov), *told), other, within)
    change = [clip(new - old, -FARTHEST, FARTHEST) for new, old in zip(q, law.mean)]
    trend = vector([where(again > 0.0, KEEP * old + again * more, 0.0) for old, more in zip(law.trend, change)])
    mean = vector([clip(old + more + ramp, -LARGEST, LARGEST) for old, more, ramp in zip(law.mean, change, trend)])
    wander = diagonal([square(w * drift) for w, drift in zip(wilder, DRIFT)])
    return law._replace(mean=mean, trend=trend, cov=P + wander)
