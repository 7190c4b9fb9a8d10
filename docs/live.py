"""Pages in which a scenario runs, made anew where older than the sources; a comment puts one into a page."""

from __future__ import annotations

import re

from kept import ROOT, kept

from gapsense.cosim import load
from gapsense.page.page import write_page

OF_COMPONENTS = {  # scenario that shows an estimator or a controller
    "BoundedUkf": "bounded_ukf",
    "Ekf": "profiles",
    "Ertss": "profiles",
    "HybridEkf": "pot_magnet",
    "IntegralEstimator": "semera_valve",
    "Mhe": "estimators",
    "Monitor": "condition",
    "RunToRun": "run_to_run",
    "Semera": "semera_valve",
}
MARK = re.compile(r"<!-- page: (\w+) -->")
CHAPTER = "\n## In your browser\n\n<!-- page: {} -->\n"
FRAME = """<iframe class="live" src="{place}" title="{title}" loading="lazy"></iframe>

<p><a href="{place}">{title}: as a page of its own</a></p>"""


def names() -> list[str]:
    """Scenarios that have a page."""
    return sorted({*OF_COMPONENTS.values()})


def made(name: str) -> bytes:
    """The page of a scenario."""
    return kept(place(name), lambda file: write_page(ROOT / "scenarios" / name, file)).read_bytes()


def place(name: str) -> str:
    """Of a page in the site."""
    return f"pages/{name}.html"


def chapter(component: str) -> str:
    """The chapter of a component's page that shows it at work; nothing if no scenario does."""
    return CHAPTER.format(OF_COMPONENTS[component]) if component in OF_COMPONENTS else ""


def framed(markdown: str, to_root: str) -> str:
    """A page of the site with scenarios in place of the comments that name them."""

    def frame(found: re.Match[str]) -> str:
        title = load(ROOT / "scenarios" / found[1]).title
        return FRAME.format(place=f"{to_root}{place(found[1])}", title=title)

    return MARK.sub(frame, markdown)
