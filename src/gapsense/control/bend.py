"""How hard a stop is hit, by the current: its slope bends there, whether or not a contact tells the landing.

Current over flux linkage is the reluctance of core and gap.  It changes with the velocity of the mover, and not any
more once that is on its stop.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from gapsense.control import laws
from gapsense.control.coil import AVERAGED, is_quiet, open_flux, usual_current, wandering
from gapsense.control.mover import balance, gap_slopes, make_mover
from gapsense.control.profile import Operation, arrival, path, stops
from gapsense.control.records import CLOSING, LONGEST, PIECES, Heard, Parameters, Running, State
from gapsense.control.tracking import place, running_plan
from gapsense.estimators.mhe.model import gap
from gapsense.kernels.layout import Scalar
from gapsense.kernels.trace import clip, cond, floor, load, not_, sqrt, square, where, where_each

PIECE = 200e-6  # half of the time before, and after, in which slopes are taken [s]
LONGER = ((1.0, 1.2), (2.0, 1.5), (3.0, 1.8), (4.0, 2.3))  # over the noise that is averaged at least: times that
SURE = 0.5  # error of a speed besides the current's noise [m/s]
VAGUE = 4.0  # standard deviations of a speed that noise may explain
OFTEN, MOST = 0.12, 5.4  # speed, and standard deviations, of bends without a hit where pieces are longer [m/s]
USUAL = 0.06  # error by noise that the bounds of a hard landing allow for [m/s]
NEAR = (0.65, 0.97)  # of the travel of a closing, of an opening: a stop is not hit before, unless a contact says so
LEAST_FLUX, TELLING = 1e-4, 2e-3  # flux linkage; that whose current tells the gap [Wb]
LARGE = 0.5  # of the flux linkage that balances the spring at first: with less the bend is that of the voltage
SEATED, LATER = 0.5e-3, 1e-3  # time after the planned arrival at which it is told, and so much later again [s]
CLOSED, OPENED = 0.75, 0.85  # of the reluctance of the open actuator: less is no open one, and more no closed one
# of the reluctance of a seated mover: beyond this, and so many standard deviations of noise, a closing has not arrived
APART, DOUBTFUL = 0.12, 6.0
AFLOAT, LEAVING = 0.79, 0.75  # of the reluctance at this share of a closing's lead: with less an opening floats
# of that of a seated mover: beyond this and so many standard deviations of noise, at most the second, a closing is not
# felt to have arrived
BESIDE, FARTHEST_BESIDE = 0.022, 0.08
SATURATED = 0.2  # speed at a landing that its core explains: from then on it is taken away [m/s]
RISEN = 0.5e-3  # flux linkage by which the reluctance of a core is told [Wb]
AT_STOP, AWAY = 20e-6, 45e-6  # from its stop, by the reluctance: a mover that is nearer has hit it; farther has not [m]
SLOW = 0.5  # of the first approach: by slower ones a core is told from a hit
# time after that at which a mover that floats is told; by so much, and standard deviations of noise, it gets faster
FLOATING, FASTER, DEVIATIONS = 0.25e-3, 0.05, 3.0  # [s], [m/s]
FAR = 0.03  # of the flux linkage: largest error of it that is allowed for
OTHER = 0.02  # of the resistance: largest error of an estimator's that is taken away
FOLLOW = (0.1, 0.2)  # share by which that of closings follows a mover that seems farther away; share of openings
# halves of the times of two reluctances, and time from the plan's end to the second one [s]; error of a flux linkage by
# noise from which they are compared; shares by which what is usual follows a lower one, and a higher one
WIDE, NARROW, HOLDING = 0.6e-3, 0.4e-3, 0.95e-3
UNSURE, FOLLOW_RESTED = 0.01, (0.3, 0.1)
# of the reluctance, and of the flux linkage, with which it is held: with more of that and less of this it came later
CAME, WITH = 0.9, 0.93
HELD = 0.5  # of the flux linkage that balances the spring at the lower stop: with less no mover stays there
UNKNOWN = 1e3  # error of what was not measured
AROUND, SHORTER = 3.0, 0.6  # pieces in which the bend at a contact is looked for, two of them before it; their length
PROMPT, LATE = 5e-6, 60e-6  # by which a contact comes after the bend; it is late from so much more on [s]
CLEAR = 2.0  # sum of the squares of a bend that can be located [m^2/s^2]
AGAIN = 0.3  # share of each ordinary closing but the first


class Bounds(NamedTuple):
    """Which bends of the current are hits."""

    hit: Scalar  # speed beyond which a stop that no contact tells is hit, and which noise does not explain [m/s]
    faint: Scalar  # the same of a closing whose reluctance shows besides that the mover was at its stop [m/s]
    latest: Scalar  # time after the planned arrival in which it is still heard [s]
    core: Scalar  # share of a bend that makes it the core's
    beyond: Scalar  # speed of a bend that is a hit for all that [m/s]


class Core(NamedTuple):
    """What a core has to do with a bend."""

    speed: Scalar  # that it explains [m/s]
    farther: Scalar  # from the stop than when seated, by the reluctance [m]
    away: Scalar  # the same without what the core adds to it [m]
    is_known: Scalar  # 1: the core's part is


WITH_CONTACT = Bounds(hit=0.4, faint=0.25, latest=0.0, core=0.4, beyond=0.75)
ALONE = Bounds(hit=0.55, faint=0.55, latest=1e-3, core=0.6, beyond=0.9)


def choose_bounds(state: State) -> Bounds:
    """Choose the bounds of a hit: they are higher without a contact."""
    return where_each(state.by_model > 0.0, ALONE, WITH_CONTACT)


def find_hardest_bend(state: State, par: Parameters) -> Heard:
    """Note the hardest bend of the current before the landing: a stop left at once shows no contact."""
    heard, running = state.heard, state.running
    at = running.age - 2.0 * running.piece
    has_left = (heard.takeoff > 0.0) & (at - 2.0 * running.piece > heard.takeoff)
    is_on = (running.is_plain < 1.0) & (has_left | (state.by_model > 0.0)) & (running.age < LONGEST)

    def before() -> tuple[Scalar, Scalar]:
        return heard.hardest, heard.hit

    def looked() -> tuple[Scalar, Scalar]:
        speed, noise = _impact(state, at, par)
        is_harder = (speed > heard.hardest) & (speed > _softest_hit(state, noise, _faintest(state, par)))
        return where(is_harder, speed, heard.hardest), where(is_harder, at, heard.hit)

    def near() -> tuple[Scalar, Scalar]:
        plan = running_plan(running, par)
        is_near = at * par.sample_time > plan.lead + where(running.command > 0.5, *NEAR) * plan.travel
        is_near = is_near & (running.age * par.sample_time <= plan.lead + arrival(plan) + choose_bounds(state).latest)
        here = running.command * LONGEST + where(at > 0.0, at, 0.0)
        is_near = is_near & (load(state.fluxes, here) > LARGE * running.balance_flux)
        return cond(is_near, looked, before)

    hardest, hit = cond(is_on & (heard.landing < 1.0), near, before)
    return heard._replace(hardest=hardest, hit=hit)


def locate_bend(state: State, par: Parameters) -> State:
    """Locate the bend around the contact of an ordinary closing: it tells when the mover has stopped."""
    heard, running = state.heard, state.running
    since = running.age - heard.landing - heard.taken  # the contact
    is_on = (running.command * running.is_plain > 0.0) & (heard.landing > 0.0) & (since <= AROUND * running.piece)

    def looked() -> tuple[Scalar, ...]:
        at = 2.0 * running.piece
        speed, _ = speed_at(state, CLOSING, running.age - at, floor(SHORTER * running.piece + 0.5), par)
        weight = where(speed > 0.0, square(speed), 0.0)
        bent, moment = heard.bent + weight, heard.moment + weight * (at - since)
        is_told = since >= AROUND * running.piece
        return bent, moment, *cond(is_told, lambda: _mean_delay(state, bent, moment, par), lambda: before)

    before = state.contact_late, state.late
    bent, moment, mean, late = cond(is_on, looked, lambda: (heard.bent, heard.moment, *before))
    return state._replace(heard=heard._replace(bent=bent, moment=moment), contact_late=mean, late=late)


def _mean_delay(state: State, bent: Scalar, moment: Scalar, par: Parameters) -> tuple[Scalar, Scalar]:
    """How late the contact is in the mean [s], and in samples, if by more than a prompt one may seem to be."""
    piece = state.running.piece
    found = moment / where(bent > CLEAR, bent, CLEAR)
    is_told = is_quiet(state.coil, par) & (bent > CLEAR) & (square(found) < square(piece))
    share = where(state.contact_late == 0.0, 1.0, AGAIN)
    mean = state.contact_late + where(is_told, share * (found * par.sample_time - state.contact_late), 0.0)
    samples = clip(floor((mean - PROMPT) / par.sample_time + 0.5), 0.0, piece)
    return mean, where(mean > PROMPT + LATE, samples, 0.0)


def moved_earlier(sample: Scalar, samples: Scalar) -> Scalar:
    """What the contact tells at a sample happened so much earlier; 0 is nothing."""
    return where(sample > samples + 1.0, sample - samples, where(sample > 0.0, 1.0, 0.0))


def _faintest(state: State, par: Parameters) -> Scalar:
    """Speed beyond which a bend may be a hit: a lower one in slow closings [m/s]."""
    running, bounds = state.running, choose_bounds(state)
    is_slow = (running.command > 0.5) & (running.speed < SLOW * par.approach_first)
    return where(is_slow, bounds.faint, bounds.hit)


def is_faint(state: State, par: Parameters) -> Scalar:
    """Whether the bend that is taken for a hit is only one by its reluctance."""
    running = state.running
    _, noise = speed_at(state, running.command, state.heard.hit, running.piece, par)
    return state.heard.hardest <= _softest_hit(state, noise, choose_bounds(state).hit)


def _softest_hit(state: State, noise: Scalar, bound: Scalar) -> Scalar:
    """Speed beyond which a stop that no contact tells is hit, by one without noise."""
    explained = OFTEN + MOST * noise
    longer = where(explained > bound, explained, bound)
    return where(state.running.averaged > 0.0, longer, bound + VAGUE * noise)


def landing_speed(state: State, par: Parameters) -> Scalar:
    """Impact speed of the operation that has just ended, less what unusual noise may have added [m/s]."""
    at = state.heard.landing
    speed, noise = _impact(state, at, par)
    core = _core_at(state, at, at, par).speed
    is_first = state.running.speed >= par.approach_first  # else it would fall back to another first one for ever
    speed = where(is_first & (core > SATURATED), speed - core, speed)
    usual = where(state.running.averaged > 0.0, 0.0, USUAL)  # then the contact's time tells besides
    return speed - where(noise > usual, VAGUE * (noise - usual), 0.0)


def _impact(state: State, at: Scalar, par: Parameters) -> tuple[Scalar, Scalar]:
    """Speed of the operation under way that its stop took at a sample, and its error by noise [m/s]."""
    speed, noise = speed_at(state, state.running.command, at, state.running.piece, par)
    return speed - _planned_braking(state.running, at, par), noise


def _planned_braking(running: Running, at: Scalar, par: Parameters) -> Scalar:
    """Speed that the plan itself takes away between the pieces around a sample [m/s]."""
    plan, m, n = running_plan(running, par), make_mover(par), running.piece
    before, after = (path((at + k) * par.sample_time - plan.lead, plan, m).velocity for k in (-1.0 - n, n))
    return where(plan.is_closing, after - before, before - after)


def is_of_core(state: State, par: Parameters) -> Scalar:
    """Whether the bend before the landing of a closing is that of a core that saturates, and no hit."""
    heard, running = state.heard, state.running
    is_alone = state.by_model > 0.0
    landing = where(is_alone, running.due, heard.landing)
    is_kept = (heard.hit > 0.0) & (landing > heard.hit + 2.0 * running.piece)
    is_slow = is_alone | (running.speed < SLOW * par.approach_first)
    core, bounds = _core_at(state, heard.hit, where(is_kept, landing, LONGEST), par), choose_bounds(state)
    is_lighter = (core.farther < 0.0) & (core.speed > bounds.core * heard.hardest)
    is_apart = core.is_known & (core.away > AWAY)
    is_core = where(is_alone, is_lighter, is_apart) & (heard.hardest < bounds.beyond)
    return is_slow & (is_core | (not_(is_alone) & is_faint(state, par) & not_(core.is_known & (core.away < AT_STOP))))


def _core_at(state: State, at: Scalar, landing: Scalar, par: Parameters) -> Core:
    """What the core has to do with the bend of a closing's current at a sample.

    How much the reluctance of the core grows with the flux linkage is told with the mover seated: after its landing by
    the contact, or after it is to have arrived.
    """
    running, m = state.running, make_mover(par)
    n, late = running.piece, told_at(running, par)
    is_kept = (running.command > 0.5) & (landing < late) & (at > 2.0 * n) & (at + n <= late)
    is_kept = is_kept & (late + n <= running.age) & (late + n < LONGEST)
    hit, landing, later = (LONGEST + where(is_kept, k, 2.0 * n + 1.0) for k in (at, landing, late))
    more = load(state.fluxes, later) - load(state.fluxes, landing)
    before, at_hit, after = (load(state.fluxes, hit + k * 2.0 * n) for k in (-1.0, 0.0, 1.0))
    bend = (after - 2.0 * at_hit + before) / (2.0 * n * par.sample_time)
    slope, _ = gap_slopes(m.gap.smallest, m)
    seated = _reluctance(state, landing, n, par)
    growth = (_reluctance(state, later, n, par) - seated) / where(more > RISEN, more, 1.0)
    is_known, farther = is_kept & (more > RISEN), (_reluctance(state, hit, n, par) - seated) / slope
    away = farther - growth * (load(state.fluxes, hit) - load(state.fluxes, landing)) / slope
    return Core(where(is_known, growth * bend / slope, 0.0), farther, away, is_known)


def has_floated(state: State, par: Parameters) -> Scalar:
    """Whether the mover got faster after its planned arrival: it was let go off its stop, and landed later."""
    running = state.running
    at = running.due + floor(FLOATING / par.sample_time + 0.5)
    speed, noise = speed_at(state, running.command, at, 2.0 * running.piece, par)
    return -speed > FASTER + DEVIATIONS * noise


def tell_arrival(state: State, seated: Scalar, par: Parameters) -> tuple[Scalar, Scalar, Scalar]:
    """Tell whether a closing was at its stop when due, whether the mover was elsewhere, and the new `seated`.

    The reluctance is current over flux linkage, of that of the open actuator. `seated` is that of the last closings
    that have arrived. For openings it is that with which closings have left the open stop: openings that float each
    time would otherwise be compared with each other.
    """
    running, n, m = state.running, state.running.piece, make_mover(par)
    opened = gap(m.gap.largest, m.gap, m.factor, m.bend)[0] + par.core_reluctance / square(par.coil_turns)
    is_closing, again = running.command > 0.5, told_at(running, par)

    def reluctance(due: Scalar, n: Scalar, drawn: Callable[[Scalar], Scalar]) -> tuple[Scalar, Scalar]:
        is_kept = (due > n) & (due + n <= running.age) & (due + n < LONGEST)
        at = running.command * LONGEST + where(is_kept, due, n)
        return _reluctance(state, at, n, par, drawn(at)) / opened, is_kept & (load(state.fluxes, at) > TELLING)

    early, is_early = reluctance(running.due, n, lambda _: 0.0)
    wide = where(is_closing, n, again - running.due)
    found, is_told = reluctance(again, wide, lambda at: _estimated_share(state, is_closing, at, par))
    left = _reluctance(state, LONGEST + floor(LEAVING * par.closing_lead / par.sample_time), n, par) / opened
    error = wandering(state.coil, par) / _large(load(state.fluxes, LONGEST + where(is_told, running.due, 0.0)))
    apart = APART + DOUBTFUL * where(error < FAR, error, FAR)
    is_better = (seated <= 0.0) | (is_closing & (found < seated))
    follows = where(is_better, 1.0, where(is_closing, *FOLLOW)) * (where(is_closing, found, left) - seated)
    is_afloat = (found < AFLOAT * (seated + follows)) & (running.averaged < 1.0)  # else the current is that of others
    is_elsewhere = where(is_closing, found > (1.0 + apart) * seated, is_afloat)
    is_absent = where(is_closing & (seated <= 0.0), is_early & (early > OPENED), is_told & is_elsewhere)
    last = load(state.fluxes, place(running, running.age - 1.0))
    is_absent = is_absent | (is_closing & (square(last) < square(HELD) * balance(m.gap.smallest, m)))
    beside = BESIDE + (apart - APART)
    beside = where(beside < FARTHEST_BESIDE, beside, FARTHEST_BESIDE)
    is_beside = (seated <= 0.0) | (is_told & (found < (1.0 + beside) * seated))
    is_there = is_closing & is_early & (early < CLOSED) & is_beside & not_(is_absent)
    return is_there, is_absent, seated + where(is_told & not_(is_absent & is_closing), follows, 0.0)


def tell_afloat(state: State, rested: Scalar, par: Parameters) -> tuple[Scalar, Scalar, Scalar]:
    """Tell how much more reluctance than the last ones a closing had with noise, as a share, and the new `rested`.

    That is the reluctance after the planned arrival, over the root of the one with which the mover is held then: an
    error of the flux linkage is in both, so noise moves their ratio less. Last, whether the mover came in between: held
    with more flux linkage a seated one has more reluctance, if its core saturates, and not the same or less.
    """
    running, T_s = state.running, par.sample_time
    n, m = (floor(time / T_s + 0.5) for time in (WIDE, NARROW))
    held, last = running.held, running.age - 1.0 - m
    held = where(held < last, held, last)
    told, latest = told_at(running, par), held - m - n
    told = where(told < latest, told, latest)
    is_kept = (running.command > 0.5) & (held + m < LONGEST) & (told >= running.due)
    at, late = (LONGEST + where(is_kept, k, n + m) for k in (told, held))
    is_noisy = wandering(state.coil, par) > UNSURE * _large(load(state.fluxes, at))
    first, later = _reluctance(state, at, n, par), _reluctance(state, late, m, par)
    found = first / sqrt(where(later > 0.0, later, 1.0))
    is_known, follows = rested > 0.0, where(found < rested, *FOLLOW_RESTED)
    more = where(is_kept & is_noisy & is_known, found / where(is_known, rested, 1.0) - 1.0, 0.0)
    came = is_kept & (first > CAME * later) & (load(state.fluxes, at) < WITH * load(state.fluxes, late))
    rested = rested + where(is_kept & is_noisy & not_(came), where(is_known, follows, 1.0) * (found - rested), 0.0)
    return more, rested, came


def _estimated_share(state: State, is_closing: Scalar, at: Scalar, par: Parameters) -> Scalar:
    """Part of the stored flux linkage that comes from an estimator: one that takes a mover for landed pulls it there.

    The loop's own integral begins where a closing does, and ends where an opening does: with the mover open.
    """
    coil = state.coil
    off = clip(coil.resistance - coil.balanced, -OTHER * coil.balanced, OTHER * coil.balanced)
    end = coil.drawn - off * coil.charge - (coil.flux - open_flux(coil, par))
    drawn = state.running.drawn_till_told - off * load(state.charges, at) - where(is_closing, 0.0, end)
    return where(state.by_model > 0.0, drawn, 0.0)


def told_at(running: Running, par: Parameters) -> Scalar:
    """Sample after the planned arrival at which that is told again; of an opening the middle of that time."""
    return running.due + floor(where(running.command > 0.5, 1.0, 0.5) * LATER / par.sample_time + 0.5)


def _reluctance(state: State, at: Scalar, n: Scalar, par: Parameters, off: Scalar = 0.0) -> Scalar:
    """Current over flux linkage around a place in memory, from which something is taken away [1/H]."""
    charge = load(state.charges, at + n) - load(state.charges, at - n)
    return charge / (2.0 * n * par.sample_time * _large(load(state.fluxes, at) - off))


def due(plan: Operation, par: Parameters) -> Scalar:
    """Sample at which the mover is to have arrived."""
    return floor((plan.lead + arrival(plan) + SEATED) / par.sample_time)


def held(plan: Operation, par: Parameters) -> Scalar:
    """Sample at which the voltage has held the mover for a while."""
    return floor((plan.lead + plan.travel + plan.tail + HOLDING) / par.sample_time)


def piece(noise: Scalar, par: Parameters) -> Scalar:
    """Samples of a piece: more where the noise of a current is so large that it is averaged."""
    half = floor(PIECE / par.sample_time + 0.5)
    for least, times in LONGER:
        is_so = noise > least * AVERAGED * usual_current(par)
        half = where(is_so, floor(times * PIECE / par.sample_time + 0.5), half)
    return clip(half, 1.0, float(PIECES))


def speed_at(state: State, half: Scalar, landing: Scalar, n: Scalar, par: Parameters) -> tuple[Scalar, Scalar]:
    """Speed towards the stop with which the mover has landed at a sample, and its error by noise, by such pieces."""
    m, T_s = make_mover(par), par.sample_time
    length = where(state.running.command == half, state.running.age, laws.read(state.laws, half).length)
    reach = 2.0 * n + 1.0
    is_kept = (landing > reach) & (landing + reach <= length + 1.0) & (landing + reach <= LONGEST)
    at = half * LONGEST + where(is_kept, landing, reach)
    slope, _ = gap_slopes(stops(half > 0.0, m)[1], m)
    rises = [_rise(state, middle, n, T_s) for middle in (at - 1.0 - n, at + n)]
    flux, before, after = load(state.fluxes, at), *rises
    is_kept = is_kept & (flux > LEAST_FLUX)
    bend = where(half > 0.0, -1.0, 1.0) * (before - after)
    noise = 2.0 * state.coil.noise / _large(flux) / (n * T_s * sqrt(n) * slope)
    return where(is_kept, bend / slope, 0.0), where(is_kept, noise, UNKNOWN)


def _rise(state: State, middle: Scalar, half: Scalar, T_s: Scalar) -> Scalar:
    """Slope of current over flux linkage around a place in memory."""
    charges = [load(state.charges, middle + k * half) for k in (-1.0, 0.0, 1.0)]
    aside = floor(0.5 * half + 0.5)
    fluxes = [load(state.fluxes, middle + k * aside) for k in (-1.0, 1.0)]
    first, second = ((new - old) / _large(flux) for old, new, flux in zip(charges, charges[1:], fluxes))
    return (second - first) / square(half * T_s)


def _large(flux: Scalar) -> Scalar:
    return where(flux > LEAST_FLUX, flux, LEAST_FLUX)
