"""Soft landing from cycle to cycle: a flux linkage that the voltage follows, learnt from what the last cycles did.

An operation begins with its command.  The mover is to follow a path that ends slowly; the flux linkage that this needs
is the profile, and the voltage follows it with the integral of u - R i.  The first cycles are ordinary ones.  From a
contact three mechanical numbers of each kind of operation are learnt; without one the mover is that of an estimator,
which also tells afterwards what the loop's flux linkage was wrong by.  Approaches get slower as long as they arrive in
time.  After an operation that lands hard, or does not arrive, comes an ordinary cycle, and all is learnt afresh.
"""

from __future__ import annotations

import math

from gapsense.control import correction, learning
from gapsense.control.bend import watched
from gapsense.control.coil import first_coil, integrated, steadied
from gapsense.control.judging import judged_by_estimator, listened, warned
from gapsense.control.operations import turned
from gapsense.control.records import (
    BAD,
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
from gapsense.kernels.layout import Scalar, zeros
from gapsense.kernels.linalg import total, vector
from gapsense.kernels.trace import cond, fabs, where

FASTEST = 1e3  # impact speed that can be [m/s]
IDLE, LEARNING, TRACKING, SHORT, BACK, OPEN = 0.0, 1.0, 2.0, 3.0, 4.0, 5.0  # states


def initial(inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """Open, without flux; nothing happens before the first command."""
    learnt = vector([*believed(par), 0.0, 0.0, 0.0, 0.0])
    state = State(
        coil=first_coil(inputs, par),
        running=Running(
            command=OPENING,
            age=0.0,
            is_plain=1.0,
            start_flux=0.0,
            speed=par.approach_first,
            travel=par.opening_travel,
            learnt=learnt,
            balance_flux=0.0,
            wanted=0.0,
            limited=0.0,
            since_limit=0.0,
            due=0.0,
            is_judged=1.0,
            last_age=0.0,
            last_is_judged=1.0,
            strain=0.0,
        ),
        heard=Heard(last_mode=inputs.mode, began=0.0, takeoff=0.0, landing=0.0, hardest=0.0, hit=0.0),
        course=Pass(
            half=0.0, left=0.0, at=0.0, last=-1.0, landed=0.0, correction=0.0, impact=0.0, motion=vector([0.0] * 10)
        ),
        noted=NOTHING,
        explained=0.0,
        remembered=vector([*NOTHING]),
        warnings=0.0,
        laws=zeros(2 * LAW),
        fluxes=zeros(2 * LONGEST),
        profiles=zeros(2 * LONGEST),
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
        is_open=0.0,
        fell=0.0,
        alarm=0.0,
    )
    return state, _outputs(state, 0.0)


def step(state: State, inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """One sample: the loop, the next operation, the voltage until the next sample, and a piece of what is learnt."""
    running = state.running._replace(age=state.running.age + 1.0)
    coil, is_lost = integrated(state.coil, inputs, is_late(running, par), par)
    coil = cond(state.by_model > 0.0, lambda: steadied(coil, inputs, par), lambda: coil)
    noted = state.noted._replace(lost=where(is_lost, 1.0, state.noted.lost))
    state = state._replace(coil=coil, running=running, noted=noted)
    state = state._replace(heard=listened(state, inputs))
    is_command = (inputs.command > 0.5) | (inputs.command <= 0.5)  # else it is lost, and the last one goes on
    command = where(is_command, where(inputs.command > 0.5, CLOSING, OPENING), running.command)
    goes_on = command == running.command
    going = cond(is_lost, lambda: warned(state), lambda: state)
    state = cond(goes_on, lambda: going, lambda: turned(going, _readable(going, inputs), par))
    state, u = tracked(state, par)
    state = state._replace(coil=state.coil._replace(asked=u))
    state = state._replace(heard=watched(state, par))
    state = informed(state, inputs, par)
    return cond(state.by_model > 0.0, lambda: state, lambda: learning.worked(state, par)), _outputs(state, u)


def informed(state: State, inputs: Inputs, par: Parameters) -> State:
    """With what an estimator says of an operation, and of a sample in it, where it explains that."""
    readable = _readable(state, inputs)

    def believed() -> State:
        judged = judged_by_estimator(state, readable, par)
        return cond(judged.by_model > 0.0, lambda: correction.corrected(judged, readable, par), lambda: judged)

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
    return Inputs(*(where(says_numbers, new, none) for new, none in zip(inputs, silent)))._replace(
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
