"""A result as a chapter of the page, and the table of all chapters before them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from gapsense.report.html import consistency, sections
from gapsense.report.html.curves import Panel
from gapsense.report.html.elements import Markup, details, element, joined, section, table
from gapsense.report.html.panels import panels
from gapsense.report.html.plots import Plots, controls, time_plots, tube_plots
from gapsense.report.html.subject import Shown
from gapsense.report.html.tubes import Regression, regression
from gapsense.report.html.wiring import kinds, picture


class Chapter(NamedTuple):
    """A result on the page."""

    key: str
    title: str
    name: str
    verdict: sections.Verdict
    content: Markup


def chapter(shown: Shown, plots: Plots, key: str) -> Chapter:
    """Everything about one result."""
    result, compared = shown.result, regression(shown)
    found = sections.verdict(shown, compared)
    about = shown.scenario.variants.get(result.run.variant or "", "") if shown.scenario else ""
    title = (result.run.title or result.run.scenario) + (f": {result.run.variant}" if result.run.variant else "")
    head = element("header", element("h2", title, id=key), element("p", about) if about else "", sections.banner(found))
    parts = (head, sections.facts(shown), wiring(shown, key), *of_time(shown, compared, plots, key))
    content = element("article", *parts, aria_labelledby=key)
    return Chapter(key=key, title=title, name=result.run.scenario, verdict=found, content=content)


def of_time(shown: Shown, compared: Regression, plots: Plots, key: str) -> list[Markup]:
    """Plots, metrics, tubes and timing of a run, if it has any rows to show."""
    result = shown.result
    if result.times.size < 2:
        return [element("p", "No time has passed in this run: there is nothing to plot."), what_ran(shown, key)]
    drawn = panels(shown)
    axes, stack = time_plots(shown, drawn, plots, key)
    tubes = tube_plots(compared, axes, plots, key)
    why = element("p", compared.note) if compared.note else Markup("")
    checked = (*sections.problems(compared.problems), sections.tubes(compared), tubes, why)
    return [
        section("Metrics", f"{key}-metrics", sections.metrics(result)),
        section("Signals", f"{key}-signals", sections.events(shown), controls(key), stack, *numbers(shown, drawn)),
        section("Baseline", f"{key}-baseline", *checked),
        section("Timing", f"{key}-timing", sections.timing(result)),
        what_ran(shown, key),
    ]


def numbers(shown: Shown, drawn: list[Panel]) -> tuple[Markup, ...]:
    """Tables with the exact numbers behind the plots."""
    return consistency.shown(drawn), sections.signals(shown.result)


def what_ran(shown: Shown, key: str) -> Markup:
    """Components, versions, hashes, messages."""
    result = shown.result
    parts = sections.components(result), sections.versions(result), parameters(shown), sections.messages(result)
    return section("What ran", f"{key}-ran", *parts)


def parameters(shown: Shown) -> Markup:
    """All parameters as the FMUs had them."""
    rows = [(name, str(value)) for name, value in shown.result.parameters.items()]
    return details(f"All {len(rows)} parameters", table("Parameters", ("parameter", "value"), rows))


def wiring(shown: Shown, key: str) -> Markup:
    """The wiring picture with its strokes, or why there is none."""
    run = shown.result.run
    drawn = picture(run)
    if not drawn:
        text = "No connections are known: there are none, or the result is of an older version."
        return section("Wiring", f"{key}-wiring", element("p", text))
    frame = element("div", Markup(drawn), of="wide", tabindex="0", role="group", aria_label="Wiring picture")
    links = details(f"All {len(run.wires)} connections", table("Connections", ("from", "to"), ends(run.wires), texts=2))
    return section("Wiring", f"{key}-wiring", frame, Markup(kinds(run)), links)


def ends(wires: Sequence[str]) -> list[tuple[str, ...]]:
    """Table of all connections."""
    return [tuple(wire.split(" -> ", 1)) for wire in wires]


def summary(chapters: Sequence[Chapter]) -> list[Markup]:
    """A table of all results, if there are several."""
    if len(chapters) < 2:
        return []
    rows = [
        (
            Markup(f'<a href="#{c.key}">{element("span", c.name)}</a>'),
            c.title,
            c.verdict.word,
            " ".join(c.verdict.sentences),
        )
        for c in chapters
    ]
    failed = sum(not c.verdict.passed for c in chapters)
    title = f"{len(chapters)} results, {failed} failed"
    heads = ("result", "title", "verdict", "what was found")
    return [joined([element("h1", title), table("Results on this page", heads, rows, texts=4)])]
