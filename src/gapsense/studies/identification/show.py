"""Tables and figures of an identification: what was found, how certain it is, how well the model fits."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from rich.table import Table

from gapsense.report.plot import FIRST, SECOND, TRUE, legend, line, stack
from gapsense.report.table import add_row, quantity
from gapsense.report.table import table as new_table
from gapsense.studies.identification.fit import POOR, Identified
from gapsense.studies.identification.model import Trajectory
from gapsense.studies.identification.record import Record
from gapsense.studies.identification.validation import Validation

NAMES = {
    "coil_turns": ("coil.turns", "1"),
    "core_reluctance": ("core.reluctance", "1/H"),
    "core_saturation": ("core.saturation", "Wb"),
    "spring_stiffness": ("spring.stiffness", "N/m"),
    "damping": ("damping", "N.s/m"),
    "mover_mass": ("mover.mass", "kg"),
    "coil_resistance": ("coil.resistance", "Ohm"),
}
TWO_SIDED = 1.96  # standard errors of a 95 % interval
STRONG = 0.95  # correlation from which two parameters can hardly be told apart


def parameters(result: Identified) -> Table:
    """Value and standard error of every parameter."""
    shown = new_table(
        "Parameters",
        (
            "parameter",
            "value",
            "standard error",
            "95 % interval",
            "",
        ),
    )
    for name, error in zip(result.names, result.uncertainty.relative.tolist()):
        label, unit = NAMES[name]
        value = float(getattr(result.parameters, name))
        interval = (quantity(value * (1.0 + side * TWO_SIDED * error), unit) for side in (-1.0, 1.0))
        note = "" if error < POOR else "not identified"
        add_row(shown, label, quantity(value, unit), f"{100.0 * error:.2g} %", " to ".join(interval), note)
    return shown


def correlations(result: Identified) -> Table:
    """Correlations of the errors."""
    names = [NAMES[n][0] for n in result.names]
    shown = new_table(
        "Correlations",
        (
            "",
            *(name.rpartition(".")[2] for name in names[:-1]),
        ),
    )
    for k, (name, row) in enumerate(zip(names[1:], result.uncertainty.correlation[1:].tolist()), 1):
        add_row(shown, name, *(f"{c:.2f}" if j < k else "" for j, c in enumerate(row[:-1])))
    return shown


def resistances(result: Identified, records: Sequence[Record]) -> Table:
    """Resistance of every period, (23)."""
    shown = new_table(
        "Resistance per period, (23)",
        (
            "record",
            "from",
            "to",
            "resistance",
        ),
    )
    for record, flux in zip(records, result.fluxes):
        for operation, R in zip(flux.operations, flux.resistances):
            begin, end = (f"{1e3 * record.times[k]:.6g} ms" for k in operation)
            add_row(shown, record.name, begin, end, quantity(float(R), "Ohm"))
    return shown


def remarks(result: Identified) -> list[str]:
    """Sentences: how the minimum was found, what the records do not tell."""
    said = [f"J = {result.cost:.4g} after {result.evaluations} simulations."]
    if result.starts:
        worse = len(result.starts) - result.agreeing
        others = f"; {worse} ended in worse ones, rejected by their cost" if worse else ""
        said.append(f"{result.agreeing} of {len(result.starts)} starts found this minimum{others}.")
    else:
        said.append("The multi-directional search converges slowly: compare with `--starts 1`.")
    for name in result.poor:
        k = result.names.index(name)
        error = 100.0 * float(result.uncertainty.relative[k])
        said.append(f"`{NAMES[name][0]}` is not identified: its standard error is {error:.2g} %. Do not rely on it.")
    for k, j in zip(*np.nonzero(np.tril(np.abs(result.uncertainty.correlation), -1) > STRONG)):
        a, b = NAMES[result.names[j]][0], NAMES[result.names[k]][0]
        said.append(f"`{a}` and `{b}` can hardly be told apart: their correlation is {_rho(result, k, j):.2f}.")
    return said


def _rho(result: Identified, k: int, j: int) -> float:
    return float(result.uncertainty.correlation[k, j])


def validation(checks: Sequence[Validation]) -> Table:
    """How well the model predicts records that were not used for the fit."""
    shown = new_table(
        "Validation, not used for the fit",
        (
            "record",
            "RMS error",
            "largest",
            "of the largest current",
        ),
    )
    for check in checks:
        share = f"{100.0 * check.rms / check.largest_current:.2g} %"
        add_row(shown, check.record.name, quantity(check.rms, "A"), quantity(check.largest, "A"), share)
    return shown


def figure(fitted: Sequence[tuple[Record, Trajectory, int]], checks: Sequence[Validation]) -> Figure:
    """Measured and simulated current of the records used, then of those kept for the validation.

    Parameters
    ----------
    fitted : sequence
        Record, what the model does, and the sample at which it begins.
    checks : sequence of Validation
        Validations, may be empty.
    """
    runs = [(r, m, k, "fit") for r, m, k in fitted] + [(c.record, c.model, c.first, "validation") for c in checks]
    labels = [label for _ in runs for label in ("voltage / V", "current / mA", "error / mA", "position\n/ mm")]
    drawn, axes = stack("Measured and identified", labels, [1.0, 2.0, 1.0, 1.0] * len(runs))
    for k, (record, model, first, kind) in enumerate(runs):
        _panels(axes[4 * k : 4 * k + 4], record, model, first, kind)
    return drawn


def _panels(axes: Sequence[Any], record: Record, model: Trajectory, first: int, kind: str) -> None:
    t = record.times[first:]
    axes[0].set_title(f"{record.name} ({kind})", loc="left", fontsize="medium")
    line(axes[0], record.times, record.voltage, TRUE)
    line(axes[1], record.times, 1e3 * record.current, TRUE, "measured")
    line(axes[1], t, 1e3 * model.current, SECOND, "model")
    line(axes[2], t, 1e3 * (record.current[first:] - model.current), SECOND)
    if record.position is not None:
        line(axes[3], record.times, 1e3 * record.position, TRUE, "recorded")
    line(axes[3], t, 1e3 * model.position, FIRST, "model")
    legend(axes[1])
    legend(axes[3])
