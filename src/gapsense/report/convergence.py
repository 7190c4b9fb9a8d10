"""Tables and figure of how a run depends on its base step."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, TypeAlias

from gapsense.problems import listing, number_of
from gapsense.report.table import add_row, quantity, table

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.table import Table

Convergence: TypeAlias = Any  # of `cosim`, which shows itself by what is here, and so is not imported
MOST = 8  # signals in a figure
LEAST = 1e-12  # of the range: the least error that a figure shows


def tabulate(found: Convergence) -> list[Table | str]:
    """Tabulate what the command prints: errors, signals that do not converge, and what follows from both."""
    steps = [quantity(step, "s") for step in found.steps]
    errors = [t for t in found.judged if not t.is_same]
    title = f"Errors at a base step of {steps[0]}, from {len(steps)} runs down to {steps[-1]}"
    made = table(title, ("signal", "order", "error", "of nominal", "of range", "longest step"))
    for t in errors:
        order = "-" if t.order is None else f"{t.order:.2f}"
        shares = (format_percent(t.of_nominal), format_percent(t.of_range))
        step = "-" if t.step is None else f"{'>= ' * t.is_least}{quantity(t.step, 's')}"
        style = "red" if t in found.beyond else None
        add_row(made, t.signal, order, quantity(t.error, t.unit), *shares, step, style=style)
    others = [(t.signal, t.why, format_percent(t.changes[-1] / t.range)) for t in found.others]
    parts: list[Table | str] = [made] if errors else []
    parts += [table("Signals that do not converge", ("signal", "why", "last change"), others, 2)] if others else []
    return [*parts, *sentences(found)]


def sentences(found: Convergence) -> Iterator[str]:
    """What follows from the tables."""
    judged, allowed = found.judged, format_percent(found.tolerance)
    moved = [t for t in judged if t.at_edges > max(t.error, found.tolerance * t.range)]
    if same := [t.signal for t in found.signals.values() if t in judged and t.is_same and t not in moved]:
        yield f"The same at every step: {listing(same)}."
    if found.held:
        yield f"Sampled, at the same instants in every run: {listing(found.held)}."
    if moved:
        more = ", ".join(f"`{t.signal}` {quantity(t.at_edges, t.unit)}" for t in moved)
        yield f"Next to edges, which come up to a row earlier or later, differ: {more}."
    if found.stopped:
        yield f"Some signals still change: {found.stopped}."
    if not judged:
        yield "No signal converges."
        return
    within = len(judged) - len(found.beyond)
    yield f"{within} of {number_of(len(judged), 'signal')} that converge are within {allowed} of the range."
    if found.beyond and found.step:
        n = round(found.steps[0] / found.step)
        sampled = f", with `step` and `offset` of what is sampled times {n}," if found.held else ""
        yield f"`base_step = {found.step:.12g}`{sampled} keeps {allowed} in all of them."
    elif found.beyond:
        unknown = [t.signal for t in judged if t.step is None]
        yield f"No step that was tried keeps {allowed} in {listing(unknown)}: give more `--runs`."


def format_percent(share: float) -> str:
    """Write a share in percent, with two digits."""
    return f"{100.0 * share:.2g} %"


def figure(found: Convergence) -> Figure:
    """Errors as shares of the range over the base step, of the signals with the largest ones."""
    from gapsense.report.plot import FAINT, legend, panels

    made, axes = panels(found.title, 1)
    axis = axes[0, 0]
    steps = [1e6 * step for step in found.steps]
    for t in [t for t in found.judged if not t.is_same][:MOST]:
        axis.loglog(steps, [max(error / t.range, LEAST) for error in t.errors], "o-", linewidth=1.0, label=t.signal)
    axis.axhline(found.tolerance, color=FAINT, linewidth=1.0, linestyle="--", label="tolerance")
    axis.set_xticks(steps, [f"{step:.4g}" for step in steps])
    axis.minorticks_off()
    axis.set_xlabel("base step / us")
    axis.set_ylabel("error / range")
    legend(axis)
    return made
