"""Figures with their headings and legends, as HTML."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from gapsense.report.html import figures, style, thin
from gapsense.report.html.axes import Axes, shared
from gapsense.report.html.curves import Panel, Strip
from gapsense.report.html.elements import Markup, element, joined
from gapsense.report.html.figures import Drawn, Entry
from gapsense.report.html.panels import strips
from gapsense.report.html.subject import Shown
from gapsense.report.html.tubes import Regression

FEW = " {} of {} points, least and greatest of each piece"
BAND = " \N{PLUS-MINUS SIGN}2\N{GREEK SMALL LETTER SIGMA}"
TUBES = 6  # that are drawn
MOVES = (("out", "zoom out"), ("in", "zoom in"), ("left", "earlier"), ("right", "later"), ("reset", "all"))
SIGNS = {"out": "\N{MINUS SIGN}", "in": "+", "left": "←", "right": "→", "reset": "reset"}


@dataclass
class Plots:
    """The figures of a page by key, and the pieces of HTML that they come into."""

    figures: dict[str, Any] = field(default_factory=dict)

    def placed(self, drawn: Drawn, key: str, note: str = "") -> Markup:
        """A figure with heading and legend; `page.py` puts the plot in place of its key."""
        self.figures[key] = drawn.figure
        unit = f" / {drawn.unit}" if drawn.unit else ""
        chips = element("div", *map(chip, drawn.legend), of="chips")
        names = ", ".join(entry.label for entry in drawn.legend)
        label = ": ".join(filter(None, (drawn.label + unit, names)))
        plot = element("div", Markup(mark(key)), of="plot", role="img", aria_label=label)
        few = FEW.format(*drawn.points) if drawn.points[0] < drawn.points[1] else ""
        head = element("figcaption", element("b", drawn.label + unit), " ", element("small", (note + few).strip()))
        return element("figure", head, chips, plot, of="panel")


def mark(key: str) -> str:
    """Where the plot of a key comes."""
    return f"<!--plot {key}-->"


def chip(entry: Entry) -> Markup:
    """Entry of a legend: a button that switches its curve, with the value at the cursor."""
    stroke = f"stroke:{style.variable(entry.colour)}" if entry.colour in style.DARK else f"stroke:{entry.colour}"
    dash = " ".join(map(str, entry.dash))
    sample = Markup(
        f'<svg width="26" height="10" aria-hidden="true"><path d="M1 5h24" style="{stroke};stroke-width:3" '
        f'stroke-dasharray="{dash}"/></svg>'
    )
    label = entry.label + (BAND if entry.is_band else "")
    if not entry.key:
        return element("span", sample, " ", label, of="chip")
    value = element("output", of="value")
    return element(
        "button", sample, " ", label, value, of="chip", type="button", aria_pressed="true", data_curve=entry.key
    )


def controls(key: str) -> Markup:
    """Buttons that move the time axis of all plots of a result."""
    buttons = (
        element("button", SIGNS[move], type="button", data_move=move, data_result=key, title=what, aria_label=what)
        for move, what in MOVES
    )
    hint = (
        "Drag in a plot to zoom into a time, in all plots; press a name to switch its curve. Bands that are wider than "
        "a plot are cut. Long records are thinned for display; all numbers on this page are of the full record."
    )
    return joined((element("p", element("small", hint), of="hint"), element("p", *buttons, of="controls")))


def time_plots(shown: Shown, drawn: list[Panel], plots: Plots, key: str) -> tuple[Axes, Markup]:
    """All plots over time of a result, and the axis that they share."""
    flags = strips(shown)
    names = [c.component for p in drawn for c in p.curves if not c.is_truth]
    truths = [c.component for p in drawn for c in p.curves]
    axes = shared(shown, style.colours([*names, *truths]), thin.most(points(drawn)))
    parts = [stacked(plots, p, axes, f"{key}-p{k}", k == len(drawn) - 1 and not flags) for k, p in enumerate(drawn)]
    if flags:
        parts.append(flagged(plots, flags, axes, f"{key}-s"))
    return axes, element("div", *parts, of="stack", data_axis=key)


def points(drawn: list[Panel]) -> int:
    """Columns of numbers in all panels: times, values, and two for a band."""
    return sum(4 if c.band is not None else 2 for p in drawn for c in p.curves) // 2


def stacked(plots: Plots, panel: Panel, axes: Axes, key: str, is_last: bool) -> Markup:
    """One panel."""
    return plots.placed(figures.panel(panel, axes, key, is_last), key, panel.note)


def flagged(plots: Plots, flags: list[Strip], axes: Axes, key: str) -> Markup:
    """Signals that have few values."""
    return plots.placed(figures.strips(flags, axes, is_last=True), key)


def tube_plots(regression: Regression, axes: Axes, plots: Plots, key: str) -> Markup:
    """Tubes of the signals that fail, or of the one that is nearest to its tolerance, if it is not the same."""
    failing = [tube for tube in regression.tubes if tube.failing.any()]
    nearest = [tube for tube in regression.tubes[:1] if tube.share]
    parts = []
    for k, tube in enumerate(failing[:TUBES] or nearest):
        over, under = figures.tube(tube, axes, f"{key}-t{k}")
        parts += [plots.placed(over, f"{key}-t{k}"), plots.placed(under, f"{key}-t{k}d")]
    return element("div", *parts, of="stack") if parts else Markup("")


def embedded(plots: Plots) -> tuple[str, Mapping[str, str]]:
    """Script that draws all figures, and the elements that they come into by key."""
    from bokeh.document import Document
    from bokeh.embed import components

    if not plots.figures:
        return "", {}
    document = Document()
    with document.models.freeze():  # else it goes through all models after each figure: 26 s for 48 of them
        for made in plots.figures.values():
            document.add_root(made)
    script, divs = components(plots.figures, wrap_script=False)
    return script, divs
