"""Many runs as a chapter of the page: what the template `many.html` asks for."""

from __future__ import annotations

import json
import math
import shlex
from collections.abc import Iterator, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

import bokeh.models
import numpy as np

from gapsense.many import summary
from gapsense.many.provenance import EVENTS
from gapsense.problems import number_of
from gapsense.report.distributions import Bars, Distributions, name_level
from gapsense.report.html import style
from gapsense.report.html.figures import Chapter, Drawn, Entry, Verdict, blank, fitting, limits
from gapsense.report.html.many import Many
from gapsense.tables import parsed_value

if TYPE_CHECKING:
    from gapsense.many.summary import Extremes, Worst

bk: Any = bokeh.models
FEW = 500  # points, which are drawn strongly
PANELS = 64  # on a page
METRICS = 16  # that are drawn
HEIGHT = 230  # [pixels]
MEDIAN, BOUNDS, RANGE = Entry("", "median", style.INK), Entry("", "bounds", style.BOUND), "median and 5 to 95 %"
BLUE = (58, 143, 208)  # seen on light and on dark ground
FAINTEST = 60  # of 255, where a single run lies
LONG_NAME, SLOPE = 5, 0.6  # characters of values that stand upright below an axis, and the slope of longer ones [rad]
BENT = 0.2  # share of a metric that must go with a parameter, if it does not so in one direction


def chapter_of_many(many: Many, key: str) -> Chapter:
    """Everything about a campaign or a sweep."""
    about, tables = many.about, dict[str, list[str]]()
    for name in many.extremes:
        tables.setdefault(many.labels[name][0], []).append(name)
    figures, hint = draw_all(many, key)
    content = {
        "many": many,
        "seeds": ", ".join(f"{name} {seed}" for name, seed in about.get("seeds", {}).items()),
        "settings": ", ".join(f"{name} = {value}" for name, value in about.get("settings", {}).items()),
        "tables": tables,
        "worst": [(metric, one) for metric, found in many.extremes.items() for one in telling(found)],
        "figures": figures,
        "hint": hint,
        "limits": lambda name: limits(many.bounds(name), partial(many.format_value, name)),
        "goes_with": partial(goes_with, many),
        "levels": lambda name: "many" if (found := many.levels[name]) is None else ", ".join(map(name_level, found)),
        "named": partial(run_name, many),
        "repeated": partial(make_command, many),
        "why": partial(why, many),
    }
    return Chapter(
        key=key,
        title=f"{about['title']}: {many.kind}",
        name=many.file.stem,
        about=about.get("description", ""),
        verdict=verdict(many),
        template="many.html",
        content=content,
        figures=tuple(one for own in figures.values() for one in own),
    )


def verdict(many: Many) -> Verdict:
    """What came of all runs: complete if each is there and none failed; bounds are those of the scenario as it is."""
    of = many.campaign
    missing, sentences = of.runs - of.rows, []
    if missing > 0:
        sentences.append(f"{missing} of {of.runs} runs are missing: run the same command to continue.")
    if of.failed:
        sentences.append(f"{number_of(of.failed, 'run')} failed.")
    if not sentences:
        sentences.append(f"All {of.runs} runs are complete, none failed.")
    words = ("complete", "incomplete")
    return Verdict(missing <= 0 and not of.failed, (*sentences, *of_bounds(many)), words)


def of_bounds(many: Many) -> Iterator[str]:
    """Sentences on the bounds of the metrics, and on metrics without a value."""
    bounded = [name for name in many.extremes if many.bounds(name)]
    outside = [name for name in bounded if many.extremes[name].outside]
    many_bounded = number_of(len(bounded), "metric")
    if outside:
        yield f"{many_bounded} with bounds, {len(outside)} outside of them in some runs."
    elif bounded:
        yield f"{many_bounded} with bounds, within them in all runs that have a value."
    if gaps := [name for name in many.extremes if many.spreads[name].missing > many.campaign.failed]:
        yield f"{number_of(len(gaps), 'metric')} without a value in some runs that did not fail."


def run_name(many: Many, run: int) -> str:
    """A run, and what it adds to every seed."""
    shift = many.rows[run]["seed"]
    return f"{run}" if not many.about.get("seeds") or shift is None else f"{run} (seeds + {shift})"


def goes_with(many: Many, name: str) -> str:
    """What a metric goes with most: a correlation, unless it goes up and down with another parameter."""
    found = many.correlations.get(name, ())
    if not found or not found[0].correlation:
        return "-"
    bent = max(found, key=lambda one: one.share)
    if bent.share > max(BENT, 2.0 * found[0].correlation ** 2):
        return f"{bent.factor}, up and down"
    return f"{found[0].factor} {found[0].correlation:+.2f}"


def telling(found: Extremes) -> tuple[Worst, ...]:
    """Runs of a metric that are worth a row: of those within the bounds, the nearest to a bound."""
    return found.worst if not found.worst or found.worst[0].beyond > 0.0 else found.worst[:1]


def why(many: Many, metric: str, beyond: float) -> tuple[str, bool]:
    """Why a run is listed: where its value lies, and whether that is outside of the bounds."""
    if many.bounds(metric) is None:
        return f"{many.format_value(metric, beyond)} from the median", False
    if beyond <= 0.0:
        return "inside" if math.isinf(beyond) else f"inside by {many.format_value(metric, -beyond)}", False
    return f"outside by {many.format_value(metric, beyond)}", True


# How a single run is repeated -----------------------------------------------------------------------------------------


def make_command(many: Many, run: int) -> str:
    """Make the command that repeats a run; or a line of Python, if no option of a command can express it."""
    about, row = many.about, many.rows[run]
    if not many.scenario:
        return f"the scenario has no file: run it with seed_shift={row['seed']}"
    values = {name: row[name] for name in many.campaign.factors}
    if about.get("has_random_events") or any(name.startswith(EVENTS) for name in values):
        return in_python(many, run, row["seed"], values)
    seeds = {f"{name}.seed": seed + row["seed"] for name, seed in about.get("seeds", {}).items()}
    given = {**about.get("settings", {}), **seeds, **values}
    own = ["--variant", about["variant"]] if about.get("variant") else []
    return shlex.join(["gapsense", "run", many.scenario, *own, *(w for s in settings(given) for w in ("--set", s))])


def settings(values: Mapping[str, Any]) -> Iterator[str]:
    """Values as `--set` reads them back; a text is in quotes where it would mean something else."""
    for name, value in values.items():
        is_plain = isinstance(value, str) and parsed_value(value) == value
        yield f"{name}={value if is_plain else json.dumps(value)}"


def in_python(many: Many, run: int, shift: int, values: Mapping[str, Any]) -> str:
    """The same in Python, where all seeds are shifted, and a sweep has its values by their number."""
    about, is_sweep = many.about, many.kind == "sweep"
    given = list(settings(about.get("settings", {}) if is_sweep else values))
    scenario = f"changed({many.scenario!r}, {given!r})" if given else repr(many.scenario)
    own = [f"{about['variant']!r}"] if about.get("variant") else []
    point = [f"point={run % about['points']}"] if is_sweep else []
    return f"run({', '.join([scenario, *own, f'seed_shift={shift}', *point])})"


# Plots of many runs: how each metric is distributed, and how it goes with each parameter.


def panels(many: Many) -> tuple[dict[str, list[str]], str]:
    """Metrics that leave their bounds first, each over the parameters that it goes with most; a note on the others."""
    known = [name for name in many.extremes if many.campaign.rows - many.spreads[name].missing > 0]
    metrics = sorted(known, key=lambda name: not many.extremes[name].outside)[:METRICS]
    factors = [f for f in many.campaign.factors if f in many.spreads or many.levels[f] is not None]
    room = max(1, PANELS // max(len(metrics), 1) - 1)
    chosen = {name: order_factors(many, name, factors)[:room] for name in known if name in metrics}
    words = f"{len(metrics)} of {len(many.extremes)} metrics are drawn"
    if len(factors) > room:
        return chosen, f"{words}, each over the {room} of {len(factors)} parameters that it depends on most. "
    return chosen, f"{words}. " if len(metrics) < len(many.extremes) else ""


def order_factors(many: Many, metric: str, factors: list[str]) -> list[str]:
    """Order parameters: first those that are no numbers, then by how strongly the metric depends on them."""
    known = sorted(many.correlations.get(metric, ()), key=lambda one: -one.share)
    numbers = [one.factor for one in known if one.factor in factors]
    return [*(name for name in factors if name not in numbers), *numbers]


class Drawer:
    """Draws the panels of many runs, with what they have in common."""

    def __init__(self, many: Many, chosen: dict[str, list[str]]) -> None:
        self.many, self.found = many, Distributions(many.campaign, chosen, many.levels)
        self.scales = {name: fitting(many.unit(name), np.array(of[1:6])) for name, of in many.spreads.items()}
        names = [] if self.found.is_counted else [*self.found.continuous, *chosen]
        self.keys = {name: f"c{k}" for k, name in enumerate(names)}
        self.source = None if self.found.is_counted else self.points()

    def points(self) -> Any:
        """Runs as points. All plots share them: a run that is selected in one plot is selected in all."""
        column = self.many.campaign.column
        data = {
            key: (column(name).astype(np.float64) * self.scales[name][0]).astype(np.float32)
            for name, key in self.keys.items()
        }
        return bk.ColumnDataSource({"run": column("run").astype(np.int32), **data})

    def alone(self, metric: str, key: str) -> Drawn:
        """Histogram of a metric, with its median and bounds."""
        bins, counts = self.found.alone(metric)
        (scale, unit), made = self.scales[metric], bare()
        edges = bins * scale
        fill = {"fill_color": style.CURVES[0], "fill_alpha": 0.55, "line_color": None}
        made.quad(left=edges[:-1], right=edges[1:], top=counts, bottom=0.0, **fill)
        line(made, self.many.spreads[metric].median * scale, MEDIAN)
        ends = self.bounds(metric)
        for end in ends:
            line(made, end, BOUNDS)
        made.y_range.start, made.xaxis.axis_label = 0, make_label(self.many.label(metric), unit)
        low, high = span(edges[0], edges[-1], ends)
        made.x_range = bk.Range1d(low, high)
        legend = (MEDIAN, BOUNDS) if any(low <= end <= high for end in ends) else (MEDIAN,)
        return Drawn(figure=made, key=key, label="how many runs", legend=legend)

    def bounds(self, metric: str) -> list[float]:
        """Bounds of a metric that are finite, as they are drawn."""
        return [end * self.scales[metric][0] for end in self.many.bounds(metric) or () if np.isfinite(end)]

    def over(self, metric: str, factor: str, key: str) -> Drawn:
        """A metric over a parameter: bars, points, or where no run lies nothing and more colour where many do."""
        made, found, scale = bare(), self.found.over(metric, factor), self.scales[metric][0]
        unit = self.many.unit(factor)
        if isinstance(found, Bars):
            bars(made, found, scale)
        elif found is None:
            a, b = self.keys[factor], self.keys[metric]
            look = {"alpha": 0.8 if self.many.campaign.rows < FEW else 0.45, "selection_alpha": 1.0}
            # Points that are not selected are faint once some are.
            made.scatter(a, b, source=self.source, size=5, color=style.CURVES[0], nonselection_alpha=0.08, **look)
            told = [("run", "@run"), ("parameter", f"@{a}"), ("metric", f"@{b}")]
            made.add_tools(bk.HoverTool(tooltips=told), bk.BoxSelectTool())
        else:
            x, y = found.x * self.scales[factor][0], found.y * scale
            box = {"x": x[0], "y": y[0], "dw": x[-1] - x[0], "dh": y[-1] - y[0]}
            made.image_rgba(image=[colour_counts(found.counts.T)], **box)
            made.x_range, made.y_range = bk.Range1d(x[0], x[-1]), bk.Range1d(y[0], y[-1])
        if not isinstance(found, Bars) and factor in self.scales:
            unit = self.scales[factor][1]
        for end in self.bounds(metric):
            line(made, end, BOUNDS, "width")
        made.xaxis.axis_label = make_label(factor, unit)
        label = make_label(self.many.label(metric), self.scales[metric][1])
        return Drawn(figure=made, key=key, label=f"{label} over {factor}")


def bars(made: Any, found: Bars, scale: float) -> None:
    """Median and 5 to 95 % range at each value of a parameter, to scale."""
    places, quantiles = found.places, found.quantiles * scale
    bar = {"line_color": style.CURVES[0], "line_width": 5, "line_alpha": 0.5}
    made.segment(places, quantiles[:, 0], places, quantiles[:, 2], **bar)
    made.scatter(places, quantiles[:, 1], size=8, color=style.CURVES[0])
    made.xaxis.ticker = bk.FixedTicker(ticks=places[found.labelled].tolist())
    made.xaxis.major_label_overrides = {float(places[k]): found.names[k] for k in found.labelled}
    if max(len(found.names[k]) for k in found.labelled) > LONG_NAME:
        made.xaxis.major_label_orientation = SLOPE
    margin = 0.1 * float(np.ptp(places)) or 0.6
    made.x_range = bk.Range1d(float(places.min()) - margin, float(places.max()) + margin)


def bare() -> Any:
    """An empty figure."""
    tools = [bk.BoxZoomTool(), bk.PanTool(), bk.WheelZoomTool(), bk.ResetTool(), bk.SaveTool()]
    made = blank(HEIGHT, tools, toolbar_location="above")
    made.xaxis.ticker.desired_num_ticks = 4
    return made


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


def colour_counts(counts: Any) -> Any:
    """Colour an image, stronger where more runs lie."""
    image = np.zeros((*counts.shape, 4), dtype=np.uint8)
    most = max(float(counts.max()), 2.0)
    strength = np.log1p(counts) / np.log1p(most)
    image[..., :3] = BLUE
    image[..., 3] = np.where(counts > 0, FAINTEST + (255 - FAINTEST) * strength, 0)
    return image.view(np.uint32).reshape(counts.shape)


def make_label(name: str, unit: str) -> str:
    """Make the label of an axis."""
    return f"{name} / {unit}" if unit not in ("", "1") else name


def draw_all(many: Many, key: str) -> tuple[dict[str, list[Drawn]], str]:
    """Draw all plots, a row of them for each metric, and how they are read."""
    chosen, note = panels(many)
    if not chosen:
        return {}, ""
    drawer = Drawer(many, chosen)
    rows = {
        metric: [
            drawer.alone(metric, f"{key}-m{k}"),
            *(drawer.over(metric, factor, f"{key}-m{k}-{j}") for j, factor in enumerate(factors)),
        ]
        for k, (metric, factors) in enumerate(chosen.items())
    }
    how = "A point is a run; chosen in one plot (box select), it is marked in all of them."
    how = "Stronger where more runs lie." if drawer.found.is_counted else how
    bars = f"Where a parameter has at most {summary.MOST_LEVELS} values, each has {RANGE}."
    axes = "Of more than 1000 runs, axes of histograms and counts leave out the outermost 0.1 %; tables do not."
    return rows, f"{note}{how} {bars} {axes}"
