"""What identifications have in common: models beside records that were not used, remarks on records, the figure."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure
from rich.table import Table

from gapsense.identification.least_squares import rms
from gapsense.identification.measurements.record import Record, Vector
from gapsense.identification.valve.model import Trajectory
from gapsense.report.plot import FIRST, SECOND, TRUE, legend, line, scale_axis, stack
from gapsense.report.table import percent, quantity, table

STROKE = ", and with a stroke 1 % too large mass, stiffness and damping are 2 % too small"
TWO_SIDED = 1.96  # standard errors of a 95 % interval


class Validation(NamedTuple):
    """Model against measurement."""

    record: Record
    model: Trajectory  # from sample `first` on
    first: int  # the last sample at rest

    @property
    def error(self) -> Vector:
        """Of the model's current [A]."""
        return np.asarray(self.record.current[self.first :] - self.model.current)

    @property
    def rms(self) -> float:
        """The same."""
        return rms(self.error)


def about(*records: Record) -> Iterator[str]:
    """Sentences on what was done to records, and on what is odd about them."""
    units = {"voltage": "V", "current": "A"}
    for record in records:
        for name, o in record.offsets.items():
            yield (
                f"{record.name}: `{name}` is {quantity(o.value, units[name])} +- {quantity(o.error, units[name])} at"
                " rest, before the first operation; this offset is subtracted."
            )
        yield from (f"{record.name}: {text}" for text in record.remarks)


def say_what_is_exact(given: Collection[str], accuracy: Collection[str] = (), how: str = "") -> str:
    """Say what no residual tells and standard errors take for exact: scales, and values that were given."""
    values = [f"`{name}`" for name in given if name not in accuracy]
    scales = [f"the scale of the {name}" for name in ("voltage", "current") if name not in accuracy]
    if not (names := [*scales, *values]):
        return ""
    listed = ", ".join(names[:-1]) + f" and {names[-1]}" if names[1:] else names[0]
    return (
        f"The standard errors take {listed} for exact, for no record tells them: with a voltage 1 % too large the"
        f" resistance is 1 % too large{STROKE if values else ''}.{how}"
    )


def validation(checks: Sequence[Validation]) -> Table:
    """How well the model predicts records that were not used for the fit."""
    heads, rows = ("record", "RMS error", "largest", "of the largest current"), []
    for c in checks:
        most, size = float(np.abs(c.error).max()), float(np.abs(c.record.current).max())
        rows.append((c.record.name, quantity(c.rms, "A"), quantity(most, "A"), percent(c.rms / size)))
    return table("Validation, not used for the fit", heads, rows)


def measured_and_model(
    title: str, fitted: Sequence[tuple[Record, Trajectory]], checks: Sequence[Validation], shows_flux: bool = False
) -> Figure:
    """Records and models that end with them, then the validation: currents, and positions or else flux linkages."""
    runs = [*((*pair, "fit") for pair in fitted), *((c.record, c.model, "validation") for c in checks)]
    ends = ("position\n/ mm", 1e3)
    if shows_flux:
        ends = scale_axis("flux\nlinkage", "Wb", *(model.flux_linkage for _, model, _ in runs))
    scales = [
        scale_axis("current", "A", *(record.current for record, *_ in runs)),
        scale_axis("error", "A", *(record.current[-model.current.size :] - model.current for record, model, _ in runs)),
        ends,
    ]
    labels = ["voltage / V", *(label for label, _ in scales)]
    figure, axes = stack(title, labels * len(runs), [1.0, 2.0, 1.0, 1.0] * len(runs))
    for k, run in enumerate(runs):
        _panels(axes[4 * k : 4 * k + 4], *run, [factor for _, factor in scales], shows_flux)
    return figure


def _panels(
    axes: Sequence[Any], record: Record, model: Trajectory, kind: str, scales: Sequence[float], shows_flux: bool
) -> None:
    first = record.times.size - model.current.size
    t = record.times[first:]
    axes[0].set_title(f"{record.name} ({kind})", loc="left", fontsize="medium")
    line(axes[0], record.times, record.voltage, TRUE)
    line(axes[1], record.times, scales[0] * record.current, TRUE, "measured")
    line(axes[1], t, scales[0] * model.current, SECOND, "model")
    line(axes[2], t, scales[1] * (record.current[first:] - model.current), SECOND)
    if record.position is not None and not shows_flux:
        line(axes[3], record.times, scales[2] * record.position, TRUE, "recorded")
    line(axes[3], t, scales[2] * (model.flux_linkage if shows_flux else model.position), FIRST, "model")
    legend(axes[1])
    if not shows_flux:
        legend(axes[3])
