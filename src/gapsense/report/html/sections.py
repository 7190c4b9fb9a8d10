"""Words, numbers and tables of a report."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from gapsense.cosim import Measured, Result
from gapsense.report.html.elements import Cell, Markup, bar, details, element, joined, table
from gapsense.report.html.subject import Shown
from gapsense.report.html.tubes import Regression
from gapsense.report.runs import per_step
from gapsense.report.table import quantity

NEAR = 0.1  # of the range between two bounds


class Verdict(NamedTuple):
    """Outcome of a run in a few words, and whether it is good."""

    passed: bool
    sentences: tuple[str, ...]
    words: tuple[str, str] = ("passed", "failed")

    @property
    def word(self) -> str:
        """The verdict as one word."""
        return self.words[not self.passed]


def verdict(shown: Shown, regression: Regression) -> Verdict:
    """Judge a run by its end, its metrics and its baseline."""
    result = shown.result
    outside = [m for m in result.metrics.values() if not m.passed]
    bounded = sum(m.bounds is not None for m in result.metrics.values())
    sentences = []
    if result.failure:
        sentences.append(f"A component failed: {result.failure}")
    if result.interrupted:
        sentences.append(f"Interrupted: recorded is {span(result)}.")
    if outside:
        sentences.append(f"{len(outside)} of {len(result.metrics)} metrics are outside of their bounds.")
    elif bounded:
        subject = "The metric with bounds is" if bounded == 1 else f"All {bounded} metrics with bounds are"
        sentences.append(f"{subject} within them.")
    else:
        sentences.append("No metric has bounds.")
    sentences.append(of_baseline(regression))
    sentences += [f"Note: {remark}" for remark in result.run.remarks]
    bad = result.failure or result.interrupted or outside or regression.problems
    return Verdict(not bad, tuple(sentences))


def of_baseline(regression: Regression) -> str:
    """Sentence on the baseline."""
    if regression.problems:
        return f"It differs from its baseline: {len(regression.problems)} findings."
    if regression.tubes:
        return f"All {len(regression.tubes)} signals of the baseline are within their tolerances."
    return regression.note


def banner(found: Verdict) -> Markup:
    """The verdict, as HTML."""
    kind = "passed" if found.passed else "failed"
    mark = element("strong", f"{'✓' if found.passed else '✗'} {found.word}")
    return element("p", mark, " ", " ".join(found.sentences), of=f"verdict {kind}", role="status")


def facts(shown: Shown) -> Markup:
    """What ran, on a few lines."""
    run, result = shown.result.run, shown.result
    rows = (
        ("scenario", run.scenario),
        ("time", f"{span(result)}, base step {quantity(run.base_step, 's')}, {run.method}"),
        ("record", f"{result.times.size} rows, {len(result.signals)} signals, a row per {of_steps(run.decimation)}"),
        ("seeds", ", ".join(f"{name} {seed}" for name, seed in run.seeds.items()) or "none"),
        ("wall time", f"{result.wall:.3f} s, real-time factor {result.realtime_factor:.3g}"),
        ("software", f"gapsense {run.versions.get('gapsense', '-')}"),
        ("result", str(shown.file.name)),
    )
    return element("dl", *(element("div", element("dt", n), element("dd", v)) for n, v in rows), of="facts")


def span(result: Result) -> str:
    """First and last time of the record."""
    ends = (result.times[0], result.times[-1]) if result.times.size else (result.run.start, result.run.start)
    return " to ".join(quantity(float(end), "s") for end in ends)


def of_steps(decimation: int) -> str:
    """Time between two rows, in words."""
    return "base step" if decimation == 1 else f"{decimation} base steps"


def components(result: Result) -> Markup:
    """Table of the components."""
    base = result.run.base_step
    rows = (
        (
            str(k),
            name,
            fact["fmu"],
            fact["version"] or "-",
            f"{fact['fmi']}.0" if "fmi" in fact else "-",
            quantity(fact["step"] * base, "s"),
            quantity(fact["offset"] * base, "s"),
            element("code", fact["sha256"][:16], title=fact["sha256"]),
        )
        for k, (name, fact) in enumerate(((n, result.run.components[n]) for n in result.run.order), 1)
    )
    heads = ("order", "component", "FMU", "version", "FMI", "step", "offset", "SHA-256")
    return table("Components in the order in which they step", heads, rows, texts=8)


def versions(result: Result) -> Markup:
    """Software, files and hashes whole, to repeat the run."""
    run = result.run
    software = table("Software", ("what", "version"), list(run.versions.items()), texts=2)
    hashes = {**run.files, **{fact["fmu"]: fact["sha256"] for fact in run.components.values()}}
    files = table("Files", ("file", "SHA-256"), [(n, element("code", h)) for n, h in hashes.items()], texts=2)
    ids = [(name, element("code", str(fact["guid"]))) for name, fact in run.components.items()]
    return details("Versions, files and hashes", software, files, table("FMUs", ("component", "GUID"), ids, texts=2))


def metrics(result: Result) -> Markup:
    """Metrics by table of the scenario, with their bounds and how near they are."""
    tables: dict[str, list[Measured]] = {}
    for m in result.metrics.values():
        tables.setdefault(m.table or "Metrics", []).append(m)
    return joined(of_table(title, own) for title, own in tables.items())


def of_table(title: str, own: list[Measured]) -> Markup:
    """Metrics that are shown together."""
    is_published = any(m.published is not None for m in own)
    heads = ("metric", "value", *(("published",) if is_published else ()), "bounds", "place between them", "")
    return table(title, heads, (metric(m, is_published) for m in own))


def metric(m: Measured, is_published: bool) -> tuple[Cell, ...]:
    """Row of a metric."""
    printed = ("" if m.published is None else quantity(m.published, m.unit),) if is_published else ()
    name = element("span", m.label or m.name, title=m.description or m.name)
    return name, quantity(m.value, m.unit), *printed, bounds(m), place(m), status(m)


def bounds(m: Measured) -> str:
    """Bounds of a metric, in words."""
    low, high = m.bounds or (-math.inf, math.inf)
    if math.isfinite(low) and math.isfinite(high):
        return f"{quantity(low, m.unit)} to {quantity(high, m.unit)}"
    ends = (("at least", low), ("at most", high))
    return " ".join(f"{word} {quantity(end, m.unit)}" for word, end in ends if math.isfinite(end))


def share(m: Measured) -> float:
    """Where between its bounds a metric is: 0 at the lower, 1 at the upper one; NaN without two of them."""
    if m.bounds is None or not all(map(math.isfinite, (*m.bounds, m.value))) or m.bounds[0] == m.bounds[1]:
        return math.nan
    return (m.value - m.bounds[0]) / (m.bounds[1] - m.bounds[0])


def place(m: Measured) -> Cell:
    """Bar and share of a metric."""
    found = share(m)
    if math.isnan(found):
        return ""
    return part(found, "" if m.passed else "bad")


def status(m: Measured) -> Cell:
    """How a metric stands."""
    if not m.passed:
        return element("strong", "outside", of="bad")
    found = share(m)
    is_close = found < NEAR and m.bounds is not None and m.bounds[0] != 0.0  # an error may well be near 0
    return "near a bound" if is_close or found > 1.0 - NEAR else "within" if m.bounds else ""


def timing(result: Result) -> Markup:
    """Time of each component."""
    total = result.wall or 1.0
    own = sum(t.seconds for t in result.timing.values())
    rows: list[tuple[Cell, ...]] = [
        (name, str(t.calls), *per_step(t), f"{1e3 * t.seconds:.2f}", part(t.seconds / total))
        for name, t in result.timing.items()
    ]
    rest = f"{1e3 * max(total - own, 0.0):.2f}", part(max(1.0 - own / total, 0.0))
    rows.append(("everything else", "", "", "", "", *rest))
    heads = ("component", "steps", "mean / us per step", "median", "longest", "total / ms", "share of the run")
    return table(f"{result.wall:.3f} s in all; loading the FMUs is not counted", heads, rows)


def part(found: float, kind: str = "") -> Markup:
    """A share with its bar."""
    return joined((bar(found, kind), element("span", f"{100 * found:.0f} %", of="share")))


def signals(result: Result) -> Markup:
    """Range of each signal, of the full record."""
    rows = (
        (name, result.units[name] or "-", *(f"{v:.6g}" for v in (np.min(y), np.max(y), y[-1])))
        for name, y in result.signals.items()
        if y.size
    )
    shown = table("All recorded signals", ("signal", "unit", "least", "greatest", "last"), rows, texts=2)
    return details(f"All {len(result.signals)} signals", shown)


def messages(result: Result) -> Markup:
    """Messages of the components."""
    return details(
        f"{len(result.messages)} messages of the components",
        table("Messages", ("component", "status", "text"), [(a, str(b), c) for a, b, c in result.messages], texts=3),
    )


def tubes(regression: Regression) -> Markup:
    """Each signal of the baseline, the nearest to its tolerance first."""
    rows = [
        (
            tube.name,
            f"{quantity(tube.allowed, tube.unit)}",
            quantity(float(tube.counted.max(initial=0.0)), tube.unit),
            quantity(float(tube.times[np.argmax(tube.counted)]), "s") if tube.share else "",
            percent(tube.share),
            f"{int(tube.failing.sum())} of {tube.values.size}",
        )
        for tube in regression.tubes
    ]
    heads = ("signal", "allowed", "largest difference", "at", "share of the allowed", "rows outside")
    shown = table("Difference to the baseline", heads, rows)
    return shown if regression.problems else details(f"All {len(rows)} signals of the baseline", shown)


def percent(found: float) -> str:
    """A share of what is allowed."""
    return f"{100 * found:.3g} %" if math.isfinite(found) else "nothing is allowed"


def problems(sentences: tuple[str, ...]) -> Iterator[Markup]:
    """Differences from the baseline, in words."""
    if sentences:
        yield element("ul", *(element("li", sentence) for sentence in sentences), of="problems")


def events(shown: Shown) -> Markup:
    """Table of the events of a run."""
    rows = [(e.name, e.what, quantity(e.begin, "s"), quantity(e.end, "s")) for e in shown.events]
    return table("Events, shaded in the plots", ("event", "what it does", "begin", "end"), rows, texts=2)
