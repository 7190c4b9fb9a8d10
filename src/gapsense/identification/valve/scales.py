"""Which parameters of the valve have to be known, and first guesses in proportion to those that are."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from typing import Any

import numpy as np

from gapsense.actuators.magnetics import MU_0, fringing
from gapsense.actuators.solenoid_valve import GapLaw, Parameters
from gapsense.fmi.components import kernel_parameters, own
from gapsense.identification.valve.device import Device, value
from gapsense.identification.valve.form import FITTED, TABLE, Form

VALVE: Parameters = kernel_parameters(own("solenoid_valve"), {})  # [SEMERA] Table I
MECHANICS = ("stop_lower", "stop_upper", "spring_rest")
LAWS = {GapLaw.linear: ("gap_slope",), GapLaw.fringing: ("gap_area", "gap_window"), GapLaw.table: (TABLE[0],)}
BOUNCE = "stop_restitution"  # need not be given: what is left of the current shows a bounce


def needed(form: Form) -> tuple[str, ...]:
    """Fields that are held, and that no record tells."""
    law = LAWS[GapLaw(value(form.known, "gap_law"))] if form.law is None else ()
    return tuple(name for name in (*MECHANICS, *law, *FITTED) if name not in form.fitted)


def missing(form: Form, given: Collection[str]) -> list[str]:
    """Those of them that were not given."""
    return [name for name in needed(form) if name not in given]


def similar(par: Parameters, given: Collection[str]) -> Parameters:
    """What was given, with all else such that voltage and current are about those of the valve of [SEMERA] Table I.

    These stay the same where lengths are multiplied by s, mass, stiffness and damping by 1/s^2, and reluctances per
    gap by k, if the core is multiplied by k s and the turns by its square root.
    """
    return par._replace(**dict(_guesses(par, given)))


def _guesses(par: Parameters, given: Collection[str]) -> Iterator[tuple[str, Any]]:
    s = (par.stop_upper - par.stop_lower) / (VALVE.stop_upper - VALVE.stop_lower)
    rest = par.spring_rest if "spring_rest" in given else VALVE.spring_rest * s
    turns = par.coil_turns if "coil_turns" in given else VALVE.coil_turns * np.sqrt(s * _slope(par) / VALVE.gap_slope)
    preload = VALVE.spring_rest * s / rest if rest > par.stop_upper else 1.0
    guesses = {
        "spring_rest": rest,
        "initial_position": float(np.clip(rest, par.stop_lower, par.stop_upper)),
        "coil_turns": float(turns),
        "core_reluctance": VALVE.core_reluctance * float(turns / VALVE.coil_turns) ** 2,
        "spring_stiffness": VALVE.spring_stiffness * preload / s**2,
        "damping": VALVE.damping / s**2,
        "mover_mass": VALVE.mover_mass / s**2,
    }
    yield from ((name, guess) for name, guess in guesses.items() if name not in given)


def _slope(par: Parameters) -> float:
    """Of the gap reluctance, mean over the stroke [1/(H m)]."""
    if par.gap_law == GapLaw.linear:
        return float(par.gap_slope)
    ends = np.array([par.stop_lower, par.stop_upper])
    if par.gap_law == GapLaw.table:
        R = np.interp(ends, par.gap_file_gap, par.gap_file_reluctance)
    else:
        r0, k = 1.0 / (MU_0 * par.gap_area), par.gap_area**-0.5
        R = np.array([fringing(h, r0, k, 2.0 * par.gap_window)[0] for h in ends.tolist()])
    return float(np.diff(R)[0] / np.diff(ends)[0])


def values(par: Device, names: Collection[str]) -> Mapping[str, float]:
    """Values of fields."""
    return {name: float(value(par, name)) for name in names}
