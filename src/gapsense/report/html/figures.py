"""Panels, strips and tubes as figures of Bokeh, which share a time axis and its cursor."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import bokeh.models
import numpy as np
from bokeh.document import Document
from bokeh.plotting import figure

from gapsense.cosim.result.compare import Difference
from gapsense.problems import format_limits
from gapsense.report.html import style
from gapsense.report.html.curves import Curve, Panel, Strip, Vector, choose_rows
from gapsense.report.html.subject import Shown
from gapsense.report.table import choose_prefix

bk: Any = bokeh.models  # whose annotations lack much of it
LEFT = 64  # pixels for the numbers of the y-axis, so that all panels have the same width
EVENT = "#8f6a00"
HEIGHT, LOW, ROW = 208, 168, 34  # heights of a panel, of a panel of errors, of a strip [pixels]
TUBE = ("baseline, with its tolerance", "this run", "outside of the tolerance")
GAP = 6  # steps without a value
WIDE = 0.04  # of the time axis: shorter pieces of a strip have no number in them


@dataclass(frozen=True)
class Axes:
    """What all figures of a result have in common; times in them are `factor` times those in seconds."""

    range: Any  # Range1d
    cursor: Any  # Span
    factor: float
    unit: str
    events: tuple[tuple[float, float], ...]  # begin and end of each [s]
    numbers: Mapping[str, int]  # of components, which have a colour each
    most: int  # points of a curve


def make_time_axis(shown: Shown, numbers: Mapping[str, int], most: int) -> Axes:
    """Make the time axis of a result, in the unit that suits its span."""
    run, (first, last) = shown.result.run, shown.result.times[[0, -1]].tolist()
    factor, unit = choose_prefix(max(abs(first), abs(last)), "s")
    last = last if last > first else first + factor
    ends = {"start": first / factor, "end": last / factor}
    cursor = bk.Span(dimension="height", line_color=style.AXES, line_width=1)
    bounds = (ends["start"], ends["end"])
    return Axes(
        range=bk.Range1d(**ends, bounds=bounds),
        cursor=cursor,
        factor=1.0 / factor,
        unit=unit,
        events=tuple((e.begin, run.stop if e.end is None else e.end) for e in shown.result.events),
        numbers=numbers,
        most=most,
    )


def empty(axes: Axes, height: int) -> Any:
    """A figure without curves."""
    zoom, borders = bk.BoxZoomTool(dimensions="width"), {"min_border_left": LEFT, "min_border_right": 16}
    of_time = {"x_range": axes.range, "toolbar_location": "right", "lod_threshold": None, **borders}
    made = blank(height, [zoom, *tools(axes)], axes.unit, **of_time)
    made.toolbar_inner, made.y_range.only_visible = True, True
    for begin, end in axes.events:
        ends = {"left": begin * axes.factor, "right": end * axes.factor}
        look = {"fill_color": EVENT, "fill_alpha": 0.15, "line_color": EVENT, "level": "underlay"}
        made.add_layout(bk.BoxAnnotation(**ends, **look))
    return made


def blank(height: int, tools: list[Any], unit: str = "", **more: Any) -> Any:
    """A figure without curves, with tools of which the first one answers to dragging."""
    clear: dict[str, Any] = dict.fromkeys(("background_fill_color", "border_fill_color", "outline_line_color"))
    made: Any = figure(
        height=height,
        sizing_mode="stretch_width",
        tools=tools,
        active_drag=tools[0],
        active_scroll=None,
        output_backend="canvas",
        **clear,
        **more,
    )
    made.toolbar.logo, made.toolbar.autohide = None, True
    dress(made, unit)
    return made


def tools(axes: Axes) -> list[Any]:
    """Tools besides dragging to zoom. The wheel scrolls the page until the user chooses it for zooming."""
    moves = [bk.PanTool(dimensions="width"), bk.WheelZoomTool(dimensions="width")]
    return [*moves, bk.ResetTool(), bk.SaveTool(), bk.CrosshairTool(overlay=axes.cursor)]


def dress(made: Any, unit: str) -> None:
    """Thin lines, and labels without formatting."""
    made.grid.grid_line_color = style.GRID
    made.axis.axis_line_color = made.axis.major_tick_line_color = style.AXES
    made.axis.minor_tick_line_color = None
    made.axis.major_label_text_color = made.axis.axis_label_text_color = style.INK
    made.axis.major_label_text_font = made.axis.axis_label_text_font = "system-ui, sans-serif"
    made.axis.axis_label_text_font_style = "normal"
    made.yaxis.ticker.desired_num_ticks = 4
    made.xaxis.axis_label = f"time / {unit}" if unit else None


class Entry(NamedTuple):
    """A curve in the legend of a figure; its renderers, if it has any, have the name `key`."""

    key: str
    label: str
    colour: str
    dash: tuple[int, ...] = ()
    is_band: bool = False


class Drawn(NamedTuple):
    """A figure with its legend and the label of its axis; `key` is its place on the page."""

    figure: Any
    key: str
    label: str
    unit: str = ""
    legend: tuple[Entry, ...] = ()
    remark: str = ""


def panel(of: Panel, axes: Axes, key: str) -> Drawn:
    """Curves over time, with their bands."""
    made = empty(axes, LOW if of.is_error else HEIGHT)
    scale, unit = fitting(of.unit, *(curve.values for curve in of.curves))
    legend, shown, rows = [], 0, 0
    for k, (curve, entry) in enumerate(zip(of.curves, entries(of, axes, key))):
        chosen = choose_rows(curve.values, axes.most)
        half = None if curve.band is None else curve.band[chosen]
        part = replace(curve, times=curve.times[chosen], values=curve.values[chosen], band=half)
        # Each line is thinner than the one before, so that curves that coincide are all visible.
        width = 4.5 if curve.is_truth else 1.1 + 1.1 * (len(of.curves) - 1 - k) / len(of.curves)
        draw(made, part, entry, axes, scale, of.is_error, width)
        legend.append(entry)
        shown, rows = max(shown, chosen.size), max(rows, curve.values.size)
    # The upright axis follows the curves, not their bands, which may be much wider.
    made.y_range.renderers = [r for r in made.renderers if not isinstance(r.glyph, bk.VAreaStep)]
    remark = "; ".join(filter(None, (of.note, few(shown, rows))))
    return Drawn(figure=made, key=key, label=of.title, unit=unit, legend=tuple(legend), remark=remark)


def few(shown: int, rows: int) -> str:
    """A remark, if not all rows of a record are drawn."""
    return f"{shown} of {rows} points, least and greatest of each piece" if shown < rows else ""


def fitting(unit: str, *signals: Vector) -> tuple[float, str]:
    """Factor and unit in which the largest value has few digits."""
    if unit in ("", "1"):
        return 1.0, ""
    sizes = [np.abs(values[np.isfinite(values)]).max(initial=0.0) for values in signals]
    factor, shown = choose_prefix(float(max(sizes, default=0.0)), unit)
    return 1.0 / factor, shown


def entries(of: Panel, axes: Axes, key: str) -> Iterator[Entry]:
    """Legend of a panel: a colour per component, another stroke for its second curve, truths in the colour of text."""
    seen: dict[str, int] = {}
    for k, curve in enumerate(of.curves):
        turn = seen[curve.component] = seen.get(curve.component, -1) + (0 if curve.is_truth else 1)
        number = axes.numbers[curve.component]
        colour = style.INK if curve.is_truth else style.colour(number)
        dash = () if curve.is_truth else style.dash(number, turn)
        yield Entry(key=f"{key}-{k}", label=curve.name, colour=colour, dash=dash, is_band=curve.band is not None)


def draw(
    made: Any, curve: Curve, entry: Entry, axes: Axes, scale: float, is_error: bool, line_width: float = 1.4
) -> None:
    """One curve; the band of an error is around zero."""
    curve = curve if curve.is_held else break_at_gaps(curve)
    x, y = short(curve.times * axes.factor), short(curve.values * scale)
    if curve.band is not None:
        middle = 0.0 if is_error else y
        area(made, x, middle - curve.band * scale, middle + curve.band * scale, entry)
    line = {"color": entry.colour, "name": entry.key, "line_width": line_width, "line_dash": list(entry.dash)}
    if curve.is_held:
        made.step(x, y, mode="after", **line)
    else:
        made.line(x, y, **line)


def break_at_gaps(curve: Curve) -> Curve:
    """Break a curve where no values are; NaN makes a gap."""
    apart = np.diff(curve.times)
    gaps = 1 + np.flatnonzero(apart > GAP * np.median(apart)) if apart.size else apart.astype(np.intp)
    values = np.insert(curve.values, gaps, np.nan)
    half = None if curve.band is None else np.insert(curve.band, gaps, np.nan)
    return replace(curve, times=np.insert(curve.times, gaps, curve.times[gaps]), values=values, band=half)


def area(made: Any, x: Vector, low: Vector, high: Vector, entry: Entry) -> None:
    """A band."""
    fill = {"fill_color": entry.colour, "fill_alpha": 0.16, "name": entry.key}
    made.varea_step(x, short(low), short(high), step_mode="after", **fill)


def short(values: Any) -> Any:
    """Numbers rounded to what a picture can show."""
    return np.asarray(values, dtype=np.float32)


def strips(of: Sequence[Strip], axes: Axes, key: str) -> Drawn:
    """A row for each signal, with a piece in the colour of each value; below all other figures."""
    made = empty(axes, ROW * len(of) + 50)
    made.y_range, made.yaxis.visible, made.ygrid.visible = bk.Range1d(0.0, float(len(of))), False, False
    for k, strip in enumerate(of):
        place(made, strip, len(of) - 1 - k, axes)
    values = sorted({float(v) for strip in of for v in strip.values})
    legend = tuple(Entry("", f"{value:g}", colour_of(value)) for value in values)
    return Drawn(figure=made, key=key, label="modes, flags and codes", legend=legend)


def place(made: Any, strip: Strip, row: int, axes: Axes) -> None:
    """One row of strips, its name above."""
    left = strip.times * axes.factor
    right = np.append(left[1:], strip.end * axes.factor)
    for value in np.unique(strip.values):
        own = strip.values == value
        ends = {"left": left[own], "right": right[own], "bottom": row + 0.12, "top": row + 0.5}
        made.quad(**ends, fill_color=colour_of(float(value)), line_color=None)
    wide = right - left > WIDE * (axes.range.end - axes.range.start)
    texts = [f"{value:g}" for value in strip.values[wide]]
    text = {"text_font_size": "10px", "text_baseline": "middle", "text_align": "center", "text_color": "#ffffff"}
    made.text(0.5 * (left + right)[wide], [row + 0.31] * len(texts), texts, **text)
    name = {"text_font_size": "11px", "text_color": style.INK, "text_font": "system-ui, sans-serif"}
    made.add_layout(bk.Label(x=2, x_units="screen", y=row + 0.54, text=strip.name, **name))


def colour_of(value: float) -> str:
    """Colour of a value in strips."""
    return style.VALUES[int(value) % len(style.VALUES)]


def tube(of: Difference, axes: Axes, key: str) -> tuple[Drawn, Drawn]:
    """A signal in its tube, and below its difference in the band that is allowed; failing points are marked."""
    over, under = empty(axes, HEIGHT), empty(axes, LOW)
    whole = of.values, of.reference, *of.tube
    less = tuple(values - of.reference for values in whole)
    remark = few(min(axes.most, of.times.size), of.times.size)
    scale, unit = fitting(of.unit, *whole[:2])
    factor, small = fitting(of.unit, *less)
    legend = draw_tube(over, of, whole, axes, scale, key)
    below = draw_tube(under, of, less, axes, factor, f"{key}d")
    title = f"{of.name}, difference to the baseline"
    return (
        Drawn(figure=over, key=key, label=of.name, unit=unit, legend=legend, remark=remark),
        Drawn(figure=under, key=f"{key}d", label=title, unit=small, legend=below, remark=remark),
    )


def draw_tube(
    made: Any, of: Difference, what: Sequence[Vector], axes: Axes, scale: float, key: str
) -> tuple[Entry, ...]:
    """Signal, reference, and the tube around it; the rows outside."""
    colours = (style.INK, style.CURVES[0], style.FAIL)
    base, own, bad = (Entry(f"{key}-{k}", name, colour) for k, (name, colour) in enumerate(zip(TUBE, colours)))
    rows, failing = choose_rows(of.values - of.reference, axes.most), np.flatnonzero(of.failing)
    values, reference, low, high = what
    area(made, short(of.times[rows] * axes.factor), low[rows] * scale, high[rows] * scale, base)
    for entry, curve in ((base, reference), (own, values)):
        draw(made, Curve("", of.times[rows], curve[rows]), entry, axes, scale, is_error=False)
    if not failing.size:
        return base, own
    failing = failing[choose_rows(values[failing], axes.most)]
    at = short(of.times[failing] * axes.factor), short(values[failing] * scale)
    made.scatter(*at, marker="x", size=7, line_width=1.5, color=bad.colour, name=bad.key)
    return base, own, bad


def embed_figures(drawn: Sequence[Drawn]) -> dict[str, Any]:
    """Embed all figures as one Bokeh document, which `page.js` draws, and the place of each figure by its model."""
    if not drawn:
        return {}
    document, ids = Document(), dict[str, str]()
    with document.models.freeze():  # else it goes through all models after each figure: 26 s for 48 of them
        for one in drawn:
            document.add_root(one.figure)
    made = number_models(document.to_json(deferred=False), ids)
    return {"document": made, "places": {ids[one.figure.id]: one.key for one in drawn}}


def number_models(node: Any, ids: dict[str, str]) -> Any:
    """Number the models of a document from 1, so that the same result gives the same file."""
    if isinstance(node, list):
        return [number_models(one, ids) for one in node]
    if isinstance(node, dict):  # a model, or a reference to one; our own data has no such keys
        return {
            k: ids.setdefault(v, f"m{len(ids) + 1}") if k == "id" else number_models(v, ids) for k, v in node.items()
        }
    return node


# What a chapter of the page says first, and how its bounds are written.


class Verdict(NamedTuple):
    """Outcome of a run in a few words, and whether it is good."""

    passed: bool
    sentences: tuple[str, ...]
    words: tuple[str, str] = ("passed", "failed")

    @property
    def word(self) -> str:
        """The verdict as one word."""
        return self.words[not self.passed]


class Chapter(NamedTuple):
    """A result on the page: a template, the values that it needs, and its figures."""

    key: str
    title: str
    name: str
    about: str
    verdict: Verdict
    template: str
    content: Mapping[str, Any]
    figures: tuple[Drawn, ...]


def limits(bounds: tuple[float, float] | None, shown: Callable[[float], str]) -> str:
    """Bounds in words, each as `shown` writes it."""
    low, high = (shown(end) if math.isfinite(end) else None for end in bounds or (-math.inf, math.inf))
    return format_limits(low, high, "")
