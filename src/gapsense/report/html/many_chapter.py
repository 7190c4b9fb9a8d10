"""Many runs as a chapter of the page."""

from __future__ import annotations

from gapsense.report.html import many_sections as sections
from gapsense.report.html.chapters import Chapter
from gapsense.report.html.elements import element, section
from gapsense.report.html.many import Many
from gapsense.report.html.many_plots import drawn
from gapsense.report.html.plots import Plots
from gapsense.report.html.sections import banner


def chapter_of_many(many: Many, plots: Plots, key: str) -> Chapter:
    """Everything about a campaign or a sweep."""
    about, found = many.about, sections.verdict(many)
    words = [element("p", about["description"])] if about.get("description") else []
    title = f"{about['title']}: {many.kind}"
    head = element("header", element("h2", title, id=key), *words, banner(found))
    content = element(
        "article",
        head,
        sections.facts(many),
        section("Failed runs", f"{key}-failed", sections.failed(many)),
        section("Metrics", f"{key}-metrics", sections.metrics(many)),
        section("Worst runs", f"{key}-worst", sections.worst(many)),
        section("Distributions", f"{key}-plots", *drawn(many, plots, key)),
        section("What was varied", f"{key}-varied", sections.factors(many)),
        section("What ran", f"{key}-ran", sections.what_ran(many)),
        aria_labelledby=key,
    )
    return Chapter(key=key, title=title, name=many.file.stem, verdict=found, content=content)
