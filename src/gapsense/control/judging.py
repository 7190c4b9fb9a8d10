"""How an operation went: when the mover landed, by the contact or by an estimator, and what follows from it."""

from __future__ import annotations

from gapsense.control import laws
from gapsense.control.profile import arrival
from gapsense.control.records import BAD, Heard, Inputs, Parameters, State
from gapsense.control.tracking import planned
from gapsense.records import Scalar
from gapsense.trace import cond, not_, where

LOWER, MOVING, UPPER = 1.0, 2.0, 3.0  # modes
GOOD = 3.5  # misfit of a window that is solved well


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
    until = where(is_shown, inputs.smoothed_time, state.smoothed_until)
    noted = state.noted._replace(explained=where(is_shown, 1.0, state.noted.explained))
    state = state._replace(smoothed_until=until, noted=noted)
    now = state.running.command
    return _judged_if_known(_judged_if_known(state, 1.0 - now, inputs, par), now, inputs, par)


def _judged_if_known(state: State, half: Scalar, inputs: Inputs, par: Parameters) -> State:
    """The last operation of a kind, if it is not judged yet.

    Samples that are shown belong to a window that is solved: if there are any of the operation after its lead, and no
    landing in it, there was none.
    """
    running, law = state.running, laws.read(state.laws, half)
    is_under_way = half == running.command
    age = running.age * par.sample_time
    length = where(is_under_way, running.age, law.length) * par.sample_time
    start = inputs.time - where(is_under_way, age, age + length)
    lead = where(half > 0.5, par.closing_lead, par.opening_lead)
    landing, shown = inputs.landing_time - start, state.smoothed_until - start
    has_landed = where((inputs.misfit < BAD) & (landing > 0.0) & (landing <= length), 1.0, 0.0)
    is_known = (has_landed > 0.0) | ((shown > lead) & (shown <= length))

    def known() -> State:
        well = where(inputs.misfit < GOOD, state.explained_well + 1.0, 0.0)
        return _judged(state._replace(explained_well=well), half, has_landed, landing, par)

    return cond(is_known & (law.is_judged < 1.0) & (length > 0.0), known, lambda: state)


def _judged(state: State, half: Scalar, has_landed: Scalar, landing: Scalar, par: Parameters) -> State:
    """What follows from a landing so long after the command, or from none: the next approach, a stronger hold."""
    law = laws.read(state.laws, half)._replace(is_judged=1.0)
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
