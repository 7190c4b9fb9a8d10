"""What a component takes of a parameter set that was made for the solenoid valve.

Most names mean the same everywhere.  But the models of [RTS] have a gap law of their own, with the parameter
`gap.fringing`, R_g = R_g0 + R_g0' z / (1 + k_f z ln(c_f/z)), and estimators of the resistance start from priors.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy.optimize import least_squares

from gapsense.actuators.magnetics import MU_0, fringing
from gapsense.cosim.files import read_columns
from gapsense.cosim.parameters import read_parameters
from gapsense.cosim.problems import ScenarioError
from gapsense.cosim.tables import Value

Vector = npt.NDArray[np.float64]
GAP = ("gap.reluctance", "gap.slope", "gap.fringing", "gap.window")
GAPS = {
    "linear": ("gap.slope",),
    "fringing": ("gap.area", "gap.window"),
    "table": ("gap.file",),
}  # parameters of each law of the valve
AMBIGUOUS = ("gap.law", "gap.slope", "gap.window", "gap.file")  # of the valve and of [RTS]; not always the same
WINDOW = 20e-3  # c_f for a table, far above every gap [m]


def read_values(files: Sequence[Path]) -> dict[str, Value]:
    """Values of parameter-set files; what a later file says wins.  A ScenarioError tells all that is wrong."""
    problems: list[str] = []
    values = {name: value for file in files for name, value in read_parameters(file, problems).items()}
    if problems:
        raise ScenarioError(problems)
    return values


def values_for(names: Collection[str], values: Mapping[str, Value]) -> dict[str, Value]:
    """Values for a component with the parameters `names`; what else `values` has is left out."""
    known = {**priors(values), **values}
    if "gap.law" in values and ("gap.fringing" in values) != ("gap.fringing" in names):
        others = {name: value for name, value in known.items() if name not in AMBIGUOUS}
        known = others if "gap.fringing" in values else {**reduced_gap(values), **others}
    return {name: value for name, value in known.items() if name in names}


def reduced_gap(values: Mapping[str, Value]) -> dict[str, Value]:
    """The valve's gap law as [RTS] has it; a table is fitted."""
    missing = [name for name in GAPS[str(values["gap.law"])] if name not in values]
    if missing:
        raise ScenarioError([f"`gap.law` is `{values['gap.law']}`, but `{missing[0]}` is missing. Give both."])
    if values["gap.law"] == "linear":
        return {"gap.law": "fringing", "gap.reluctance": 0.0, "gap.slope": values["gap.slope"], "gap.fringing": 0.0}
    if values["gap.law"] == "fringing":
        area, window = float(values["gap.area"]), float(values["gap.window"])
        law = (0.0, 1.0 / (MU_0 * area), 1.0 / math.sqrt(area), 2.0 * window)
        return {"gap.law": "fringing", **dict(zip(GAP, law))}
    table = read_columns(Path(str(values["gap.file"])))
    law = fitted_gap(table["gap"].tolist(), table["reluctance"].tolist())
    return {"gap.law": "fringing", **dict(zip(GAP, law))}


def fitted_gap(gaps: list[float], reluctances: list[float]) -> tuple[float, float, float, float]:
    """R_g0, R_g0', k_f and c_f that come closest to a table of the gap reluctance."""
    largest = max(reluctances)
    target = np.array(reluctances) / largest

    def misfit(x: Vector) -> Vector:
        slope, k = np.exp(x[1:]).tolist()
        return np.asarray(x[0] + np.array([fringing(h, slope, k, WINDOW)[0] for h in gaps]) / largest - target)

    steepest = max((b - a) / (y - x) for a, b, x, y in zip(reluctances, reluctances[1:], gaps, gaps[1:]))
    found = least_squares(misfit, [target[0], math.log(steepest), math.log(200.0)]).x
    return float(found[0] * largest), math.exp(found[1]), math.exp(found[2]), WINDOW


def priors(values: Mapping[str, Value]) -> dict[str, Value]:
    """Expected resistance, and inductance at rest, N^2 / (R_gap(h_max) + R_iron0)."""
    known: dict[str, Value] = {}
    if "coil.resistance" in values:
        known["prior.resistance"] = values["coil.resistance"]
    if {"gap.law", "coil.turns", "core.reluctance", "stop.upper"} <= set(values) and "gap.fringing" not in values:
        law, h = reduced_gap(values), float(values["stop.upper"])
        k, window = float(law["gap.fringing"]), float(law.get("gap.window", WINDOW))
        R = float(law["gap.reluctance"]) + fringing(h, float(law["gap.slope"]), k, window)[0]
        known["prior.inductance"] = float(values["coil.turns"]) ** 2 / (R + float(values["core.reluctance"]))
    return known
