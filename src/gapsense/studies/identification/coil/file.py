"""Parameter set of a coil, for estimators that need no model of a device."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from gapsense.files import write_atomically
from gapsense.studies.identification.coil.fit import POOR, Coil
from gapsense.studies.identification.noise import noises
from gapsense.studies.identification.record import Record

EDGE = 0.25  # of the largest voltage: more begins an operation


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
    lines = [
        'description = "Coil without motion, identified"',
        f"source = {json.dumps('gapsense identify ' + ' '.join(source.name for source in sources))}",
        "",
        "[values]",
        *(line(PORTS[name].name, value, told(result, name)) for name, value in values(result, turns).items()),
        line("coil.turns", turns or 1.0, note),
        line("prior.inductance", result.inductance, f"  # +- {100.0 * result.inductance_error:.2g} %"),
        *(line(name, value, "") for name, value in tuning(result.records).items()),
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


def tuning(records: Sequence[Record]) -> dict[str, float]:
    """What estimators know of the measurement: its noise, and the voltage that begins an operation."""
    largest = min(float(np.abs(record.voltage).max()) for record in records)
    return {**noises(records), "edge.voltage": EDGE * largest}
