"""Within an operation: the voltage with which the flux linkage follows the profile, and what is kept of a sample."""

from __future__ import annotations

from gapsense.control import correction
from gapsense.control.coil import driving, follow, usual_current
from gapsense.control.mover import Mover, make_mover, move, start_at_rest
from gapsense.control.profile import LEAST, Deviation, Operation, flux, is_planned, path, stops
from gapsense.control.records import LONGEST, Parameters, Running, State
from gapsense.kernels.layout import Array, Scalar
from gapsense.kernels.linalg import vector
from gapsense.kernels.trace import clip, cond, fabs, floor, load, not_, square, store, where, where_each

GAIN = 2000.0  # of the flux linkage [1/s]
ENDS = 1.01  # of the least square of a flux linkage: the profile wants less than none
FRESH = 1e-3  # time after a limit of the voltage in which nothing is learnt [s]
# travels of a closing, an opening, after which a noisy current is used as it is; of a closing more, by its noise over
# the usual current: what is expected hides a mover that is late
UNTIL, NOISIER = (0.55, 0.6), 6.0
# flux linkage, and distance, behind the profile for which that waits; share of the travel until which it does
BEHIND, NEAR, EARLY = 0.1e-3, 2e-6, 0.5
MEASURED, LASTING = 0.1, 0.05  # least share of that before; of an operation in the mean of the last ones


def plan_operation(half: Scalar, speed: Scalar, travel: Scalar, start: Scalar, par: Parameters) -> Operation:
    """Plan of an operation."""
    is_closing = half > 0.5
    lead = where(is_closing, par.closing_lead, par.opening_lead)
    return Operation(
        is_closing=is_closing,
        lead=lead,
        travel=travel,
        tail=par.approach_time,
        distance=par.approach_distance,
        speed=speed,
        start=start,
    )


def running_plan(running: Running, par: Parameters) -> Operation:
    """The plan of the operation that goes on."""
    plan = plan_operation(running.command, running.speed, running.travel, running.start_flux, par)
    return plan._replace(lead=running.lead, deviation=Deviation(*running.deviation))


def nominal_mover(par: Parameters) -> tuple[Scalar, ...]:
    """Factor and bend of the gap, rest, mass and damping, as the parameters give them."""
    return par.gap_factor, par.gap_bend, par.spring_rest, par.mover_mass, par.damping


def mover_of(learnt: Array, par: Parameters) -> Mover:
    """The mover of which the profile of an operation is made."""
    factor, bend, rest, mass, damping, a, b, q, r = learnt
    m = make_mover(par)._replace(factor=factor, bend=bend, rest=rest, mass=mass, damping=damping)
    return m._replace(balance=a, slope=b, lightness=q, drag=r)


def is_late(running: Running, par: Parameters) -> Scalar:
    """Whether an operation has lasted longer than its plan, an ordinary one than a first plan."""
    return is_after(running, running.age, par)


def is_after(running: Running, sample: Scalar, par: Parameters) -> Scalar:
    """Whether a sample of an operation comes after its plan."""
    return sample * par.sample_time > running.lead + running.travel + par.approach_time


def track_plan(state: State, par: Parameters) -> tuple[State, Scalar]:
    """Voltage until the next sample: by the profile, or that of an ordinary operation."""
    running, coil = state.running, state.coil
    time, T_s = running.age * par.sample_time, par.sample_time
    is_on = (running.is_plain < 1.0) & is_planned(time + T_s, running_plan(running, par))
    # what an estimator teaches of the flux linkage is kept by samples, and openings by it would not gain
    is_told = (running.command > 0.5) | (state.by_model < 1.0)
    error, may_wait = _error(state, is_on), is_on & not_(par.voltage_least < 0.0) & is_told
    running = cond(may_wait, lambda: _follow_mover(running, coil.flux - error, par), lambda: running)
    plan = running_plan(running, par)

    def profile() -> tuple[Scalar, Scalar]:
        m = mover_of(running.learnt, par)
        return where(running.age > 0.0, running.wanted, plan.start), flux(time + T_s, plan, m)

    now, then = cond(is_on, profile, lambda: (0.0, 0.0))
    ohmic = coil.resistance * where(running.averaged > 0.0, coil.used, coil.last_current + 0.5 * coil.change)
    wanted = (then - now) / T_s + ohmic + GAIN * (now + error - coil.flux)
    asked = wanted / coil.bridge_gain
    u = clip(asked, par.voltage_least, par.voltage_most)
    plain = where(running.is_plain > 0.0, driving(coil, par), par.voltage_hold)
    hold = where(state.is_strong > 0.0, par.voltage_most, plain)
    ordinary = where(running.command > 0.5, hold, 0.0)
    reached = coil.flux - error + T_s * (u * coil.bridge_gain - ohmic)
    sign = where(running.command > 0.5, 1.0, -1.0)
    is_short, tau = may_wait & (sign * (asked - u) > 0.0), time - plan.lead
    is_behind = is_short & (sign * (now + error - coil.flux) > BEHIND)
    is_deviating = is_short & (tau >= 0.0) & (tau < EARLY * plan.travel)
    waits = where(is_deviating, running.behind > NEAR, is_behind & (tau < 0.0))
    then = where(is_deviating, reached, where(waits, now, then))
    state = state._replace(running=_wait(running, waits, is_deviating, par))
    is_limited = is_on & not_(u == asked)
    return _keep_sample(state, is_on, now, then, is_limited, is_short, par), where(is_on, u, ordinary)


def _follow_mover(running: Running, flux: Scalar, par: Parameters) -> Running:
    """Follow the mover that is believed; where the voltage was too small just now, its path goes on from there.

    A half bridge can neither push nor pull the flux linkage much: the current decays by itself, and R i may need nearly
    all voltage. A profile that did not wait would pull a mover that is still under way, or brake one that is behind.
    """
    m, T_s, is_closing = mover_of(running.learnt, par), par.sample_time, running.command > 0.5
    start, _ = stops(is_closing, m)
    before = start_at_rest(where(running.age > 1.0, running.position, start))._replace(velocity=running.velocity)
    new = move(before, square(flux), T_s, m)
    rests = where(is_closing, new.position >= start, new.position <= start)
    z, v = where(rests, start, new.position), where(rests, 0.0, new.velocity)
    tau = running.age * T_s - running.lead
    on = path(tau, running_plan(running, par), m)
    a = where(rests, 0.0, (v - running.velocity) / T_s)
    beside = vector([tau, z - on.position, v - on.velocity, a - on.acceleration])
    return running._replace(
        position=z,
        velocity=v,
        behind=where(is_closing, z - on.position, on.position - z),
        deviation=where_each(running.deviates > 0.0, beside, running.deviation),
    )


def _wait(running: Running, waits: Scalar, is_deviating: Scalar, par: Parameters) -> Running:
    """Let the plan wait for a sample."""
    one = where(waits, 1.0, 0.0)
    return running._replace(
        lead=running.lead + one * par.sample_time,
        due=running.due + one,
        held=running.held + one,
        deviates=where(is_deviating, 1.0, 0.0),
    )


def _error(state: State, is_on: Scalar) -> Scalar:
    """What the loop's flux linkage is wrong by at this sample, where a profile is on and that counts [Wb]."""
    half, age, by_model = state.running.command, state.running.age, state.by_model > 0.0
    return cond(is_on & by_model, lambda: correction.at_sample(state.errors, half, age), lambda: 0.0)


def _keep_sample(
    state: State, is_on: Scalar, now: Scalar, then: Scalar, is_limited: Scalar, is_short: Scalar, par: Parameters
) -> State:
    """Keep what the laws need of a sample."""
    running = _watch_limits(state, is_on, then, is_limited, is_short, par)
    at = place(running, running.age)
    is_clear = is_on & (running.since_limit * par.sample_time > FRESH)
    kept = cond(running.averaged > 0.0, lambda: _mean_current(state, at), lambda: where(is_clear, now, 0.0))
    return state._replace(
        running=running,
        fluxes=store(state.fluxes, at, state.coil.flux),
        profiles=store(state.profiles, at, kept),
        charges=store(state.charges, at, state.coil.charge),
    )


def expected_current(state: State, running: Running, par: Parameters) -> tuple[Scalar, Scalar]:
    """Current at a sample by the flux linkage and the last operations, and the share that the measured one has.

    What noise adds to the integral of u - R i early in an operation moves the mover most; there it is left out, as the
    mover is where it was in the last ones. Later only the measured current tells how late it is.
    """
    expected = load(state.profiles, place(running, running.age)) + running.reluctance * state.coil.flux
    is_closing = running.command > 0.5
    after = running.age * par.sample_time - running.lead
    closing, opening = UNTIL
    until = where(is_closing, closing + NOISIER * state.coil.noise / usual_current(par), opening)
    share = clip(after / (until * running.travel), follow(_kind(running), MEASURED), 1.0)
    return expected, where(running.is_plain > 0.0, 1.0, share)


def _mean_current(state: State, at: Scalar) -> Scalar:
    """Mean current of soft operations at a sample, less that of the flux linkage where they begin [A]."""
    running, coil, mean = state.running, state.coil, load(state.profiles, at)
    share = where(running.is_plain > 0.0, 0.0, follow(_kind(running), LASTING))
    return mean + share * (coil.last_current - running.reluctance * coil.flux - mean)


def _kind(running: Running) -> Scalar:
    """Averaged operations of its own kind, with this one; kinds take turns."""
    return floor(0.5 * (running.averaged + 1.0))


def place(running: Running, sample: Scalar) -> Scalar:
    """Place in memory of a sample of the operation; all beyond the last place share that."""
    return running.command * LONGEST + where(sample < LONGEST, sample, LONGEST - 1.0)


def _watch_limits(
    state: State, is_on: Scalar, then: Scalar, is_limited: Scalar, is_short: Scalar, par: Parameters
) -> Running:
    """Watch how near the voltage is to its limits."""
    running, coil = state.running, state.coil
    is_moving = running.age * par.sample_time < running.lead + running.travel
    strain = fabs(coil.resistance * coil.last_current) / par.voltage_most
    pushes = is_on & (square(then) <= ENDS * LEAST)  # no magnet does, and the spring is too weak for the profile
    return running._replace(
        wanted=then,
        limited=running.limited + where((is_limited | pushes) & is_moving, 1.0, 0.0),
        unfollowed=running.unfollowed + where(((is_limited & not_(is_short)) | pushes) & is_moving, 1.0, 0.0),
        since_limit=where(is_limited, 0.0, running.since_limit + 1.0),
        strain=where(is_on & (strain > running.strain), strain, running.strain),
    )
