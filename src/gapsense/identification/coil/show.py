"""Tables and a figure of a coil: which form the evidence is for, what was found, how well it explains the records."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from rich.table import Table

from gapsense.identification.coil.file import PORTS, values
from gapsense.identification.coil.fit import POOR, Coil
from gapsense.identification.measurements.flux import mean_resistance
from gapsense.identification.measurements.operations import operations
from gapsense.identification.measurements.record import Record
from gapsense.identification.residual import verdict
from gapsense.identification.valve.model import Trajectory
from gapsense.identification.valve.show import TWO_SIDED, about, validation
from gapsense.identification.valve.validation import Validation
from gapsense.report.plot import FIRST, SECOND, TRUE, legend, line, stack, suited
from gapsense.report.table import quantity, table

HEADS = ("parameter", "value", "standard error", "95 % interval", "")
HIDES = 0.05  # of the largest current: in noise of 6 % the valve of 30 V moves unseen
ONE_TURN = (
    "`coil.turns` is assumed to be 1, for no record tells it: with other turns all reluctances go with their square."
)
SMALL = 0.01  # difference of resistances that a warm coil need not explain


def tables(result: Coil, turns: float, checks: Sequence[Validation]) -> list[Table | str]:
    """What was found, how certain it is, and how it predicts the records that were not used for the fit."""
    told = [text for record in (*result.records, *(c.record for c in checks)) for text in about(record)]
    after: list[Table | str] = [validation(checks), *warmth(result, checks)] if checks else []
    unknown = [] if turns else [ONE_TURN]
    return [forms(result), parameters(result, turns), residuals(result), *after, *remarks(result), *unknown, *told]


def forms(result: Coil) -> Table:
    """All forms that were tried."""
    rows = (
        (
            tried.form.words,
            str(len(tried.form.names)),
            f"{tried.rms:.3f}",
            f"{tried.against:.1f}",
            "taken" if tried.form is result.form else "",
        )
        for tried in result.tried
    )
    heads = ("form", "parameters", "residual over noise", "penalised, above the least", "")
    return table("Forms of a coil without motion", heads, rows)


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
    return name, quantity(value, unit), f"{100.0 * error:.2g} %", interval, "" if error < POOR else "not identified"


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
            f"{r.record}: the noise is {100.0 * noise:.2g} % of the largest current, in which a motion may be hidden."
            for r, x in zip(result.residuals, result.records)
            if (noise := r.noise / float(np.abs(x.current).max())) > HIDES
        ]
    if result.convention:
        said.append(f"The voltage between two samples is best read as `{result.convention}`.")
    said += hidden(result)
    said += [
        f"`{PORTS[name].name}` is not identified: it ends at a limit of the search and is held there."
        for name in result.held
    ]
    return said + [
        f"`{PORTS[name].name}` is not identified: its standard error is {100.0 * result.errors[name]:.2g} %."
        " Do not rely on it."
        for name in result.poor
    ]


def hidden(result: Coil) -> list[str]:
    """Offsets that show only while the coil works."""
    said = [
        f"{record.name}: `{name}` is {quantity(-value, unit)} off while the coil works, which the steps of its"
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


def measured_and_identified(result: Coil, checks: Sequence[Validation]) -> Figure:
    """Measured and simulated current of the records used, then of those kept for the validation."""
    runs = [(r, m, "fit") for r, m in zip(result.records, result.models)]
    runs += [(c.record, c.model, "validation") for c in checks]
    scales = [
        suited("current", "A", *(record.current for record, *_ in runs)),
        suited("error", "A", *(record.current[-m.current.size :] - m.current for record, m, _ in runs)),
        suited("flux\nlinkage", "Wb", *(m.flux_linkage for _, m, _ in runs)),
    ]
    labels = ["voltage / V", *(label for label, _ in scales)]
    figure, axes = stack("Measured and identified", labels * len(runs), [1.0, 2.0, 1.0, 1.0] * len(runs))
    for k, run in enumerate(runs):
        _panels(axes[4 * k : 4 * k + 4], *run, [factor for _, factor in scales])
    return figure


def _panels(axes: Sequence[Any], record: Record, model: Trajectory, kind: str, scales: Sequence[float]) -> None:
    first = record.times.size - model.current.size
    t = record.times[first:]
    axes[0].set_title(f"{record.name} ({kind})", loc="left", fontsize="medium")
    line(axes[0], record.times, record.voltage, TRUE)
    line(axes[1], record.times, scales[0] * record.current, TRUE, "measured")
    line(axes[1], t, scales[0] * model.current, SECOND, "model")
    line(axes[2], t, scales[1] * (record.current[first:] - model.current), SECOND)
    line(axes[3], t, scales[2] * model.flux_linkage, FIRST, "model")
    legend(axes[1])
