"""Tables and figures of an identification: what was found, how certain it is, how well the model fits."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from rich.table import Table

from gapsense.identification.assumptions import meanings, stated
from gapsense.identification.causes import CAUSES
from gapsense.identification.measurements.record import Record
from gapsense.identification.residual import verdict
from gapsense.identification.valve.drive import TAKEN
from gapsense.identification.valve.file import PORTS, found
from gapsense.identification.valve.form import FACTOR
from gapsense.identification.valve.identified import Identified
from gapsense.identification.valve.misfit import likely
from gapsense.identification.valve.model import Trajectory
from gapsense.identification.valve.validation import Validation
from gapsense.report.plot import FIRST, SECOND, TRUE, legend, line, stack, suited
from gapsense.report.table import quantity, table

SAME = 1.01  # ratio of the costs of starts that found the same minimum
TWO_SIDED = 1.96  # standard errors of a 95 % interval
WHAT = {"series": "series, while on", "drop": "drop, while off", "delay": "delay of the current"}
STRONG = 0.95  # correlation from which two parameters can hardly be told apart


def tables(result: Identified, records: Sequence[Record], checks: Sequence[Validation]) -> list[Table | str]:
    """What was found, how certain it is, and how it predicts the records that were not used for the fit."""
    shown = [resistances(result, records), *forms(result), *drive(result), parameters(result), correlations(result)]
    told = [text for record in (*records, *(check.record for check in checks)) for text in about(record)]
    return [*shown, *assumed(result), *([validation(checks)] if checks else []), *remarks(result), *told]


def assumed(result: Identified) -> list[Table | str]:
    """What was neither given nor found, how far its values may be off, and what that means."""
    names = {PORTS[name].name: name for name in result.assumed}
    if not names:
        return []
    rows = [
        (name, quantity(found(result, field), PORTS[field].unit), stated(name, result.assumed[field]))
        for name, field in names.items()
    ]
    heads = ("parameter", "assumed", "standard error")
    return [table("Assumed, neither given nor told by the records", heads, rows), *meanings(names)]


def about(record: Record) -> list[str]:
    """Sentences on what was done to a record, and on what is odd about it."""
    units = {"voltage": "V", "current": "A"}
    told = [
        f"{record.name}: `{name}` is {quantity(o.value, units[name])} +- {quantity(o.error, units[name])} at rest,"
        " before the first operation; this offset is subtracted."
        for name, o in record.offsets.items()
    ]
    return told + [f"{record.name}: {text}" for text in record.remarks]


def parameters(result: Identified) -> Table:
    """Value and standard error of every parameter."""
    rows = []
    for name, error in zip(result.names, result.uncertainty.relative.tolist()):
        unit, value = PORTS[name].unit, found(result, name)
        interval = (quantity(value * float(np.exp(side * TWO_SIDED * error)), unit) for side in (-1.0, 1.0))
        note = "not identified" if name in result.poor else ""
        rows.append((PORTS[name].name, quantity(value, unit), f"{100.0 * error:.2g} %", " to ".join(interval), note))
    for name in result.held:
        rows.append((PORTS[name].name, quantity(found(result, name), PORTS[name].unit), "", "", "not identified, held"))
    return table("Parameters", ("parameter", "value", "standard error", "95 % interval", ""), rows)


def forms(result: Identified) -> list[Table]:
    """The forms of the model that were tried, if any were beside the plain one."""
    rows = (
        (
            ", ".join(trial.form.added) or "plain",
            f"{len({*trial.form.fitted} - {FACTOR})}",
            quantity(trial.rms, "A"),
            f"{trial.evidence:.0f}" if trial.form.added else "",
            "taken" if trial.is_taken and trial.form.added else "",
        )
        for trial in result.trials
    )
    heads = ("form", "parameters", "residual", "evidence", "")
    return [table("Forms of the model, fitted to the first operations", heads, rows)] if result.trials[1:] else []


def labels(result: Identified) -> list[str]:
    """Names of what was fitted, in the order of the correlations."""
    return [*(PORTS[n].name for n in result.names), *(f"driver.{name}" for name in result.uncertainty.causes)]


def drive(result: Identified) -> list[Table]:
    """What was taken out of the recorded voltage, if anything was."""
    rows = []
    for name, value in result.drive.items():
        unit, error = TAKEN[name], result.uncertainty.causes.get(name)
        stated = "given" if error is None else quantity(error, unit)
        rows.append((WHAT[name], quantity(value, unit), stated))
    return [table("Taken out of the records", ("", "value", "standard error"), rows)] if rows else []


def correlations(result: Identified) -> Table:
    """Correlations of the errors."""
    names = labels(result)
    lower = (row[:k] for k, row in enumerate(result.uncertainty.correlation.tolist()))
    rows = [(name, *(f"{c:.2f}" for c in row)) for name, row in zip(names, lower)]
    return table("Correlations", ("", *(name.rpartition(".")[2] for name in names[:-1])), rows[1:])


def resistances(result: Identified, records: Sequence[Record]) -> Table:
    """Resistance of every period, (23)."""
    rows = (
        (record.name, *(f"{1e3 * record.times[k]:.6g} ms" for k in operation), quantity(float(R), "Ohm"))
        for record, flux in zip(records, result.fluxes)
        for operation, R in zip(flux.operations, flux.resistances)
    )
    return table("Resistance per period, (23)", ("record", "from", "to", "resistance"), rows)


def validation(checks: Sequence[Validation]) -> Table:
    """How well the model predicts records that were not used for the fit."""
    rows = (
        (c.record.name, quantity(c.rms, "A"), quantity(c.largest, "A"), f"{100.0 * c.rms / c.largest_current:.2g} %")
        for c in checks
    )
    heads = ("record", "RMS error", "largest", "of the largest current")
    return table("Validation, not used for the fit", heads, rows)


def remarks(result: Identified) -> list[str]:
    """Sentences: how the minimum was found, what the records do not tell."""
    said = [f"J = {result.cost:.4g} after {result.evaluations} simulations."]
    if result.starts:
        best = min(start.cost for start in result.starts)
        agreeing = sum(start.cost <= SAME * best for start in result.starts)
        worse = len(result.starts) - agreeing
        others = f"; {worse} ended in worse ones, rejected by their cost" if worse else ""
        said.append(f"{agreeing} of {len(result.starts)} starts found this minimum{others}.")
    else:
        said.append("The multi-directional search converges slowly: compare with `--starts 1`.")
    if result.convention:
        said.append(f"The voltage between two samples is best read as `{result.convention}`.")
    for r in result.residuals:
        said.append(verdict(r, quantity(r.rms, "A"), quantity(r.limit, "A")))
    said += explanations(result)
    for name in result.at_bounds:
        said.append(
            f"`{PORTS[name].name}` ends at a limit of the search, {result.form.limit(name):g} times its first guess:"
            " give a better one."
        )
    for name in result.held:
        value = quantity(found(result, name), PORTS[name].unit)
        said.append(f"`{PORTS[name].name}` is not identified: these records do not tell it. It is held at {value}.")
    for name in result.poor:
        error = 100.0 * float(result.uncertainty.relative[result.names.index(name)])
        said.append(f"`{PORTS[name].name}` is not identified: its standard error is {error:.2g} %. Do not rely on it.")
    rho, names = result.uncertainty.correlation, labels(result)
    for k, j in zip(*np.nonzero(np.tril(np.abs(rho), -1) > STRONG)):
        a, b = names[j], names[k]
        said.append(f"`{a}` and `{b}` can hardly be told apart: their correlation is {float(rho[k, j]):.2f}.")
    return said


def explanations(result: Identified) -> list[str]:
    """What else may explain what the model leaves, where that is too much; first what explains most of it."""
    shares = result.uncertainty.shares
    found = [
        f"{CAUSES[n].sentence} {quantity(shares[n].value, CAUSES[n].unit)} ({100.0 * shares[n].part:.0f} %)"
        for n in likely(shares)
    ]
    if result.is_explained or not found:
        return []
    return [f"What would explain most of it, beside other values of the parameters: {', or '.join(found)}."]


def measured_and_identified(result: Identified, records: Sequence[Record], checks: Sequence[Validation]) -> Figure:
    """Measured and simulated current of the records used, then of those kept for the validation."""
    firsts = (flux.operations[0].start for flux in result.fluxes)  # samples at which the models begin
    runs = [*zip(records, result.models, firsts, ["fit"] * len(records))]
    return measured_and_model("Measured and identified", runs, checks)


def measured_and_model(
    title: str, fitted: Sequence[tuple[Record, Trajectory, int, str]], checks: Sequence[Validation]
) -> Figure:
    """Records, models that begin at a sample, what they were for; then the validation."""
    runs = [*fitted, *((c.record, c.model, c.first, "validation") for c in checks)]
    scale = suited("current", "A", *(record.current for record, *_ in runs))
    errors = suited("error", "A", *(record.current[first:] - model.current for record, model, first, _ in runs))
    labels = ["voltage / V", scale[0], errors[0], "position\n/ mm"]
    figure, axes = stack(title, labels * len(runs), [1.0, 2.0, 1.0, 1.0] * len(runs))
    for k, run in enumerate(runs):
        _panels(axes[4 * k : 4 * k + 4], *run, scale[1], errors[1])
    return figure


def _panels(
    axes: Sequence[Any], record: Record, model: Trajectory, first: int, kind: str, scale: float, errors: float
) -> None:
    t = record.times[first:]
    axes[0].set_title(f"{record.name} ({kind})", loc="left", fontsize="medium")
    line(axes[0], record.times, record.voltage, TRUE)
    line(axes[1], record.times, scale * record.current, TRUE, "measured")
    line(axes[1], t, scale * model.current, SECOND, "model")
    line(axes[2], t, errors * (record.current[first:] - model.current), SECOND)
    if record.position is not None:
        line(axes[3], record.times, 1e3 * record.position, TRUE, "recorded")
    line(axes[3], t, 1e3 * model.position, FIRST, "model")
    legend(axes[1])
    legend(axes[3])
