"""Tables of runs and sweeps, and of what can be run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from textwrap import fill
from typing import TYPE_CHECKING

from rich.table import Table

from gapsense.problems import number_of
from gapsense.report.table import add_row, quantity, table
from gapsense.tables import is_number

if TYPE_CHECKING:
    from gapsense.cosim import Growth, Outcome, Result, Scenario, Sweep
    from gapsense.cosim.fmu.facts import Facts
    from gapsense.cosim.result.result import Timing
    from gapsense.fmi.ports import Component
    from gapsense.tables import Value

WITHOUT_C = "The loop in C cannot be loaded here; the one in Python takes about 2 us more per component and step."
MOST_GROUPS = 12  # combinations of swept values that a table shows
UNREAD = "cannot be read: see `gapsense check`"


def metrics(result: Result) -> list[Table]:
    """Metrics of a run, grouped as the scenario says, beside published values."""
    made: dict[str, Table] = {}
    for m in result.metrics.values():
        shown = made.setdefault(m.table, table(m.table or "Metrics", ("metric", "published", "this run", "bounds")))
        bounds = "" if m.bounds is None else " to ".join(quantity(b, m.unit) for b in m.bounds)
        cells = (m.label, format_published(m.published, m.unit), quantity(m.value, m.unit), bounds)
        add_row(shown, *cells, style=None if m.passed else "red")
    return list(made.values())


def events(result: Result) -> list[Table]:
    """When events were on, if any were."""
    ends = ("to the end" if span.end is None else quantity(span.end, "s") for span in result.events)
    rows = [(s.name, s.target, s.action, quantity(s.begin, "s"), end) for s, end in zip(result.events, ends)]
    return [table("Events", ("event", "target", "action", "from", "until"), rows, texts=3)] if rows else []


def sweep(scenario: Scenario, swept: Sweep) -> list[Table]:
    """Median and 5-95 % range of each metric beside the published value and the first run."""
    if not swept.indices:
        return []
    if len(groups := group_rows(swept)) > 1:
        return by_value(scenario, swept, groups)
    quantiles = swept.quantiles()
    runs, first_run = ("runs", "first run") if swept.grid else ("seeds", "first seed")
    made: dict[str, Table] = {}
    for metric in scenario.metrics:
        title = f"{metric.table or 'Metrics'}, {len(swept.indices)} {runs}"
        shown = made.setdefault(title, table(title, ("metric", "published", first_run, "median", "5 %", "95 %")))
        unit = swept.units.get(metric.name, "")
        low, median, high = (quantity(v, unit) for v in quantiles[metric.name])
        first = quantity(float(swept.metrics[metric.name][0]), unit) if swept.indices[0] == 0 else "-"
        add_row(shown, metric.label, format_published(metric.published, unit), first, median, low, high)
    return list(made.values())


def group_rows(swept: Sweep) -> dict[tuple[Value, ...], list[int]]:
    """Group the rows of runs that have the same swept values: they differ in their seeds only."""
    found: dict[tuple[Value, ...], list[int]] = {}
    for row, values in enumerate(zip(*swept.grid.values())):
        found.setdefault(values, []).append(row)
    return found


def by_value(scenario: Scenario, swept: Sweep, groups: Mapping[tuple[Value, ...], list[int]]) -> list[Table]:
    """Median and 5-95 % range of each metric for each of the first combinations of swept values."""
    import numpy as np  # here, so that commands start fast

    made: dict[str, Table] = {}
    heads = ("metric", *swept.grid, "runs", "median", "5 %", "95 %")
    left = f"; {len(groups) - MOST_GROUPS} more combinations are in the CSV" if len(groups) > MOST_GROUPS else ""
    for metric in scenario.metrics:
        title = f"{metric.table or 'Metrics'}, {len(swept.indices)} runs{left}"
        shown = made.setdefault(title, table(title, heads, texts=1 + len(swept.grid)))
        unit, column = swept.units.get(metric.name, ""), swept.metrics[metric.name]
        for values, rows in list(groups.items())[:MOST_GROUPS]:
            pairs = [(value, swept.units.get(name, "")) for name, value in zip(swept.grid, values)]
            given = (f"{v:.9g} {of}".strip() if is_number(v) else str(v) for v, of in pairs)  # as they were given
            low, median, high = (quantity(float(v), unit) for v in np.quantile(column[rows], (0.05, 0.5, 0.95)))
            add_row(shown, metric.label, *given, str(len(rows)), median, low, high)
    return list(made.values())


def format_published(value: float | None, unit: str) -> str:
    """Write a published value, or nothing."""
    return "" if value is None else quantity(value, unit)


BOARD = (
    *("component", "board", "numbers", "count of a step, mean", "99 %", "most", "load, mean", "load, most"),
    *("records / byte", "stack / byte", "RAM / byte", "flash / byte", "difference from the FMU"),
)


def boards(result: Result) -> list[Table]:
    """What components on boards took there, if there are any."""
    units = ", ".join(sorted({board["unit"] for board in result.run.boards.values()}))
    title = f"Boards: {units} per step; load is their share of the sample time, one in a cycle"
    return [table(title, BOARD, board_rows(result), texts=3)] if result.run.boards else []


def board_rows(result: Result) -> list[tuple[str, ...]]:
    """A row for each component on a board, and one for each board that several components share."""
    rows: list[tuple[str, ...]] = []
    shared: dict[str, list[list[float]]] = {}
    for name, of in result.run.boards.items():
        counts = [three(count) for count in of["counts"]] or ["-"] * 3
        loads = [count / (of["clock"] * of["period"]) for count in of["counts"][::2]] if of["clock"] else []
        shared.setdefault(of["board"], []).append(loads)
        sizes = (f"{of[key]:,}" if of[key] else "-" for key in ("memory", "stack", "ram", "flash"))
        rows.append((name, of["board"], of["real"], *counts, *shares(loads), *sizes, farthest(of["difference"])))
    for board, all_loads in shared.items():
        if len(all_loads) > 1:
            rows.append(("together", board, "", "", "", "", *shares([sum(loads) for loads in zip(*all_loads)])))
    return rows


def shares(loads: Sequence[float]) -> list[str]:
    """Mean and largest load in percent, if a clock is known."""
    return [f"{100.0 * load:.3g} %" for load in loads] or ["-", "-"]


def farthest(differences: Mapping[str, Sequence[float]]) -> str:
    """The output that differs most from that of the FMU, of its largest value."""
    name, (worst, largest) = max(differences.items(), key=lambda one: one[1][0] / (one[1][1] or 1.0))
    return f"{name} {worst:.1e} of {largest:.2g}" if worst else "none"


def timing(result: Result) -> Table:
    """Time of each component, and the whole run against real time."""
    span = result.times[-1] - result.times[0]
    title = f"{result.wall:.3f} s for {span:.4g} s: real-time factor {result.realtime_factor:.3g}"
    if result.run.versions.get("loop") == "Python" and result.run.method != "iterative":  # of older results
        title += f"\n{WITHOUT_C}"
    rows = (
        (name, str(t.calls), *per_step(t), f"{100 * t.seconds / result.wall:.0f} %")
        for name, t in result.timing.items()
    )
    return table(title, ("component", "steps", "us per step", "median", "longest", "share"), rows)


def loops(result: Result) -> list[Table]:
    """How often the loops were evaluated that are solved in every step."""
    rows = [(n, str(i.steps), three(i.mean), str(i.most), quantity(i.at, "s")) for n, i in result.run.loops.items()]
    heads = ("loop of", "steps", "mean", "most", "at")
    return [table("Evaluations of loops, per step", heads, rows)] if rows else []


def steps(result: Result) -> list[Table]:
    """How long the steps were that were controlled, and how many were too long."""
    if (s := result.run.steps) is None:
        return []
    lengths = (quantity(value, "s") for value in (s.shortest, s.longest))
    cells = (str(s.done), *lengths, str(s.rejected), str(s.beyond), f"{s.worst:.2g}", s.of, quantity(s.at, "s"))
    heads = ("steps", "shortest", "longest", "too long", "beyond", "worst", "of", "at")
    return [table("Steps, of which pairs are checked by one of twice the length", heads, [cells], texts=0)]


def per_step(of: Timing) -> tuple[str, str, str]:
    """Mean, median and longest time of a step in microseconds; older results have but the first."""
    median, longest = ("-" if value is None else three(1e6 * value) for value in (of.median, of.longest))
    return three(of.microseconds), median, longest


def three(value: float) -> str:
    """A number with three digits, or with all digits before the point."""
    return f"{value:.{2 if value < 9.995 else 1 if value < 99.95 else 0}f}"


def components(found: Sequence[Component], built: set[str]) -> Table:
    """Components and what they do."""
    rows = (
        (c.name, "yes" if c.name in built else "no", f"{len(c.of('input'))}, {len(c.of('output'))}", c.description)
        for c in found
    )
    return table("Components", ("name", "built", "in, out", "what it is"), rows, texts=4)


def facts(of: Facts) -> list[Table | str]:
    """What an FMU is, and its variables; columns that say nothing are left out."""
    heads = ("name", "unit", "start", "range", "description")
    said = ". ".join(filter(None, (of.name, of.description.rstrip("."), f"{of.origin}.")))
    made: list[Table | str] = [fill(said, 80)]
    for title, lines in of.groups.items():
        used = [k for k, head in enumerate(heads) if head == "name" or any(line[k] for line in lines)]
        rows = ([line[k] for k in used] for line in lines)
        made.append(table(title, [heads[k] for k in used], rows, texts=len(heads)))
    if of.others:
        made.append(f"{of.others} more {'variable is' if of.others == 1 else 'variables are'} local or calculated.")
    return made


def scenarios(title: str, found: Mapping[str, Scenario | None]) -> Table:
    """Scenarios by what you type to run them, with their variants; None stands for one that cannot be read."""
    rows = [(name, s.title, ", ".join(s.variants) or "-") if s else (name, UNREAD, "") for name, s in found.items()]
    return table(title, ("name", "what it is", "variants"), rows, texts=3)


def growths(found: Sequence[Growth]) -> Table:
    """How a small change grows in the signals of a baseline, the most sensitive ones first."""
    from gapsense.cosim.sensitivity import PERTURBATION

    rows = ((g.signal, f"{g.amplification:.3g}", f"{g.change:.3g}", f"{g.allowed:.3g}", g.unit) for g in found)
    heads = ("signal", "amplification", "change", "allowed", "unit")
    return table(f"Change of the signals when all numbers change by {PERTURBATION:g}", heads, rows)


def outcome(tested: Outcome) -> str:
    """One line for a scenario that passed, one more for each failure."""
    word = "passed" if tested.passed else "FAILED"
    remark = f", {tested.remark}" if tested.remark else ""
    checks = number_of(len(tested.checks), "check")
    head = f"{word}  {tested.scenario}  {checks}, {tested.seconds:.1f} s{remark}"
    coarse = tested.result.run.remarks if tested.result else ()
    failures = (f"  {c.name}: {c.failure}".replace("\n", "\n    ") for c in tested.failures)
    return "\n".join([head, *failures, *(f"  note: {r}" for r in coarse)])
