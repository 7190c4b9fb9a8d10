"""Parameter set of a coil, for estimators that need no model of a device."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from gapsense._os.files import write_atomically
from gapsense.identification.assumptions import marks
from gapsense.identification.coil.fit import POOR, Coil
from gapsense.identification.noise import noises

EDGE = 0.25  # of the largest voltage: more begins an operation
RANGE = 2.0  # times the largest reading: more counts as lost
CERTAIN = {"resistance": 0.01, "inductance": 0.05}  # deviations that estimators begin with, at least


class Port(NamedTuple):
    """How components call a field of the device."""

    name: str
    unit: str
    power: int = 0  # of the turns by which it is multiplied


PORTS = {
    "resistance": Port("coil.resistance", "Ohm"),
    "air": Port("gap.reluctance", "1/H", 2),
    "core": Port("core.reluctance", "1/H", 2),
    "saturation": Port("core.saturation", "Wb"),
    "eddy": Port("core.eddy", "S"),
    "hysteresis": Port("core.hysteresis", "A"),
    "turnover": Port("core.turnover", "Wb"),
}


def write(file: Path, result: Coil, turns: float, sources: Sequence[Path]) -> Path:
    """Write a parameter-set file for scenarios, `gapsense build` and `gapsense estimate`; 0 turns are not known."""
    note = "" if turns else "  # not known: reluctances are over the turns squared"
    unknown = [] if turns else ["coil.turns"]
    lines = [
        'description = "Coil without motion, identified"',
        f"source = {json.dumps('gapsense identify ' + ' '.join(source.name for source in sources))}",
        *marks(unknown),
        "",
        "[values]",
        *(line(PORTS[name].name, value, told(result, name)) for name, value in values(result, turns).items()),
        line("coil.turns", turns or 1.0, note),
        line("prior.inductance", result.inductance, f"  # +- {100.0 * result.inductance_error:.2g} %"),
        *(line(name, value, "") for name, value in tuning(result).items()),
    ]
    file.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(file, lambda out: out.writelines(f"{text}\n" for text in lines))
    return file


def values(result: Coil, turns: float = 0.0) -> dict[str, float]:
    """What was found, by field."""
    names = result.form.names
    return {name: float(getattr(result.parameters, name)) * (turns or 1.0) ** PORTS[name].power for name in names}


def told(result: Coil, name: str) -> str:
    """Comment on a value."""
    if name in result.held:
        return "  # held: at a limit of the search"
    error = result.errors[name]
    return f"  # +- {100.0 * error:.2g} %" + ("" if error < POOR else ", not identified")


def line(name: str, value: float, note: str) -> str:
    """A value with a comment."""
    return f"{json.dumps(name)} = {float(f'{value:.8g}')!r}{note}"


def tuning(result: Coil) -> dict[str, float]:
    """What estimators know of the coil and of the measurement; the first deviations are for the coil of another day."""
    volts, amperes = ([getattr(record, name) for record in result.records] for name in ("voltage", "current"))
    R, R_error = result.balanced or float(result.parameters.resistance), result.errors.get("resistance", 1.0)
    return {
        **({"prior.resistance": R} if result.balanced else {}),
        "prior.resistance_std": R * max(CERTAIN["resistance"], 0.0 if result.balanced else R_error),
        "prior.inductance_std": result.inductance * max(CERTAIN["inductance"], result.inductance_error),
        **noises(result.records),
        "range.voltage": RANGE * max(float(np.abs(x).max()) for x in volts),
        "range.current": RANGE * max(float(np.abs(x).max()) for x in amperes),
        "edge.voltage": EDGE * min(float(np.abs(x).max()) for x in volts),
    }
