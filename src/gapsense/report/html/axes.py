"""Empty figures that share a time axis and its cursor, drawn by Bokeh."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import bokeh.models
from bokeh.plotting import figure

from gapsense.report.html.style import AXES, GRID, INK
from gapsense.report.html.subject import Event, Shown
from gapsense.report.table import prefixed

bk: Any = bokeh.models  # whose annotations lack much of it
LEFT = 64  # pixels for the numbers of the upright axis, so that all panels have one width
EVENT = "#8f6a00"


@dataclass(frozen=True)
class Axes:
    """What all figures of a result have in common; times in them are `factor` times those in seconds."""

    range: Any  # Range1d
    cursor: Any  # Span
    factor: float
    unit: str
    events: tuple[Event, ...]
    numbers: Mapping[str, int]  # of components, which have a colour each
    most: int  # points of a curve


def shared(shown: Shown, numbers: Mapping[str, int], most: int) -> Axes:
    """The time axis of a result, in the unit that suits its span."""
    first, last = (float(shown.result.times[k]) for k in (0, -1))
    factor, unit = prefixed(max(abs(first), abs(last)), "s")
    last = last if last > first else first + factor
    ends = {"start": first / factor, "end": last / factor}
    cursor = bk.Span(dimension="height", line_color=AXES, line_width=1)
    bounds = (ends["start"], ends["end"])
    return Axes(
        range=bk.Range1d(**ends, bounds=bounds),
        cursor=cursor,
        factor=1.0 / factor,
        unit=unit,
        events=shown.events,
        numbers=numbers,
        most=most,
    )


def empty(axes: Axes, height: int, is_last: bool = False) -> Any:
    """A figure without curves."""
    zoom = bk.BoxZoomTool(dimensions="width")
    made: Any = figure(
        height=height,
        sizing_mode="stretch_width",
        x_range=axes.range,
        tools=[zoom, *tools(axes)],
        active_drag=zoom,
        active_scroll=None,
        toolbar_location="right",
        min_border_left=LEFT,
        min_border_right=16,
        background_fill_color=None,
        border_fill_color=None,
        outline_line_color=None,
        lod_threshold=None,
        output_backend="canvas",
    )
    made.toolbar.logo, made.toolbar.autohide, made.toolbar_inner = None, True, True
    made.y_range.only_visible = True
    dress(made, axes.unit if is_last else "")
    for event in axes.events:
        made.add_layout(box(event, axes.factor))
    return made


def tools(axes: Axes) -> list[Any]:
    """Tools besides dragging to zoom. The wheel scrolls the page until the user chooses it for zooming."""
    moves = [bk.PanTool(dimensions="width"), bk.WheelZoomTool(dimensions="width")]
    return [*moves, bk.ResetTool(), bk.SaveTool(), bk.CrosshairTool(overlay=axes.cursor)]


def dress(made: Any, unit: str) -> None:
    """Thin lines, and labels without formatting."""
    made.grid.grid_line_color = GRID
    made.axis.axis_line_color = made.axis.major_tick_line_color = AXES
    made.axis.minor_tick_line_color = None
    made.axis.major_label_text_color = made.axis.axis_label_text_color = INK
    made.axis.major_label_text_font = made.axis.axis_label_text_font = "system-ui, sans-serif"
    made.axis.axis_label_text_font_style = "normal"
    made.yaxis.ticker.desired_num_ticks = 4
    made.xaxis.axis_label = f"time / {unit}" if unit else None


def box(event: Event, factor: float) -> Any:
    """Shade over an event."""
    ends = {"left": event.begin * factor, "right": event.end * factor}
    return bk.BoxAnnotation(**ends, fill_color=EVENT, fill_alpha=0.15, line_color=EVENT, level="underlay")
