"""A run with `Monitor`, and what it says of all faults: figures and tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure
from rich.table import Table

from gapsense.cosim import Result
from gapsense.estimators.monitor.signatures import CAUSES
from gapsense.report.plot import FIRST, SECOND, TRUE, legend_below, line, panels, require_recorded, shade
from gapsense.report.table import table

from .cases import CASES, Course
from .judge import Alarms, Span, shares

LABELS = ("position / mm", "strangeness", "evidence", "verdict")
VERDICTS = ("learning", "healthy", "worn", "faulty")
NEEDED = (
    *("actuator.position", "mhe.position", "monitor.strangeness", "monitor.verdict"),
    *(f"monitor.evidence_{cause}" for cause in CAUSES),
)
Found = Mapping[str, Sequence[Sequence[Span]]]


def run_figure(result: Result) -> Figure:
    """One run: what the mover does, how strange operations are, what speaks for which cause, the verdict."""
    require_recorded(result, NEEDED)
    figure, axes = panels(result.run.title, len(LABELS), 1, size=(9.0, 7.0), sharex=True)
    position, size, evidence, verdict = axes[:, 0]
    t = result.times
    line(position, t, 1e3 * result["actuator.position"], TRUE, "true")
    line(position, t, 1e3 * result["mhe.position"], FIRST, "Mhe")
    line(size, t, np.maximum(result["monitor.strangeness"], 0.1), FIRST)
    size.set(yscale="log", ylim=(0.1, 1e3))
    for cause in CAUSES:
        found = result[f"monitor.evidence_{cause}"]
        if found.max() > 0.1:
            line(evidence, t, found, SECOND if found.max() > 0.5 else FIRST, cause)
    if evidence.lines:
        evidence.legend(loc="upper left")
    line(verdict, t, result["monitor.verdict"], TRUE)
    verdict.set_yticks(range(len(VERDICTS)), VERDICTS)
    for axis, label in zip(axes[:, 0], LABELS):
        axis.set_ylabel(label)
        shade(axis, result)
    verdict.set_xlabel("time / ms")
    legend_below(figure)
    return figure


def cases_table(found: Found, course: Course) -> list[Table]:
    """A row for each fault and each span of it."""
    heads = ["fault", "lasts", "told in 3", "at the latest after", "right cause", "healthy again in 5", "median"]
    rows = []
    for name, devices in found.items():
        for n, (begin, end) in enumerate(course.spans):
            spans = [spans[n] for spans in devices]
            told, right, passed = shares(spans, CASES[name])
            latest, again = max(s.told for s in spans), float(np.median([s.passed for s in spans]))
            cells = [
                f"{100 * told:.0f} %",
                _operations(latest),
                f"{100 * right:.0f} %",
                f"{100 * passed:.0f} %",
                _operations(again),
            ]
            rows.append([name, f"{end - begin}", *cells])
    return [table("What Monitor says of faults; times in operations", heads, rows)]


def _operations(count: float) -> str:
    return f"{count:.0f}" if count < np.inf else "never"


def alarm_sentence(said: Alarms) -> str:
    """What was said of healthy devices."""
    return (
        f"{said.faults} false alarms in {said.operations} operations of healthy devices; {said.worn} were called worn."
    )


def causes_figure(found: Found, course: Course) -> Figure:
    """How often which cause was named at the end of the last span, in percent of the devices."""
    names = [*CAUSES, ""]
    counts = np.array(
        [[sum(s[-1].cause == cause for s in spans) / len(spans) for cause in names] for spans in found.values()]
    )
    begin, end = course.spans[-1]
    title = f"Causes that Monitor names after {end - begin} operations, in percent of the devices"
    figure, axes = panels(title, 1, 1, size=(9.0, 6.0))
    axis = axes[0, 0]
    axis.imshow(counts, cmap="Blues", vmin=0.0, vmax=1.0, aspect="auto")
    for (row, column), share in np.ndenumerate(counts):
        if share > 0.0:
            axis.text(
                column, row, f"{100 * share:.0f}", ha="center", va="center", color="white" if share > 0.5 else "black"
            )
    axis.set_xticks(range(len(names)), [*CAUSES, "none"], rotation=45, ha="right")
    axis.set_yticks(range(len(found)), [*found])
    axis.grid(False)
    return figure
