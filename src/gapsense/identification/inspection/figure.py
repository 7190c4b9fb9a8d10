"""Figure of a record: the whole of it, and its first operation, with what was found in it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from gapsense.identification.inspection.facts import Facts
from gapsense.identification.measurements.flux import estimate
from gapsense.identification.measurements.record import Record, Vector
from gapsense.report.plot import FAINT, FIRST, GRID, SECOND, THIRD, TRUE, panels, suited

POINTS = 2000  # of a curve; more are drawn as the span of each of its parts
BEFORE, AFTER = 0.05, 0.02  # of the length of an operation, that are shown beside it
MARKS: dict[str, tuple[str, Any]] = {
    "begins": (FAINT, "-"),
    "ends": (FAINT, ":"),
    "closes": (SECOND, "--"),
    "opens": (THIRD, "--"),
}
MOST = 20  # operations in sight; of more none is marked


def figure_of(records: Sequence[Record], found: Sequence[Facts]) -> Figure:
    """Three rows for each record: voltage, current and flux linkage."""
    size, title = (10.0, 0.6 + 4.2 * len(records)), records[0].name if len(records) == 1 else ""
    figure, axes = panels(title, 3 * len(records), 2, size, sharex=False, width_ratios=[1.0, 1.0])
    for k, (record, facts) in enumerate(zip(records, found)):
        draw(axes[3 * k : 3 * k + 3], record, facts, record.name if len(records) > 1 else "")
    figure.align_ylabels(axes[:, 0])
    marks = [Line2D([], [], color=color, linestyle=style) for color, style in MARKS.values()]
    figure.legend(
        [Patch(color=GRID, alpha=0.6), *marks], ["at rest", *MARKS], loc="outside lower center", ncols=5, frameon=False
    )
    return figure


def draw(axes: Any, record: Record, found: Facts, title: str) -> None:
    """One record."""
    flux = np.zeros(record.times.size)
    if found.pulses:
        flux = estimate(record, [p.operation for p in found.pulses]).flux_linkage
    names = (("voltage", "V", record.voltage), ("current", "A", record.current), ("flux linkage", "Wb", flux))
    axes[0, 0].set_title(f"{title}: all" if title else "all of it", loc="left", fontsize="medium")
    axes[0, 1].set_title("first operation" if found.pulses else "its beginning", loc="left", fontsize="medium")
    for row, panel, color in zip(axes, names, (TRUE, TRUE, FIRST)):
        label, scale = suited(*panel)
        row[0].set_ylabel(label.replace("flux linkage", "flux\nlinkage"))
        for axis, part in zip(row, (slice(None), shown(record, found))):
            curve(axis, record.times[part], scale * panel[2][part], color)
            mark(axis, record, found, *axis.get_xlim())
    for axis in axes[2]:
        axis.set_xlabel("time / ms")


def shown(record: Record, found: Facts) -> slice:
    """The first operation, with some of what is around it."""
    if not found.pulses:
        return slice(0, max(2, record.times.size // 4))
    first = found.pulses[0].operation
    length = first.stop - first.start
    return slice(max(0, first.start - round(BEFORE * length)), first.stop + round(AFTER * length) + 1)


def curve(axis: Any, times: Vector, x: Vector, color: str) -> None:
    """A signal; a long one as the span of its values."""
    if x.size <= 2 * POINTS:
        axis.plot(1e3 * times, x, color=color, drawstyle="steps-post", linewidth=1.0)
        return
    step = -(-x.size // POINTS)
    whole = x.size // step * step
    parts = x[:whole].reshape(-1, step)
    ends = np.stack((parts.min(axis=1), parts.max(axis=1)), axis=1).ravel()
    axis.plot(1e3 * np.repeat(times[:whole:step], 2), ends, color=color, linewidth=0.8)


def mark(axis: Any, record: Record, found: Facts, left: float, right: float) -> None:
    """Rest, beginnings of operations, and kinks, as far as they are in sight."""
    t = 1e3 * record.times
    if found.is_from_rest:
        axis.axvspan(t[0], t[max(found.rest - 1, 0)], color=GRID, alpha=0.6, linewidth=0.0)
    here = [p for p in found.pulses if left < t[p.operation.stop] and t[p.operation.start] < right]
    for p in here if len(here) <= MOST else []:
        kinks = [1e3 * kink.end if kink else None for kink in (p.closing, p.opening)]
        places = [*(t[k] for k in p.operation), *kinks]
        for (color, style), at in zip(MARKS.values(), places):
            if at is not None:
                axis.axvline(at, color=color, linewidth=1.0, linestyle=style)
    axis.set_xlim(left, right)
