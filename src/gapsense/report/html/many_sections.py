"""Many runs in words, numbers and tables."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

from gapsense.problems import number_of
from gapsense.report.html.elements import Cell, Markup, details, element, joined, table
from gapsense.report.html.many import Many
from gapsense.report.html.repeat import repeated
from gapsense.report.html.sections import Verdict

if TYPE_CHECKING:
    from gapsense.many.summary import Extremes, Worst

BENT = 0.2  # share of a metric that must go with a parameter, if it does not so in one direction
WORDS = ("complete", "incomplete")
HEADS = ("metric", "least", "5 %", "median", "95 %", "greatest", "bounds", "outside", "goes with", "no value")


def verdict(many: Many) -> Verdict:
    """What came of all runs: complete if each is there and none failed; bounds are those of the scenario as it is."""
    of = many.campaign
    missing, sentences = of.runs - of.rows, []
    if missing > 0:
        sentences.append(f"{missing} of {of.runs} runs are missing: the same command goes on.")
    if of.failed:
        sentences.append(f"{number_of(of.failed, 'run')} failed.")
    if not sentences:
        sentences.append(f"All {of.runs} runs are there, none failed.")
    return Verdict(missing <= 0 and not of.failed, (*sentences, *of_bounds(many)), WORDS)


def of_bounds(many: Many) -> Iterator[str]:
    """Sentences on the bounds of the metrics, and on metrics without a value."""
    bounded = [name for name in many.extremes if many.bounds(name)]
    outside = [name for name in bounded if many.extremes[name].outside]
    if outside:
        yield f"{len(outside)} of {len(bounded)} metrics with bounds are outside of them in some runs."
    elif bounded:
        yield f"All {len(bounded)} metrics with bounds are within them in all runs that have a value."
    gaps = [name for name in many.extremes if many.spreads[name].missing > many.campaign.failed]
    if gaps:
        yield f"{len(gaps)} metrics have no value in some runs that did not fail."


def facts(many: Many) -> Markup:
    """What ran, on a few lines."""
    of, about = many.campaign, many.about
    points = about.get("points", of.runs)
    seeds = ", ".join(f"{name} {seed}" for name, seed in about.get("seeds", {}).items())
    settings = ", ".join(f"{name} = {value}" for name, value in about.get("settings", {}).items())
    rows = (
        ("scenario", about["scenario"]),
        ("file", many.scenario or "-"),
        *((("study", about["study"]),) if about.get("study") else ()),
        ("runs", f"{of.rows} of {of.runs}, {of.failed} failed, {max(of.runs - of.rows, 0)} missing"),
        ("combinations", f"{points}, runs of each: {of.runs // max(points, 1)}"),
        ("seeds", f"{seeds}, and what each run adds" if seeds else "none"),
        *((("set", settings),) if settings else ()),
        ("software", f"gapsense {about['versions'].get('gapsense', '-')}"),
        ("result", many.file.resolve().name),
    )
    return element("dl", *(element("div", element("dt", n), element("dd", v)) for n, v in rows), of="facts")


def failed(many: Many) -> Markup:
    """Runs that failed, and how to repeat them."""
    rows = [(named(many, run), error, element("code", repeated(many, run))) for run, error in many.failed]
    more = many.campaign.failed - len(rows)
    rest = element("p", f"{more} more failed.") if more > 0 else Markup("")
    return joined((table("Runs that failed", ("run", "why", "to repeat it"), rows, texts=3), rest))


def named(many: Many, run: int) -> str:
    """A run, and what it adds to every seed."""
    shift = many.rows[run]["seed"]
    return f"{run}" if not many.about.get("seeds") or shift is None else f"{run} (seeds + {shift})"


def metrics(many: Many) -> Markup:
    """Quantiles of each metric, by table of the scenario."""
    groups: dict[str, list[str]] = {}
    for name in many.extremes:
        groups.setdefault(many.labels[name][0], []).append(name)
    return joined(table(title, HEADS, (metric(many, name) for name in own)) for title, own in groups.items())


def metric(many: Many, name: str) -> tuple[Cell, ...]:
    """Row of a metric."""
    of, outside = many.spreads[name], many.extremes[name].outside
    numbers = (many.shown(name, v) for v in (of.least, of.low, of.median, of.high, of.greatest))
    out = element("strong", f"{outside} of {many.campaign.rows - of.missing}", of="bad") if outside else "none"
    head = element("span", many.labels[name][1], title=name)
    return head, *numbers, limits(many, name), out if many.bounds(name) else "", goes_with(many, name), gap(of.missing)


def goes_with(many: Many, name: str) -> str:
    """What a metric goes with most: a correlation, unless it goes up and down with another parameter."""
    found = many.correlations.get(name, ())
    if not found or not found[0].correlation:
        return "-"
    bent = max(found, key=lambda one: one.share)
    if bent.share > max(BENT, 2.0 * found[0].correlation ** 2):
        return f"{bent.factor}, up and down"
    return f"{found[0].factor} {found[0].correlation:+.2f}"


def gap(missing: int) -> Cell:
    """Number of runs without a value."""
    return element("strong", str(missing), of="bad") if missing else "-"


def limits(many: Many, name: str) -> str:
    """Bounds of a metric."""
    low, high = many.bounds(name) or (-math.inf, math.inf)
    if math.isfinite(low) and math.isfinite(high):
        return f"{many.shown(name, low)} to {many.shown(name, high)}"
    ends = (("at least", low), ("at most", high))
    return " ".join(f"{word} {many.shown(name, end)}" for word, end in ends if math.isfinite(end))


def worst(many: Many) -> Markup:
    """The worst runs of each metric, and how to repeat each of them."""
    rows = [
        (many.label(metric), named(many, one.run), many.shown(metric, one.value), why(many, metric, one.beyond))
        for metric, found in many.extremes.items()
        for one in telling(found)
    ]
    runs = sorted({one.run for found in many.extremes.values() for one in telling(found)})
    commands = [(named(many, run), element("code", repeated(many, run))) for run in runs]
    heads = ("metric", "run", "value", "what it is")
    again = table("Repeat, from the folder in which this report was made", ("run", "command"), commands, texts=2)
    title = "Farthest beyond the bounds; without bounds, farthest from the median"
    return joined((table(title, heads, rows), details(f"To repeat these {len(runs)} runs", again)))


def telling(found: Extremes) -> tuple[Worst, ...]:
    """Runs of a metric that are worth a row: of those within the bounds, the nearest to a bound."""
    return found.worst if not found.worst or found.worst[0].beyond > 0.0 else found.worst[:1]


def why(many: Many, metric: str, beyond: float) -> Cell:
    """Why a run is listed: where its value lies."""
    if many.bounds(metric) is None:
        return f"{many.shown(metric, beyond)} from the median"
    if beyond <= 0.0:
        return "inside" if math.isinf(beyond) else f"inside by {many.shown(metric, -beyond)}"
    return element("strong", f"outside by {many.shown(metric, beyond)}", of="bad")


def factors(many: Many) -> Markup:
    """What was varied."""
    rows = []
    for name in many.campaign.factors if many.campaign.rows else ():
        if name in many.spreads:
            of = many.spreads[name]
            rows.append((name, *(many.shown(name, v) for v in (of.least, of.median, of.greatest)), levels(many, name)))
        else:
            rows.append((name, "", "", "", levels(many, name)))
    return table("Parameters", ("parameter", "least", "median", "greatest", "values"), rows)


def levels(many: Many, name: str) -> str:
    """Values of a parameter that has few."""
    found = many.levels[name]
    return "many" if found is None else ", ".join(f"{v:.6g}" if isinstance(v, float) else str(v) for v in found)


def what_ran(many: Many) -> Markup:
    """Versions and hashes."""
    about = many.about
    software = table("Software", ("name", "version"), list(about["versions"].items()), texts=2)
    hashes = [(name, element("code", value)) for name, value in about.get("decided_by", {}).items()]
    return joined((software, table("What decides the numbers", ("what", "hash or version"), hashes, texts=2)))
