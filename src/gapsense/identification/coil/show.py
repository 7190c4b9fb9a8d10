"""A coil for the user: its parameter set, tables and a figure, what was found and how well it explains the records."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from rich.table import Table

from gapsense.identification.coil.fit import POOR, Coil
from gapsense.identification.measurements.operations import mean_resistance, operations
from gapsense.identification.parameter_set import Entry, error_note, round_value, write_set
from gapsense.identification.residual import noises, verdict
from gapsense.identification.show import TWO_SIDED, Validation, about, validation
from gapsense.report.table import percent, quantity, table

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


def write_coil(file: Path, result: Coil, turns: float, sources: Sequence[Path]) -> Path:
    """Write a parameter-set file for scenarios, `gapsense build` and `gapsense estimate`; 0 turns are not known."""
    note = "" if turns else "not known: reluctances are over the turns squared"
    found = [Entry(PORTS[name].name, value, notes(result, name)) for name, value in values(result, turns).items()]
    entries = [
        *found,
        Entry("coil.turns", turns or 1.0, note),
        Entry("prior.inductance", result.inductance, error_note(result.inductance_error)),
        *(Entry(name, value) for name, value in tuning(result).items()),
    ]
    return write_set(
        file,
        "Coil without motion, identified",
        f"gapsense identify {' '.join(source.name for source in sources)}",
        [entry._replace(value=round_value(entry.value)) for entry in entries],
        assumed=[] if turns else ["coil.turns"],
    )


def values(result: Coil, turns: float = 0.0) -> dict[str, float]:
    """What was found, by field."""
    names = result.form.names
    return {name: float(getattr(result.parameters, name)) * (turns or 1.0) ** PORTS[name].power for name in names}


def coil_errors(result: Coil, turns: float) -> dict[str, float]:
    """Standard errors by parameter, in its unit."""
    found = values(result, turns)
    errors = {PORTS[name].name: error * found[name] for name, error in result.errors.items()}
    return errors | {"prior.inductance": result.inductance_error * result.inductance}


def notes(result: Coil, name: str) -> str:
    """Comment on a value."""
    if name in result.held:
        return "held: at a limit of the search"
    return error_note(result.errors[name], not result.errors[name] < POOR)


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
    }


HEADS = ("parameter", "value", "standard error", "95 % interval", "")
HIDES = 0.05  # of the largest current: in noise of 6 % the valve of 30 V moves unseen
ONE_TURN = (
    "`coil.turns` is assumed to be 1, since no record shows it: with other turns all reluctances go with their square."
)
SMALL = 0.01  # difference of resistances that a warm coil need not explain


def coil_tables(result: Coil, turns: float, checks: Sequence[Validation]) -> list[Table | str]:
    """What was found, how certain it is, and how it predicts the records that were not used for the fit."""
    told = about(*result.records, *(c.record for c in checks))
    after: list[Table | str] = [validation(checks), *warmth(result, checks)] if checks else []
    unknown = [] if turns else [ONE_TURN]
    return [forms(result), parameters(result, turns), residuals(result), *after, *remarks(result), *unknown, *told]


def forms(result: Coil) -> Table:
    """All forms that were tried."""
    heads, made = ("form", "parameters", "residual over noise", "penalised, above the least", ""), []
    for form, rms, against in result.tried:
        taken = "taken" if form is result.form else ""
        made.append((form.words, str(len(form.names)), f"{rms:.3f}", f"{against:.1f}", taken))
    return table("Forms of a coil without motion", heads, made)


def parameters(result: Coil, turns: float) -> Table:
    """Value and standard error of every parameter."""
    rows = [row("inductance without flux", result.inductance, "H", result.inductance_error)]
    for name, value in values(result, turns).items():
        rows.append(row(PORTS[name].name, value, PORTS[name].unit, result.errors.get(name)))
    heads = HEADS if any(row[-1] for row in rows) else HEADS[:-1]
    return table("Parameters", heads, [row[: len(heads)] for row in rows])


def row(name: str, value: float, unit: str, error: float | None) -> tuple[str, ...]:
    """One of them; without an error it is held."""
    if error is None:
        return name, quantity(value, unit), "", "", "held at a limit"
    interval = " to ".join(quantity(value * (1.0 + side * TWO_SIDED * error), unit) for side in (-1.0, 1.0))
    return name, quantity(value, unit), percent(error), interval, "" if error < POOR else "not identified"


def residuals(result: Coil) -> Table:
    """What the model leaves of each record."""
    rows = (
        (r.record, quantity(r.rms, "A"), f"{100.0 * r.rms / np.abs(x.current).max():.3g} %", quantity(r.noise, "A"))
        for r, x in zip(result.residuals, result.records)
    )
    return table("Residual of the current", ("record", "RMS", "of the largest current", "noise"), rows)


def remarks(result: Coil) -> list[str]:
    """Sentences: what moves, what the records do not tell, what the instruments hide."""
    said = [verdict(r, quantity(r.rms, "A"), quantity(r.limit, "A")) for r in result.residuals]
    if result.is_explained:
        said.insert(0, "No motion: a coil whose core stays where it is explains the current; no motion to identify.")
        said += [
            f"{r.record}: the noise is {100.0 * noise:.2g} % of the largest current, which may hide a motion."
            for r, x in zip(result.residuals, result.records)
            if (noise := r.noise / float(np.abs(x.current).max())) > HIDES
        ]
    if result.contrary:
        names = ", ".join(f"{by:.2g} of `{PORTS[name].name}`" for name, by in result.contrary.items())
        said.append(
            f"The records disagree beyond chance, so that errors are multiplied, by {names}. The usual cause is a"
            " saturation or a core loss of another kind, another temperature or another scale: identify each alone."
        )
    if result.convention:
        said.append(f"The voltage between two samples is best read as `{result.convention}`.")
    said += hidden(result)
    said += [
        f"`{PORTS[name].name}` is not identified: it ends at a limit of the search and is held there."
        for name in result.held
    ]
    return said + [
        f"`{PORTS[name].name}` is not identified: its standard error is {percent(result.errors[name])}. Do not rely on"
        " it."
        for name in result.poor
    ]


def hidden(result: Coil) -> list[str]:
    """Offsets that show only while the coil works."""
    said = [
        f"{record.name}: `{name}` is {quantity(-value, unit)} off during operation, which the steps of its"
        " converter hide at rest; the model allows for it."
        for record, offset in zip(result.records, result.offsets)
        for name, unit, value in zip(("voltage", "current"), "VA", offset)
        if value
    ]
    if result.balanced:
        said.append(
            "The steps of a converter may hide an offset. Estimators, which read its voltage as it is, begin with"
            f" {quantity(result.balanced, 'Ohm')} (`prior.resistance`), with which the flux linkage ends at zero, (23)."
        )
    return said


def warmth(result: Coil, checks: Sequence[Validation]) -> list[str]:
    """Records kept for the validation whose resistance differs."""
    said, R = [], float(np.median([mean_resistance(record) for record in result.records]))
    for check in checks:
        other = mean_resistance(check.record) if operations(check.record) else R
        if abs(other / R - 1.0) > SMALL:
            said.append(
                f"{check.record.name}: its resistance by (23) is {quantity(other, 'Ohm')},"
                f" {100.0 * (other / R - 1.0):+.1f} % beside the records fitted: a coil that is warmer or colder."
            )
    return said
