"""How an operation went: when the mover landed, by the contact or by an estimator, and what follows from it."""

from __future__ import annotations

from gapsense.control import laws
from gapsense.control.profile import arrival
from gapsense.control.records import BAD, Heard, Inputs, Law, Parameters, State
from gapsense.control.tracking import planned
from gapsense.records import Scalar
from gapsense.trace import cond, not_, where

LOWER, MOVING, UPPER = 1.0, 2.0, 3.0  # modes
GOOD = 3.5  # misfit of a window that is solved well
HARD, TWICE = 0.1, 2.0  # an impact is hard beyond this [m/s] and so many approach speeds
FORGIVEN = 0.5  # hard impacts, by a soft one
YOUNG = 8.0  # cycles in which approaches are still fast


def listened(state: State, inputs: Inputs) -> Heard:
    """The contact at a sample: the last take-off before the first landing, and that."""
    heard, is_closing = state.heard, state.running.command > 0.5
    start, stop = where(is_closing, UPPER, LOWER), where(is_closing, LOWER, UPPER)
    has_landed, age = heard.landing > 0.0, state.running.age
    leaves = (heard.last_mode == start) & (inputs.mode == MOVING) & not_(has_landed)
    lands = (heard.last_mode == MOVING) & (inputs.mode == stop) & not_(has_landed) & (heard.takeoff > 0.0)
    return heard._replace(
        last_mode=where(inputs.mode > 0.0, inputs.mode, heard.last_mode),
        takeoff=where(leaves, age, heard.takeoff),
        landing=where(lands, age, heard.landing),
    )


def judged_by_contact(state: State, par: Parameters) -> State:
    """With its end: what the contact has said of it."""
    heard, is_plain = state.heard, state.running.is_plain > 0.0
    says_nothing = is_plain & (heard.takeoff < 1.0) & (heard.landing < 1.0)
    state = state._replace(noted=state.noted._replace(unseen=where(says_nothing, 1.0, state.noted.unseen)))
    has_landed = where(heard.landing > 0.0, 1.0, 0.0)
    return _judged(state, state.running.command, has_landed, heard.landing * par.sample_time, par)


def judged_by_estimator(state: State, inputs: Inputs, par: Parameters) -> State:
    """Once an estimator has explained the window of an operation: of the one that is under way, or of the last one."""
    is_shown = (inputs.misfit < BAD) & (inputs.smoothed_published > 0.0)
    now = state.running.command

    def shown() -> State:
        noted = state.noted._replace(explained=1.0)
        known = state._replace(smoothed_until=inputs.smoothed_time, noted=noted)
        return _judged_if_known(_judged_if_known(known, 1.0 - now, inputs, par), now, inputs, par)

    return cond(is_shown, shown, lambda: state)


def _judged_if_known(state: State, half: Scalar, inputs: Inputs, par: Parameters) -> State:
    """The last operation of a kind, if it is not judged yet.

    The sample that is shown belongs to a window that is solved: if it is one of the operation after its lead, and there
    is no landing in it, there was none.
    """
    running, law = state.running, laws.read(state.laws, half)
    is_under_way = half == running.command
    age = running.age * par.sample_time
    length = where(is_under_way, running.age, law.length) * par.sample_time
    start = inputs.time - where(is_under_way, age, age + length)
    lead = where(half > 0.5, par.closing_lead, par.opening_lead)
    landing, shown = inputs.landing_time - start, inputs.smoothed_time - start
    has_landed = where((landing > 0.0) & (landing <= length), 1.0, 0.0)
    is_known = (has_landed > 0.0) | ((shown > lead) & (shown <= length))

    def known() -> State:
        heard = _impact_heard(state, law, has_landed, inputs, par)
        heard = heard._replace(laws=laws.write(state.laws, half, law._replace(is_judged=1.0)))
        by_model = state.by_model > 0.0
        return cond(by_model, lambda: _judged(heard, half, has_landed, landing, par), lambda: heard)

    return cond(is_known & (law.is_judged < 1.0) & (length > 0.0), known, lambda: state)


def _impact_heard(state: State, law: Law, has_landed: Scalar, inputs: Inputs, par: Parameters) -> State:
    """How well an operation was explained, and whether it landed harder than it was to."""
    is_good, is_soft = inputs.misfit < GOOD, law.was_plain < 1.0
    planned_speed = where(state.cycles < YOUNG, law.speed, par.approach_least)
    is_hard = inputs.estimated_impact_speed > HARD + TWICE * planned_speed
    is_hard = is_hard & is_soft & is_good & (has_landed > 0.0)
    fewer = where(state.landed_hard > FORGIVEN, state.landed_hard - FORGIVEN, 0.0)
    return state._replace(
        explained_well=where(is_good, state.explained_well + 1.0, 0.0),
        landed_hard=where(is_hard, state.landed_hard + 1.0, where(is_soft, fewer, state.landed_hard)),
        noted=state.noted._replace(hard=where(is_hard, 1.0, state.noted.hard)),
    )


def _judged(state: State, half: Scalar, has_landed: Scalar, landing: Scalar, par: Parameters) -> State:
    """What follows from a landing so long after the command, or from none: the next approach, a stronger hold."""
    law = laws.read(state.laws, half)
    plan, is_plain = planned(half, law.speed, law.travel, 0.0, par), law.was_plain > 0.0
    after = where(is_plain, 0.0, landing - plan.lead - arrival(plan))
    is_late = laws.is_late(has_landed, after, law)
    plain = law._replace(missed=where(has_landed > 0.0, 0.0, 1.0))
    law = cond(is_plain, lambda: plain, lambda: laws.judged(law, has_landed, is_late, par))
    return state._replace(
        laws=laws.write(state.laws, half, law),
        fell=where(is_late, 1.0, 0.0),
        is_strong=where(half > 0.0, 1.0 - has_landed, state.is_strong),
    )
