"""Soft landing from cycle to cycle: a flux linkage that the voltage follows, learnt from what the last cycles did.

An operation begins with its command. The mover is to follow a path that ends slowly. The profile is the flux linkage
that this needs; the voltage makes the integral of u - R i follow it. The first cycles are ordinary ones.

From a contact, three mechanical numbers of each kind of operation are learnt. Without a contact the mover is that of an
estimator, which also tells afterwards how wrong the loop's flux linkage was. Approaches get slower as long as they
arrive in time. An operation that lands hard, or does not arrive, is followed by an ordinary cycle, and everything is
learnt afresh.
"""

from __future__ import annotations

import math

from gapsense.control import correction, laws, learning
from gapsense.control.bend import due, find_hardest_bend, held, locate_bend, piece, told_at
from gapsense.control.coil import (
    AVERAGED,
    WARM,
    average_top,
    first_coil,
    held_resistance,
    integrate_sample,
    is_scarce,
    learn_resistance,
    learn_zero,
    reluctance_at,
    shift_flux,
    steady_flux,
    take_estimates,
    usual_current,
    wandering,
)
from gapsense.control.judging import (
    GOOD,
    LOWER,
    NOISY,
    UPPER,
    YOUNG,
    judged_by_contact,
    judged_by_current,
    judged_by_estimator,
    judged_by_reluctance,
    note_contact,
    update_warnings,
    without_core,
)
from gapsense.control.mover import balance
from gapsense.control.profile import stops
from gapsense.control.records import (
    BAD,
    CLOSING,
    NOTHING,
    OPENING,
    Coil,
    Heard,
    Inputs,
    Law,
    LawKind,
    Noted,
    Outputs,
    Parameters,
    Pass,
    Running,
    State,
)
from gapsense.control.tracking import expected_current, is_late, mover_of, nominal_mover, plan_operation, track_plan
from gapsense.estimators.readings import can_be_read
from gapsense.kernels.layout import Array, Scalar, blank
from gapsense.kernels.linalg import total, vector
from gapsense.kernels.trace import cond, fabs, not_, sqrt, where, where_each

UNEXPLAINED = Noted._fields.index("unexplained")
ROW = 1.0  # openings in a row that did not arrive, the last of which an estimator has not judged yet
HARD_ROW = 3.0  # hard impacts, although a contact was listened to
EXPLAINED = 2.0  # operations in a row that an estimator has to explain well before it is followed
FARTHEST = 1e-3  # from that of the loop: an estimator's flux linkage is that of a mover elsewhere [Wb]
OFFSET = 0.004  # of the usual current: an ordinary cycle was learnt with a zero that was wrong by more
SHIFTED = 0.005  # of the largest voltage: the same for the zero of the voltage
PATIENT = 8.0  # cycles after which an estimator is to be followed
PART = 0.5  # of the noise that is warned of: from then on an estimator steadies the flux linkage
ENDING = 0.6  # of the travel of an opening: from then on a noisy estimator takes a mover that stalls for landed
AGAIN = 2.0  # averaged operations, after an ordinary one
TOLD = 15.0  # samples at a limit of the voltage that are told, as a longer travel alone does not mend them


def turn_operation(state: State, inputs: Inputs, par: Parameters) -> State:
    """End an operation and begin the next one."""
    state = cond(
        state.running.command > 0.5, lambda: _end_closing(state, inputs, par), lambda: _end_cycle(state, inputs, par)
    )
    return update_warnings(_begin_operation(state, inputs, par))


# the end of an operation


def _end_operation(state: State, correction: Scalar, inputs: Inputs, par: Parameters) -> State:
    """Keep what an operation leaves; `correction` is the change of the resistance of its samples."""
    running, half, known = state.running, state.running.command, state.laws
    law = laws.read(known, half)._replace(length=running.age, lead=running.lead)
    first = where(half > 0.0, par.closing_travel, par.opening_travel)
    is_warm = running.strain > WARM
    is_limited, is_told = running.limited > laws.LIMITED, running.limited > TOLD
    law = law._replace(travel=where(is_limited, laws.stretch_travel(law, first), law.travel))
    is_followed = running.unfollowed * par.sample_time < laws.UNFOLLOWED * law.travel
    law = law._replace(was_followed=where(is_followed, 1.0, 0.0))
    noted = state.noted._replace(
        too_fast=where(is_told & not_(is_warm), 1.0, state.noted.too_fast),
        used_up=where(is_told & is_warm, 1.0, state.noted.used_up),
    )
    state = state._replace(laws=laws.write(known, half, law), noted=noted)

    by_contact = state.by_model < 1.0
    judged = cond(by_contact, lambda: judged_by_contact(state, par), lambda: without_core(state, par))
    told = judged_by_current(judged, par)
    return cond(by_contact, lambda: learning.begin_pass(told, half, correction, inputs.impact_speed, par), lambda: told)


def _end_closing(state: State, inputs: Inputs, par: Parameters) -> State:
    """End a closing; an ordinary one tells the resistance."""
    coil, is_plain = state.coil, state.running.is_plain > 0.0
    R = where(is_plain, held_resistance(coil, par), coil.resistance)
    state = state._replace(coil=coil._replace(measured=where(is_plain, R, coil.measured)))
    state = cond(is_plain, lambda: judged_by_reluctance(state, par), lambda: state)
    state = _end_operation(state, R - coil.resistance, inputs, par)
    return state._replace(coil=_opening(state, is_plain, inputs, par))


def _opening(state: State, is_plain: Scalar, inputs: Inputs, par: Parameters) -> Coil:
    """Flux linkage with which an opening begins: a mean of the last ones, or that of a credible estimator."""
    coil, by_contact = state.coil, state.by_model < 1.0
    off = inputs.estimated_flux_linkage - coil.flux
    is_credible = not_(by_contact) & (inputs.misfit < GOOD) & (fabs(off) < FARTHEST)
    told = shift_flux(coil, where(is_credible, off, 0.0))
    return cond(by_contact & not_(is_plain), lambda: average_top(coil, state.running.averaged > 0.0, par), lambda: told)


def _end_cycle(state: State, inputs: Inputs, par: Parameters) -> State:
    """End an opening and its cycle; before the first command there was none."""
    return cond(state.cycles > 0.0, lambda: _next_cycle(state, inputs, par), lambda: _begin_first_cycle(state, par))


def _begin_first_cycle(state: State, par: Parameters) -> State:
    """Begin the first cycle."""
    state = _forget_operations(state, 0.0, par)
    return state._replace(coil=state.coil._replace(flux=0.0, charge=0.0, passed=0.0), cycles=1.0)


def _forget_operations(state: State, missed: Scalar, par: Parameters) -> State:
    """Forget both operations; with one missed, the next ones are ordinary if none was soft yet."""
    known = state.laws
    for half, lead, travel in (
        (CLOSING, par.closing_lead, par.closing_travel),
        (OPENING, par.opening_lead, par.opening_travel),
    ):
        known = laws.write(known, half, laws.first(travel, state.by_model, par)._replace(lead=lead, missed=missed))
    return state._replace(laws=known, course=state.course._replace(last=-1.0))


def _hand_over(state: State, inputs: Inputs, par: Parameters) -> State:
    """Hand over to the estimator, if there is one, where landings by contact are or would be hard again and again."""
    is_hard = (state.landed_hard >= HARD_ROW) | _is_noisy(state, par)
    is_due = (state.by_model < 1.0) & is_hard & _is_told(state, inputs, par)
    handed = state._replace(by_model=1.0, landed_hard=0.0)
    return cond(is_due, lambda: _forget_operations(handed, 0.0, par), lambda: state)


def _next_cycle(state: State, inputs: Inputs, par: Parameters) -> State:
    followed = state.by_model
    state = _hand_over(state, inputs, par)
    is_plain, by_contact = state.running.is_plain > 0.0, state.by_model < 1.0
    coil: Coil = cond(is_plain, lambda: learn_zero(state.coil, par), lambda: state.coil)
    is_open = (inputs.mode == UPPER) | (inputs.mode < LOWER)
    new = cond(
        by_contact,
        lambda: learn_resistance(coil, state.since_plain + 1.0, is_open, state.running.averaged > 0.0, par),
        lambda: take_estimates(coil, state.cycles, inputs, par),
    )
    used = where(by_contact, new.measured, new.resistance)
    state = _end_operation(state, used - coil.resistance, inputs, par)
    is_off = fabs(coil.zero - state.coil.zero) > OFFSET * usual_current(par)
    is_off = is_off | (fabs(coil.voltage_zero - state.coil.voltage_zero) > SHIFTED * par.voltage_most)
    state = cond(by_contact & is_off, lambda: _forget_operations(state, 1.0, par), lambda: state)
    is_grown = ((state.cycles == YOUNG) | (state.since_plain == YOUNG)) & not_(is_scarce(state.coil, par))
    known = cond(is_grown, lambda: _forget_youth(state.laws, par), lambda: state.laws)
    return state._replace(
        coil=new,
        laws=known,
        cycles=state.cycles + 1.0,
        alarm=where(state.by_model > followed, 0.0, state.alarm),  # another law is the answer then
        since_plain=state.since_plain + 1.0,
        remembered=vector([*_note_cycle(state, par)]),
        noted=NOTHING,
        explained=0.0,
    )


def _forget_youth(known: Array, par: Parameters) -> Array:
    """Forget which approaches were too short while the model was young."""
    for half in (CLOSING, OPENING):
        known = laws.write(known, half, laws.read(known, half)._replace(floor=par.approach_least))
    return known


def _note_cycle(state: State, par: Parameters) -> Noted:
    """Note what only a whole cycle tells."""
    is_ready = (state.is_ready > 0.0) | (state.since_plain > 0.0) | (state.cycles < PATIENT)
    unexplained = (state.by_model > 0.0) & ((state.explained < 1.0) | not_(is_ready))
    unexplained = unexplained | (state.noted.unexplained > 0.0)
    shifted = fabs(state.coil.voltage_zero) > SHIFTED * par.voltage_most
    return state.noted._replace(
        unexplained=where(unexplained, 1.0, 0.0),
        shifted=where(shifted, 1.0, 0.0),
        noisy=where(_is_noisy(state, par), 1.0, 0.0),
    )


def _is_noisy(state: State, par: Parameters, share: float = 1.0) -> Scalar:
    """Whether noise makes the loop's flux linkage too wrong for soft landings, or by a share of that."""
    return wandering(state.coil, par) > share * NOISY * state.running.balance_flux


# the beginning of an operation


def _begin_operation(state: State, inputs: Inputs, par: Parameters) -> State:
    """Begin an operation; it is soft if a cycle begins for which enough is known."""
    half, by_contact = 1.0 - state.running.command, state.by_model < 1.0
    law, is_closing, is_ready = laws.read(state.laws, half), half > 0.5, _is_ready(state, inputs, par)
    falls_back, is_unsure = is_closing & _falls_back(state), not_(by_contact) & (law.missed >= laws.UNJUDGED)
    law = _raise_unexplained(law, is_closing & is_unsure & (state.alarm < 1.0), par)
    goes_on = not_(is_closing) & ((state.running.is_plain > 0.0) | is_unsure)
    is_plain = goes_on | falls_back | (is_closing & (not_(is_ready) | (inputs.enable <= 0.5)))
    starts_again = falls_back & not_(by_contact)  # until the estimator explains some windows again
    learnt = vector([*_learnt(state, inputs, par), *law.mean])
    m = mover_of(learnt, par)
    z0, _ = stops(is_closing, m)
    is_far = fabs(inputs.estimated_flux_linkage - state.coil.flux) >= FARTHEST
    start = where(by_contact | is_far, state.coil.flux, inputs.estimated_flux_linkage)
    is_there = by_contact & (inputs.mode == where(is_closing, LOWER, UPPER))  # the last one did not move it
    is_plain = is_plain | is_there | (state.alarm > 0.0)
    plan = plan_operation(half, law.speed, law.travel, 0.0, par)
    began = where(inputs.mode == where(is_closing, UPPER, LOWER), 1.0, 0.0)
    balance_flux = sqrt(balance(z0, m))
    is_noisy = state.coil.noise > AVERAGED * usual_current(par)
    is_noisy = where(is_closing, is_noisy, state.running.averaged > 0.0)  # an opening goes with its closing
    is_averaged = by_contact & is_noisy & (inputs.windows < 1.0)  # an estimator steadies better
    is_unexplained = starts_again & (state.alarm < 1.0)
    return state._replace(
        noted=state.noted._replace(unexplained=where(is_unexplained, 1.0, state.noted.unexplained)),
        laws=laws.write(state.laws, half, laws.start_operation(law, is_plain)),
        running=blank(
            Running,
            command=half,
            is_plain=where(is_plain, 1.0, 0.0),
            start_flux=start,
            speed=law.speed,
            lead=plan.lead,
            travel=law.travel,
            learnt=learnt,
            balance_flux=balance_flux,
            averaged=where(is_averaged, _count_averaged(state.running.averaged, is_plain), 0.0),
            reluctance=reluctance_at(z0, par),
            piece=piece(where(is_averaged, state.coil.noise, 0.0), par),
            due=due(plan, par),
            held=held(plan, par),
            last_age=state.running.age,
            last_is_judged=state.running.is_judged,
            drawn_before=state.coil.drawn,
        ),
        heard=blank(Heard, last_mode=inputs.mode, began=began),
        alarm=where(state.alarm > 0.0, state.alarm - 1.0, 0.0),
        since_plain=where(is_closing & is_plain, 0.0, state.since_plain),
        by_model=where(starts_again & (par.law == LawKind.contact), 0.0, state.by_model),
        is_ready=where(starts_again, -1.0, where(is_closing & is_ready, 1.0, state.is_ready)),
        explained_well=where(starts_again, 0.0, state.explained_well),
    )


def _raise_unexplained(law: Law, is_so: Scalar, par: Parameters) -> Law:
    """Raise the next approach after a soft closing that neither an estimator nor the current saw arrive."""
    return laws.raise_where(law, is_so & (law.was_plain < 1.0) & (law.was_followed > 0.0), par)


def _count_averaged(count: Scalar, is_plain: Scalar) -> Scalar:
    """Count one more soft operation; after an ordinary one, which tells of a change, the means follow quickly again."""
    return where(is_plain, where(count < AGAIN, count, AGAIN), count + 1.0)


def _falls_back(state: State) -> Scalar:
    """Whether an ordinary cycle is due; an estimator that has explained nothing in the last one is not followed."""
    closing, opening = (laws.read(state.laws, half) for half in (CLOSING, OPENING))
    is_lost = (state.is_ready > 0.0) & (state.by_model > 0.0) & (state.remembered[UNEXPLAINED] > 0.0)
    return is_lost | (state.alarm > 0.0) | (closing.missed >= laws.UNJUDGED) | (opening.missed > ROW)


def _is_ready(state: State, inputs: Inputs, par: Parameters) -> Scalar:
    """Whether enough is known for soft cycles: one cycle by the contact, or two that an estimator solved in time."""
    closing, opening = (laws.read(state.laws, half) for half in (CLOSING, OPENING))
    is_heard = (state.cycles > 1.0) & (closing.missed < 1.0) & (opening.missed < 1.0)
    by_contact = state.by_model < 1.0
    return (state.is_ready > 0.0) | (by_contact & is_heard) | (not_(by_contact) & _is_told(state, inputs, par))


def _is_told(state: State, inputs: Inputs, par: Parameters) -> Scalar:
    """Whether an estimator can be followed: it has explained two operations in a row, and is in time."""
    closing, opening = (laws.read(state.laws, half) for half in (CLOSING, OPENING))
    cycle = (closing.length + opening.length) * par.sample_time
    is_good = (state.explained_well >= EXPLAINED) & not_(inputs.estimated_mass == state.first_mass)
    unknown = state.coil.voltage_zero - inputs.estimated_voltage_offset
    is_good = is_good & (fabs(unknown) < SHIFTED * par.voltage_most)
    return (state.cycles > 2.0) & is_good & (inputs.time - state.smoothed_until < cycle)


def _learnt(state: State, inputs: Inputs, par: Parameters) -> list[Scalar]:
    """Factor and bend of the gap, rest, mass and damping, as an estimator has learnt them if there is one."""
    has_learnt = (state.by_model > 0.0) & (inputs.windows > 0.0) & (inputs.estimated_mass > 0.0)
    gap = (inputs.estimated_gap_factor, inputs.estimated_gap_bend)
    found = (*gap, inputs.estimated_rest_position, inputs.estimated_mass, inputs.estimated_viscous_damping)
    return [where(has_learnt, new, old) for new, old in zip(found, nominal_mover(par))]


FASTEST = 1e3  # impact speed that can be [m/s]
IDLE, LEARNING, TRACKING, SHORT, BACK, OPEN = 0.0, 1.0, 2.0, 3.0, 4.0, 5.0  # states


def _first(par: Parameters) -> Running:
    """The open actuator before the first command."""
    return blank(
        Running,
        command=OPENING,
        is_plain=1.0,
        speed=par.approach_first,
        lead=par.opening_lead,
        travel=par.opening_travel,
        learnt=vector([*nominal_mover(par), 0.0, 0.0, 0.0, 0.0]),
        piece=piece(0.0, par),
        is_judged=1.0,
        last_is_judged=1.0,
    )


def initial(inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """Open, without flux; nothing happens before the first command."""
    state = blank(
        State,
        coil=first_coil(inputs, par),
        running=_first(par),
        heard=blank(Heard, last_mode=inputs.mode),
        course=blank(Pass, last=-1.0),
        by_model=where(par.law == LawKind.model, 1.0, 0.0),
        first_mass=inputs.estimated_mass,
        smoothed_until=inputs.time,
    )
    return state, _outputs(state, 0.0)


def step(state: State, inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """One sample: the loop, the next operation, the voltage until the next sample, and a piece of what is learnt."""
    running = state.running._replace(age=state.running.age + 1.0)
    usual = cond(running.averaged > 0.0, lambda: expected_current(state, running, par), lambda: (0.0, 1.0))
    coil, is_lost = integrate_sample(state.coil, inputs, is_late(running, par), *usual, par)

    def steady() -> Coil:
        time, is_noisy = running.age * par.sample_time, _is_noisy(state, par, PART)
        is_ending = (running.command < 0.5) & (time > running.lead + ENDING * running.travel)
        return steady_flux(coil, inputs, time, running.drawn_before, is_noisy, is_ending, par)

    coil = cond(state.by_model > 0.0, steady, lambda: coil)
    running = running._replace(
        drawn_till_told=where(running.age <= told_at(running, par), coil.drawn, running.drawn_till_told)
    )
    noted = state.noted._replace(lost=where(is_lost, 1.0, state.noted.lost))
    state = state._replace(coil=coil, running=running, noted=noted)
    state = state._replace(heard=note_contact(state, inputs, par))
    is_command = (inputs.command > 0.5) | (inputs.command <= 0.5)  # else it is lost, and the last one goes on
    command = where(is_command, where(inputs.command > 0.5, CLOSING, OPENING), running.command)
    goes_on = command == running.command
    going = cond(is_lost, lambda: update_warnings(state), lambda: state)
    state = cond(goes_on, lambda: going, lambda: turn_operation(going, _readable(going, inputs), par))
    state, u = track_plan(state, par)
    state = state._replace(coil=state.coil._replace(asked=u))
    state = state._replace(heard=find_hardest_bend(state, par))
    state = locate_bend(state, par)
    state = learn_from_estimator(state, inputs, par)
    return cond(state.by_model > 0.0, lambda: state, lambda: learning.work(state, par)), _outputs(state, u)


def learn_from_estimator(state: State, inputs: Inputs, par: Parameters) -> State:
    """Take what an estimator says of an operation and of a sample in it, where it explains them."""
    readable = _readable(state, inputs)

    def believed() -> State:
        judged = judged_by_estimator(state, readable, par)
        return cond(judged.by_model > 0.0, lambda: correction.correct_flux(judged, readable, par), lambda: judged)

    is_shown = (inputs.misfit < BAD) & (inputs.smoothed_published > 0.0)
    return cond(is_shown & (readable.misfit < BAD), believed, lambda: state)


def _readable(state: State, inputs: Inputs) -> Inputs:
    """An impact speed that is none is not known; an estimator that says NaN says nothing, and what it said stays."""
    said = inputs[Inputs._fields.index("estimated_flux_linkage") :]
    says_numbers = fabs(total(said)) < math.inf
    silent = inputs._replace(
        estimated_flux_linkage=state.coil.flux,
        misfit=math.inf,
        landing_time=0.0,
        smoothed_time=inputs.time,
        smoothed_flux_linkage=state.coil.flux,
        estimated_resistance=0.0,
        estimated_mass=0.0,
    )
    return where_each(says_numbers, inputs, silent)._replace(
        impact_speed=where(can_be_read(inputs.impact_speed, FASTEST), inputs.impact_speed, 0.0)
    )


def _outputs(state: State, u: Scalar) -> Outputs:
    running = state.running
    ordinary = where(state.is_open > 0.0, OPEN, where(state.is_ready == 0.0, LEARNING, BACK))
    soft = where(state.fell > 0.0, SHORT, TRACKING)
    return Outputs(
        voltage_reference=u,
        flux_reference=running.wanted,
        flux_linkage=state.coil.flux,
        resistance=state.coil.resistance,
        approach_speed=running.speed,
        balance_flux=running.balance_flux,
        cycle=state.cycles,
        state=where(state.cycles < 1.0, IDLE, where(running.is_plain > 0.0, ordinary, soft)),
        warnings=state.warnings,
    )
