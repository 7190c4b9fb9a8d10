"""Soft landing from cycle to cycle: a flux linkage that the voltage follows, learnt from what the last cycles did.

An operation begins with its command.  The mover is to follow a path that ends slowly; the flux linkage that this needs
is the profile, and the voltage follows it with the integral of u - R i.  The first cycles are ordinary ones.  From a
contact three mechanical numbers of each kind of operation are learnt; without one the mover is that of an estimator,
which also tells afterwards what the loop's flux linkage was wrong by.  Approaches get slower as long as they arrive in
time.  After two operations in a row that do not arrive comes an ordinary cycle.
"""

from __future__ import annotations

import math

from gapsense.control import correction, learning
from gapsense.control.coil import can_be_used, first_coil, integrated
from gapsense.control.judging import judged_by_estimator, listened
from gapsense.control.operations import turned
from gapsense.control.records import (
    CLOSING,
    LAW,
    LONGEST,
    NOTHING,
    OPENING,
    Heard,
    Inputs,
    LawKind,
    Outputs,
    Parameters,
    Pass,
    Running,
    State,
)
from gapsense.control.tracking import believed, is_late, tracked
from gapsense.estimators.readings import can_be_read
from gapsense.linalg import total, vector
from gapsense.records import Scalar, zeros
from gapsense.trace import cond, fabs, where

FASTEST = 1e3  # impact speed that can be [m/s]
IDLE, LEARNING, TRACKING, SHORT, BACK = 0.0, 1.0, 2.0, 3.0, 4.0  # states


def initial(inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """Open, without flux; nothing happens before the first command."""
    learnt = vector([*believed(par), 0.0, 0.0, 0.0])
    plan = (0.0, par.approach_first, par.opening_travel)
    state = State(
        coil=first_coil(inputs, par),
        running=Running(OPENING, 0.0, 1.0, *plan, learnt, 0.0, 0.0, 0.0, 0.0, 0.0),
        heard=Heard(inputs.mode, 0.0, 0.0, 0.0),
        course=Pass(0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, vector([0.0] * 8)),
        noted=NOTHING,
        laws=zeros(2 * LAW),
        fluxes=zeros(2 * LONGEST),
        charges=zeros(2 * LONGEST),
        errors=zeros(2 * LONGEST),
        cycles=0.0,
        since_plain=0.0,
        explained_well=0.0,
        landed_hard=0.0,
        by_model=where(par.law == LawKind.model, 1.0, 0.0),
        first_mass=inputs.estimated_mass,
        smoothed_until=inputs.time,
        is_ready=0.0,
        is_strong=0.0,
        fell=0.0,
        warned=0.0,
    )
    return state, _outputs(state, 0.0)


def step(state: State, inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """One sample: the loop, the next operation, the voltage until the next sample, and a piece of what is learnt."""
    inputs = _readable(state, inputs)
    running = state.running._replace(age=state.running.age + 1.0)
    has_voltage, has_current = can_be_used(state.coil, inputs, par)
    noted = state.noted._replace(lost=where(has_voltage & has_current, state.noted.lost, 1.0))
    state = state._replace(
        coil=integrated(state.coil, inputs, is_late(running, par), par), running=running, noted=noted
    )
    state = state._replace(heard=listened(state, inputs))
    command = where(inputs.command > 0.5, CLOSING, OPENING)
    state = cond(command == running.command, lambda: state, lambda: turned(state, inputs, par))
    state, u = tracked(state, par)
    state = state._replace(coil=state.coil._replace(asked=u))
    state = judged_by_estimator(state, inputs, par)
    state = cond(
        state.by_model > 0.0,
        lambda: correction.corrected(state, inputs, par),
        lambda: learning.worked(state, par),
    )
    return state, _outputs(state, u)


def _readable(state: State, inputs: Inputs) -> Inputs:
    """A command that is lost goes on, an impact speed is not known; an estimator that says NaN says nothing."""
    said = inputs[Inputs._fields.index("estimated_flux_linkage") :]
    says_numbers = total(fabs(value) for value in said) < math.inf
    silent = inputs._replace(
        estimated_flux_linkage=state.coil.flux,
        misfit=math.inf,
        smoothed_published=0.0,
        estimated_resistance=0.0,
        estimated_mass=0.0,
    )
    is_command = (inputs.command > 0.5) | (inputs.command <= 0.5)
    return Inputs(*(where(says_numbers, new, none) for new, none in zip(inputs, silent)))._replace(
        command=where(is_command, inputs.command, state.running.command),
        impact_speed=where(can_be_read(inputs.impact_speed, FASTEST), inputs.impact_speed, 0.0),
    )


def _outputs(state: State, u: Scalar) -> Outputs:
    running = state.running
    ordinary = where(state.is_ready == 0.0, LEARNING, BACK)
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
        warnings=state.warned,
    )
