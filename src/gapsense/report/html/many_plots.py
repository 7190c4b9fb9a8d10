"""Plots of many runs: how each metric is distributed, and how it goes with each parameter."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import bokeh.models
import numpy as np
from bokeh.plotting import figure

from gapsense.many import summary
from gapsense.report.html import style
from gapsense.report.html.axes import dress
from gapsense.report.html.elements import Markup, element, joined
from gapsense.report.html.figures import Drawn, Entry, fitting
from gapsense.report.html.many import Many
from gapsense.report.html.plots import Plots

bk: Any = bokeh.models
POINTS = 2000  # runs that are drawn as points; more are counted
PANELS = 64  # on a page
METRICS = 16  # that are drawn
HEIGHT = 230  # [pixels]
MEDIAN, BOUNDS, RANGE = Entry("", "median", style.INK), Entry("", "bounds", style.FAIL), "median and 5 to 95 %"
BLUE = (58, 143, 208)  # seen on light and on dark ground
FAINTEST = 60  # of 255, where a single run lies


class Panels(NamedTuple):
    """What is drawn: for each metric the parameters that it is drawn over."""

    chosen: dict[str, list[str]]
    note: str


def panels(many: Many) -> Panels:
    """Metrics that leave their bounds first, each over the parameters that it goes with most."""
    known = [name for name in many.extremes if many.campaign.rows - many.spreads[name].missing > 0]
    metrics = sorted(known, key=lambda name: not many.extremes[name].outside)[:METRICS]
    factors = [f for f in many.campaign.factors if f in many.spreads or many.levels[f] is not None]
    room = max(1, PANELS // max(len(metrics), 1) - 1)
    chosen = {name: ordered(many, name, factors)[:room] for name in known if name in metrics}
    words = f"{len(metrics)} of {len(many.extremes)} metrics are drawn"
    if len(factors) > room:
        return Panels(chosen, f"{words}, each over the {room} of {len(factors)} parameters that it goes with most. ")
    return Panels(chosen, f"{words}. " if len(metrics) < len(many.extremes) else "")


def ordered(many: Many, metric: str, factors: list[str]) -> list[str]:
    """Parameters, those first that are no numbers, then by how much of the metric goes with them."""
    known = sorted(many.correlations.get(metric, ()), key=lambda one: -one.share)
    numbers = [one.factor for one in known if one.factor in factors]
    return [*(name for name in factors if name not in numbers), *numbers]


class Drawer:
    """Draws the panels of many runs, with what they have in common."""

    def __init__(self, many: Many, chosen: dict[str, list[str]]) -> None:
        self.many, self.few = many, many.levels
        self.is_counted = many.campaign.rows > POINTS
        factors = list(dict.fromkeys(f for own in chosen.values() for f in own if self.few[f] is None))
        self.scales = {name: fitting(many.unit(name), np.array(of[1:6])) for name, of in many.spreads.items()}
        self.clouds = summary.clouds(many.campaign, factors, list(chosen)) if self.is_counted else {}
        self.source = None if self.is_counted else self.points([*factors, *chosen])

    def points(self, names: list[str]) -> Any:
        """Runs as points, which all plots share: those that are selected in one are so in all."""
        columns = {name: self.many.campaign.column(name).astype(np.float64) * self.scales[name][0] for name in names}
        data = {f"c{k}": columns[name].astype(np.float32) for k, name in enumerate(names)}
        self.keys = {name: f"c{k}" for k, name in enumerate(names)}
        return bk.ColumnDataSource({"run": self.many.campaign.column("run").astype(np.int32), **data})

    def alone(self, metric: str) -> Drawn:
        """Histogram of a metric, with its median and bounds."""
        bins, counts = summary.histogram(self.many.campaign, metric)
        (scale, unit), made = self.scales[metric], bare()
        edges, of = bins * scale, self.many.spreads[metric]
        fill = {"fill_color": style.CURVES[0], "fill_alpha": 0.55, "line_color": None}
        made.quad(left=edges[:-1], right=edges[1:], top=counts, bottom=0.0, **fill)
        line(made, of.median * scale, MEDIAN)
        ends = [b for b in self.many.bounds(metric) or () if np.isfinite(b)]
        for bound in ends:
            line(made, bound * scale, BOUNDS)
        made.y_range.start, made.xaxis.axis_label = 0, labelled(self.many.label(metric), unit)
        low, high = span(edges[0], edges[-1], [b * scale for b in ends])
        made.x_range = bk.Range1d(low, high)
        return Drawn(
            figure=made, label="how many runs", unit="", legend=(MEDIAN, BOUNDS) if ends else (MEDIAN,), points=(0, 0)
        )

    def over(self, metric: str, factor: str) -> Drawn:
        """A metric over a parameter."""
        made = bare()
        if self.few[factor] is not None:
            self.bars(made, metric, factor)
        elif self.is_counted:
            self.density(made, metric, factor)
        else:
            x, y = self.keys[factor], self.keys[metric]
            made.scatter(x, y, source=self.source, size=5, **dots(self.many.campaign.rows))
            told = [("run", "@run"), ("parameter", f"@{x}"), ("metric", f"@{y}")]
            made.add_tools(bk.HoverTool(tooltips=told), bk.BoxSelectTool())
        for bound in self.many.bounds(metric) or ():
            if np.isfinite(bound):
                line(made, bound * self.scales[metric][0], BOUNDS, "width")
        unit = self.scales[factor][1] if self.few[factor] is None and factor in self.scales else self.many.unit(factor)
        made.xaxis.axis_label = labelled(factor, unit)
        label = labelled(self.many.label(metric), self.scales[metric][1])
        return Drawn(figure=made, label=f"{label} over {factor}", unit="", legend=(), points=(0, 0))

    def bars(self, made: Any, metric: str, factor: str) -> None:
        """Median and 5 to 95 % range at each value of a parameter."""
        groups = summary.grouped(self.many.campaign, factor, metric, self.few[factor] or ())
        numbers = np.array([group.quantiles for group in groups]).reshape(-1, 3) * self.scales[metric][0]
        places = np.arange(len(groups))
        bar = {"line_color": style.CURVES[0], "line_width": 5, "line_alpha": 0.5}
        made.segment(places, numbers[:, 0], places, numbers[:, 2], **bar)
        made.scatter(places, numbers[:, 1], size=8, color=style.CURVES[0])
        names = [f"{g.value:.6g}" if isinstance(g.value, float) else str(g.value) for g in groups]
        made.xaxis.ticker = bk.FixedTicker(ticks=places.tolist())
        made.xaxis.major_label_overrides = dict(zip(places.tolist(), names))
        made.x_range = bk.Range1d(-0.6, len(groups) - 0.4)

    def density(self, made: Any, metric: str, factor: str) -> None:
        """How many runs lie where; where none does there is nothing."""
        cloud = self.clouds[factor, metric]
        x, y = cloud.x * self.scales[factor][0], cloud.y * self.scales[metric][0]
        box = {"x": x[0], "y": y[0], "dw": x[-1] - x[0], "dh": y[-1] - y[0]}
        made.image_rgba(image=[coloured(cloud.counts.T)], **box)
        made.x_range, made.y_range = bk.Range1d(x[0], x[-1]), bk.Range1d(y[0], y[-1])


def bare() -> Any:
    """An empty figure."""
    zoom = bk.BoxZoomTool()
    made: Any = figure(
        height=HEIGHT,
        sizing_mode="stretch_width",
        tools=[zoom, bk.PanTool(), bk.WheelZoomTool(), bk.ResetTool(), bk.SaveTool()],
        active_drag=zoom,
        active_scroll=None,
        toolbar_location="above",
        background_fill_color=None,
        border_fill_color=None,
        outline_line_color=None,
        output_backend="canvas",
    )
    made.toolbar.logo, made.toolbar.autohide = None, True
    dress(made, "")
    made.xaxis.ticker.desired_num_ticks = 4
    return made


def dots(rows: int) -> dict[str, Any]:
    """Look of points; those that are not selected are faint once some are."""
    alpha = 0.8 if rows < POINTS // 4 else 0.45
    return {"color": style.CURVES[0], "alpha": alpha, "nonselection_alpha": 0.08, "selection_alpha": 1.0}


def line(made: Any, at: float, entry: Entry, dimension: str = "height") -> None:
    """A straight line across a figure."""
    dash = "dashed" if entry is BOUNDS else "solid"
    made.add_layout(bk.Span(location=at, dimension=dimension, line_color=entry.colour, line_width=1.5, line_dash=dash))


def span(low: float, high: float, ends: list[float]) -> tuple[float, float]:
    """Part of an axis that has all bins, and bounds if they are not far away."""
    room = high - low
    near = [end for end in ends if low - 2.0 * room < end < high + 2.0 * room]
    low, high = min([low, *near]), max([high, *near])
    return low - 0.04 * (high - low), high + 0.04 * (high - low)


def coloured(counts: Any) -> Any:
    """Colours of an image, stronger where more runs lie."""
    image = np.zeros((*counts.shape, 4), dtype=np.uint8)
    most = max(float(counts.max()), 2.0)
    strength = np.log1p(counts) / np.log1p(most)
    image[..., :3] = BLUE
    image[..., 3] = np.where(counts > 0, FAINTEST + (255 - FAINTEST) * strength, 0)
    return image.view(np.uint32).reshape(counts.shape)


def labelled(name: str, unit: str) -> str:
    """Label of an axis."""
    return f"{name} / {unit}" if unit not in ("", "1") else name


def drawn(many: Many, plots: Plots, key: str) -> Iterator[Markup]:
    """All plots, a row of them for each metric."""
    chosen, note = panels(many)
    if not chosen:
        return
    drawer = Drawer(many, chosen)
    yield element("p", element("small", note + hint(drawer)), of="hint")
    for k, (metric, factors) in enumerate(chosen.items()):
        parts = [plots.placed(drawer.alone(metric), f"{key}-m{k}")]
        parts += [plots.placed(drawer.over(metric, f), f"{key}-m{k}-{j}") for j, f in enumerate(factors)]
        yield joined((element("h4", many.label(metric)), element("div", *parts, of="grid")))


def hint(drawer: Drawer) -> str:
    """What the plots show and how they are read."""
    bars = f"Where a parameter has at most {summary.MOST_LEVELS} values, each has {RANGE}. "
    axes = "Of more than 1000 runs, axes of histograms and counts leave out the outermost thousandths; tables do not."
    if drawer.is_counted:
        return f"Stronger where more runs lie. {bars}{axes}"
    return f"A point is a run; chosen in one plot (box select), it is marked in all of them. {bars}{axes}"
