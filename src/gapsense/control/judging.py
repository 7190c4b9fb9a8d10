"""How an operation went: when the mover landed, by the contact or by an estimator, and the consequences."""

from __future__ import annotations

from gapsense.control import laws
from gapsense.control.bend import (
    has_floated,
    is_faint,
    is_of_core,
    landing_speed,
    moved_earlier,
    tell_afloat,
    tell_arrival,
)
from gapsense.control.coil import is_quiet, left_open, raise_hold, steadied_error, wandering
from gapsense.control.mover import balance, make_mover
from gapsense.control.profile import arrival, path, stops
from gapsense.control.records import CLOSING, NOTHING, OPENING, Heard, Inputs, Law, Parameters, State
from gapsense.control.tracking import is_after, plan_operation, running_plan
from gapsense.kernels.layout import Array, Scalar
from gapsense.kernels.linalg import total
from gapsense.kernels.trace import cond, fabs, not_, sqrt, where

LOWER, MOVING, UPPER = 1.0, 2.0, 3.0  # modes
WARNINGS = tuple(float(2**k) for k in range(len(NOTHING)))  # bits
GOOD = 3.5  # misfit of a window that is solved well
HARD, TWICE = 0.1, 2.0  # an impact is hard beyond this [m/s] and so many approach speeds
LOUD = 0.3  # impact speed by an estimator of which is warned [m/s]
ENOUGH, ALLOWED = 0.3, 1.2  # an impact is that of another actuator beyond this [m/s] and so many approach speeds
SURELY = 0.6  # a speed with which the current tells a hit that no contact in time can deny [m/s]
TARDY = 0.3e-3  # a contact that comes so long after the plan may have missed the stop [s]
AUDIBLE = 0.42  # impact speed by the current that is hard [m/s]
AHEAD = 600.0  # speed by the distance that the plan had left at a landing [1/s]
BOUNCED, STUBBORN = 0.25, 3.0  # travels by which a contact is late; so many openings in a row of a mover that bounces
DROPPED, DROPS = 0.68, 0.5  # travels after the planned arrival: later a mover had been let go; its speed [m/s]
SLOWER, AFLOAT = 0.08, 0.14  # more reluctance of a closing with a noisy current: it was too slow; its mover floated
FELT = 0.25  # of a closing that only the current tells: with the second one in a row an ordinary cycle is due
FORGIVEN = 0.5  # hard impacts, by a soft one
NOISY = 0.012  # of the flux linkage that balances the spring: what noise may make it wrong by
ADDED = 8.0  # speed of a landing by what noise makes wrong beyond that, as a share [m/s]
DEVIATIONS = 3.0  # of the error of a flux linkage that an estimator steadies, for which approaches are not too slow
SLOW = 2.0  # slowest approaches: by a faster one is not told whether openings come late
LESS = 0.4  # of the error by noise, where the current is averaged
YOUNG = 8.0  # cycles in which approaches are still fast


def update_warnings(state: State) -> State:
    """Set the warnings: the sum of what was noticed in this cycle or the last one."""
    noticed = (where(now > last, now, last) for now, last in zip(state.noted, state.remembered))
    return state._replace(warnings=total(bit * is_so for bit, is_so in zip(WARNINGS, noticed)))


def note_contact(state: State, inputs: Inputs, par: Parameters) -> Heard:
    """Note the contact of a sample: the first landing, and the last take-off before it.

    The noise is known only after the first landing, so a delay that was learnt there may have to be dropped.
    """
    late, is_closing = where(is_quiet(state.coil, par), state.late, 0.0), state.running.command > 0.5
    told = [moved_earlier(at, late - state.heard.taken) for at in (state.heard.takeoff, state.heard.landing)]
    heard = state.heard._replace(takeoff=told[0], landing=told[1], taken=late)
    start, stop = where(is_closing, UPPER, LOWER), where(is_closing, LOWER, UPPER)
    has_landed, at = heard.landing > 0.0, moved_earlier(state.running.age, late)
    leaves = (heard.last_mode == start) & (inputs.mode == MOVING) & not_(has_landed)
    lands = (heard.last_mode == MOVING) & (inputs.mode == stop) & not_(has_landed) & (heard.takeoff > 0.0)
    return heard._replace(
        last_mode=where(inputs.mode > 0.0, inputs.mode, heard.last_mode),
        takeoff=where(leaves, at, heard.takeoff),
        landing=where(lands, at, heard.landing),
    )


def judged_by_contact(state: State, par: Parameters) -> State:
    """Judge an ended operation by its contact, and by the current where that tells an earlier hit."""
    heard, is_plain = _with_hit(state, par), state.running.is_plain > 0.0
    says_nothing = is_plain & (heard.takeoff < 1.0) & (heard.landing < 1.0) & (state.is_open < 1.0)
    tardy = _count_tardy(state, heard.landing, par)
    noted = state.noted._replace(
        unseen=where(says_nothing, 1.0, state.noted.unseen), hard=where(tardy >= STUBBORN, 1.0, state.noted.hard)
    )
    has_landed = where(heard.landing > 0.0, 1.0, 0.0)
    state = state._replace(heard=heard, noted=noted, tardy=tardy)
    return _judge_landing(state, state.running.command, has_landed, heard.landing * par.sample_time, par)


def _count_tardy(state: State, landing: Scalar, par: Parameters) -> Scalar:
    """Count soft openings in a row that are late for all that was learnt: their movers hit the stop and bounce."""
    running = state.running
    plan = running_plan(running, par)
    is_late = landing * par.sample_time - plan.lead - arrival(plan) > BOUNCED * plan.travel
    is_tardy = (running.is_plain < 1.0) & (landing > 0.0) & is_late & is_quiet(state.coil, par)
    return where(running.command > 0.5, state.tardy, where(is_tardy, state.tardy + 1.0, 0.0))


def judged_by_reluctance(state: State, par: Parameters) -> State:
    """Judge an ordinary closing: if the mover is still open, more voltage is due next time.

    It gets more current from then on, unless a contact denies it or is not known.
    """
    by_contact, mode = state.by_model < 1.0, state.heard.last_mode
    is_open = where(left_open(state.coil, par) & not_(by_contact & (mode == LOWER)), 1.0, 0.0)
    is_sure = (is_open > 0.0) & (not_(by_contact) | (mode > LOWER))
    return state._replace(
        coil=cond(is_sure, lambda: raise_hold(state.coil), lambda: state.coil),
        noted=state.noted._replace(open=is_open),
        is_open=is_open,
        is_strong=is_open,
    )


def judged_by_current(state: State, par: Parameters) -> State:
    """Judge an ended operation: whether it landed hard or, by the contact, not at all."""
    heard, running, is_soft = state.heard, state.running, state.running.is_plain < 1.0
    by_contact = state.by_model < 1.0
    is_hit = not_(by_contact) | (heard.landing == heard.hit) | (heard.hardest > SURELY)  # else the contact was in time
    speed = cond(heard.landing > 0.0, lambda: landing_speed(state, par), lambda: 0.0)
    speed = where(is_hit & (heard.hardest > speed), heard.hardest, speed)
    timed = _speed_by_time(state, par)
    speed = where(by_contact & (running.averaged > 0.0) & (timed > speed), timed, speed)
    # a faint hit teaches; it is no alarm
    is_only_faint = (heard.hit > 0.0) & (heard.landing == heard.hit) & is_faint(state, par)
    is_hard = is_soft & (speed > AUDIBLE) & not_(is_only_faint)
    law = laws.read(state.laws, running.command)
    is_there, is_absent, seated = tell_arrival(state, law.seated, par)
    more, rested, came = cond(
        is_soft & not_(by_contact), lambda: tell_afloat(state, law.rested, par), lambda: (0.0, law.rested, False)
    )
    came = came & not_(is_there) & (law.seated <= 0.0)  # later ones are compared with those that have arrived
    is_absent, seated = is_absent | (more > AFLOAT) | came, where(came, law.seated, seated)
    has_touched = by_contact & (heard.landing > 0.0) & not_(is_after(running, heard.landing, par))
    is_short = is_soft & not_(has_touched) & (is_absent | (by_contact & (heard.landing < 1.0)))
    is_felt = is_soft & is_there & not_(by_contact) & (law.missed > 0.0)
    law = law._replace(
        missed=law.missed - where(is_felt, FELT, 0.0), seated=where(is_soft, seated, law.seated), rested=rested
    )
    floated = is_soft & not_(by_contact) & (has_floated(state, par) | (more > SLOWER))
    law = law._replace(floated=where(floated, 1.0, 0.0))
    # an estimator may take a closing that floated for landed, or not tell it
    is_slow = floated & (running.command > 0.5) & (law.was_followed > 0.0)
    law = laws.raise_where(law, is_slow, par)
    state = state._replace(laws=laws.write(state.laws, running.command, law))
    state = state._replace(noted=state.noted._replace(hard=where(is_hard, 1.0, state.noted.hard)))
    is_loud = is_soft & (speed > _most(running.speed)) & not_(is_only_faint)
    return _raise_alarm(state, running.command, is_short | is_loud, par)


def _speed_by_time(state: State, par: Parameters) -> Scalar:
    """Impact speed of a mover that landed earlier than planned, or so late that it had been let go [m/s]."""
    heard, running, m = state.heard, state.running, make_mover(par)
    plan = running_plan(running, par)
    tau = heard.landing * par.sample_time - plan.lead
    at = path(tau, plan, m)
    early = fabs(at.velocity) + AHEAD * fabs(at.position - stops(plan.is_closing, m)[1])
    is_dropped = tau - arrival(plan) > DROPPED * plan.travel
    return where(heard.landing > 0.0, where(is_dropped, DROPS, early), 0.0)


def _most(speed: Scalar) -> Scalar:
    """Impact speed beyond which only a change of the device explains a landing [m/s]."""
    return ENOUGH + ALLOWED * speed


def _with_hit(state: State, par: Parameters) -> Heard:
    """Take the hit that the current tells for the landing, where the contact comes much later or not at all."""
    heard, running = without_core(state, par).heard, state.running
    plan = running_plan(running, par)
    late = heard.landing * par.sample_time - plan.lead - arrival(plan)
    is_after_it = (heard.landing - heard.hit) * par.sample_time > TARDY
    is_before = (heard.hit > 0.0) & ((heard.landing < 1.0) | (late > TARDY) | is_after_it)
    return heard._replace(landing=where(is_before, heard.hit, heard.landing))


def without_core(state: State, par: Parameters) -> State:
    """Drop a hit that is the bend of a saturating core."""
    heard, is_hit = state.heard, not_(is_of_core(state, par))
    heard = heard._replace(hit=where(is_hit, heard.hit, 0.0), hardest=where(is_hit, heard.hardest, 0.0))
    return state._replace(heard=heard)


def _raise_alarm(state: State, half: Scalar, is_bad: Scalar, par: Parameters) -> State:
    """After a bad soft operation order an ordinary cycle, and forget what was learnt."""

    def afresh() -> Array:
        known = state.laws
        for each in (CLOSING, OPENING):
            known = laws.write(known, each, laws.forget(laws.read(known, each), state.by_model, par))
        return known

    def doubted() -> State:
        was_followed = laws.read(state.laws, half).was_followed > 0.0  # else it was the voltage that fell short
        known = cond(was_followed, afresh, lambda: state.laws)
        # with the opening of a closing that has begun
        alarm = where(state.alarm < 0.0, state.alarm, 1.0 + state.running.command)
        hard = state.landed_hard + 1.0 - state.by_model
        return state._replace(laws=known, alarm=alarm, landed_hard=hard, noted=state.noted._replace(changed=1.0))

    return cond(is_bad, doubted, lambda: state)


def judged_by_estimator(state: State, inputs: Inputs, par: Parameters) -> State:
    """Once an estimator has explained the window of an operation: of the last one, or of that which is under way.

    The sample that is shown belongs to a window that is solved: if it is one of an operation after its lead, and there
    is no landing in that, there was none.
    """
    running, T_s = state.running, par.sample_time
    start, now = inputs.time - running.age * T_s, running.command
    last = (1.0 - now, start - running.last_age * T_s, running.last_age * T_s)
    is_last_due = (running.last_is_judged < 1.0) & _is_known(*last, inputs, par)
    is_due = (running.is_judged < 1.0) & _is_known(now, start, running.age * T_s, inputs, par)
    state = state._replace(
        smoothed_until=inputs.smoothed_time,
        explained=1.0,
        running=running._replace(
            is_judged=where(is_due, 1.0, running.is_judged),
            last_is_judged=where(is_last_due, 1.0, running.last_is_judged),
        ),
    )
    state = cond(is_last_due, lambda: _judge_window(state, *last, inputs, par), lambda: state)
    state = cond(is_due, lambda: _judge_window(state, now, start, running.age * T_s, inputs, par), lambda: state)
    return cond(is_due | is_last_due, lambda: update_warnings(state), lambda: state)


def _is_known(half: Scalar, start: Scalar, length: Scalar, inputs: Inputs, par: Parameters) -> Scalar:
    """Whether the operation that began at `start` is among those that the estimator has solved."""
    lead = where(half > 0.5, par.closing_lead, par.opening_lead)
    shown = inputs.smoothed_time - start
    return (length > 0.0) & ((_estimator_landed(start, length, inputs) > 0.0) | ((shown > lead) & (shown <= length)))


def _estimator_landed(start: Scalar, length: Scalar, inputs: Inputs) -> Scalar:
    """1 if the landing that the estimator tells lies within an operation, else 0."""
    landing = inputs.landing_time - start
    return where((landing > 0.0) & (landing <= length), 1.0, 0.0)


def _judge_window(state: State, half: Scalar, start: Scalar, length: Scalar, inputs: Inputs, par: Parameters) -> State:
    """Judge an operation whose window the estimator has explained."""
    has_landed = _estimator_landed(start, length, inputs)
    law = laws.read(state.laws, half)
    heard = _impact_heard(state, law, has_landed, inputs, par)
    is_hard = (inputs.misfit < GOOD) & (inputs.estimated_impact_speed > _most(law.speed))
    is_bad = (law.was_plain < 1.0) & ((has_landed < 1.0) | is_hard)

    def judged() -> State:
        landing, is_timed = inputs.landing_time - start, (inputs.misfit < GOOD) & (has_landed > 0.0)
        eased = heard._replace(laws=_ease_opening(heard.laws, half, landing, is_timed, par))
        return _raise_alarm(_judge_landing(eased, half, has_landed, landing, par), half, is_bad, par)

    return cond(state.by_model > 0.0, judged, lambda: heard)


def _ease_opening(known: Array, half: Scalar, landing: Scalar, is_timed: Scalar, par: Parameters) -> Array:
    """Learn from a slow opening whose landing is told; a half bridge cannot pull its flux linkage down."""
    law = laws.read(known, half)
    plan = plan_operation(half, law.speed, law.travel, 0.0, par)._replace(lead=law.lead)
    is_told = is_timed & (half < 0.5) & (law.was_plain < 1.0) & (law.speed < SLOW * par.approach_least)
    is_told = is_told & (par.voltage_least < 0.0)
    return laws.write(known, half, laws.ease_opening(law, is_told, landing - plan.lead - arrival(plan)))


def _impact_heard(state: State, law: Law, has_landed: Scalar, inputs: Inputs, par: Parameters) -> State:
    """How well an operation was explained, and whether it landed harder than it was to."""
    is_good, is_soft = inputs.misfit < GOOD, law.was_plain < 1.0
    planned_speed = where(state.cycles < YOUNG, law.speed, par.approach_least)
    most, hardest = HARD + TWICE * planned_speed, HARD + ALLOWED * par.approach_first
    is_hard = inputs.estimated_impact_speed > where(most < hardest, most, hardest)
    is_hard, is_loud = is_hard & is_soft & is_good & (has_landed > 0.0), inputs.estimated_impact_speed > LOUD
    fewer = where(state.landed_hard > FORGIVEN, state.landed_hard - FORGIVEN, 0.0)
    return state._replace(
        explained_well=where(is_good, state.explained_well + 1.0, 0.0),
        landed_hard=where(is_hard, state.landed_hard + 1.0, where(is_soft, fewer, state.landed_hard)),
        noted=state.noted._replace(hard=where(is_hard & is_loud, 1.0, state.noted.hard)),
    )


def _slowest(state: State, par: Parameters) -> Scalar:
    """Speed of the slowest approaches: not below what noise adds to that of a landing [m/s].

    An estimator steadies the flux linkage, but what it says of the mover while it is young is as uncertain as that.
    """
    m = make_mover(par)
    is_steady = (state.by_model > 0.0) & (state.since_plain >= YOUNG)
    error = where(is_steady, DEVIATIONS * steadied_error(state.coil, par), wandering(state.coil, par))
    error = where(state.running.averaged > 0.0, LESS * error, error)
    added = ADDED * (error / sqrt(balance(m.gap.smallest, m)) - NOISY)
    return where(added > par.approach_least, added, par.approach_least)


def _judge_landing(state: State, half: Scalar, has_landed: Scalar, landing: Scalar, par: Parameters) -> State:
    """Draw the consequences of a landing, or of none: the next approach, a stronger hold."""
    law = laws.read(state.laws, half)
    plan = plan_operation(half, law.speed, law.travel, 0.0, par)._replace(lead=law.lead)
    is_plain = law.was_plain > 0.0
    after = where(is_plain, 0.0, landing - plan.lead - arrival(plan))
    first = where(half > 0.5, par.closing_travel, par.opening_travel)
    is_late = laws.is_late(has_landed, after, first, state.running.averaged > 0.0)
    is_weak = (has_landed < 1.0) & (state.by_model < 1.0)
    kept = where(state.by_model > 0.0, state.is_strong, 0.0)  # what the reluctance says, an estimator does not deny
    plain = law._replace(missed=where(has_landed > 0.0, 0.0, 1.0 + where(state.by_model > 0.0, law.missed, 0.0)))

    def soft() -> Law:
        return laws.choose_approach(law, half, has_landed, is_late, _slowest(state, par), par)

    return state._replace(
        laws=laws.write(state.laws, half, cond(is_plain, lambda: plain, soft)),
        fell=where(is_late | laws.has_raised(law, half), 1.0, 0.0),
        is_strong=where(half > 0.0, where(is_plain & is_weak, 1.0, kept), state.is_strong),
    )
