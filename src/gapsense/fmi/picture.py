"""The picture of a typical run on the page of a component: SVG from `typical.csv`, the same bytes on every machine."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Sequence
from html import escape
from pathlib import Path

from gapsense.fmi.ports import Component, Port
from gapsense.units import UNITS

FILE = "typical.csv"  # a comment that describes the run, a header with names and units, rows; optional
PANELS, CURVES = 4, 3  # at most
LEFT, PLOT, RIGHT, PANEL, GAP = 58, 352, 150, 96, 16  # of the picture, in its own units
ROUNDING = 1e-9
LEAST = 0.02  # range of a panel in its largest value: what hardly changes looks so
STEPS = tuple(float(f"{digit}e{power}") for power in range(-12, 13) for digit in (1, 2, 5))  # between marks


def signals_by_panel(component: Component) -> list[list[Port]]:
    """Signals by panel, one for a unit: what most names in it have in common; no times, deviations, optional inputs."""
    panels: dict[str, list[Port]] = {}
    for port in component.ports:
        is_extra = port.unit in ("1", "s") or port.is_optional or port.name.endswith("_std")
        if port.causality != "parameter" and not is_extra:
            panels.setdefault(port.unit, []).append(port)
    return [related_ports(ports)[:CURVES] for ports in panels.values()][:PANELS]


def related_ports(ports: Sequence[Port]) -> list[Port]:
    """A port and those named after it that are about as large, such as `smoothed_position`; as many as there are."""
    families = [
        [other for other in ports if port.name in other.name and 0.03 < other.nominal / port.nominal < 30.0]
        for port in ports
    ]
    return max(families, key=len)


def figure(component: Component, folder: Path) -> str:
    """The picture with its caption; nothing without a file, or for a component with nothing to draw."""
    panels = signals_by_panel(component)
    if not panels or not (folder / FILE).is_file():
        return ""
    with (folder / FILE).open(encoding="utf-8", newline="") as file:
        caption = file.readline().strip("# \n")
        header, *rows = csv.reader(file)
    names = [cell.partition(" [")[0] for cell in header]
    columns = {name: [float(row[k]) for row in rows] for k, name in enumerate(names)}
    said = re.sub("`(.+?)`", r"<code>\1</code>", escape(caption))
    return f"<figure>{svg(panels, columns)}\n<figcaption>{said}</figcaption></figure>\n"


def svg(panels: Sequence[Sequence[Port]], columns: dict[str, list[float]]) -> str:
    """One panel per unit over the same time."""
    times = [1e3 * t for t in columns["time"]]
    height = len(panels) * (PANEL + GAP) + 32
    parts = [
        f'<svg viewBox="0 0 {LEFT + PLOT + RIGHT} {height}" role="img" aria-label="{escape(describe(panels))}">',
        *(part for k, ports in enumerate(panels) for part in panel(ports, columns, times, GAP + k * (PANEL + GAP))),
    ]
    bottom = height - 32
    for mark in marks(times[0], times[-1], 6):
        parts.append(f'<text x="{across(mark, times):.1f}" y="{bottom + 16}" class="mid">{mark:g}</text>')
    parts.append(f'<text x="{LEFT + PLOT // 2}" y="{bottom + 30}" class="mid">time / ms</text></svg>')
    return "\n".join(parts)


def describe(panels: Sequence[Sequence[Port]]) -> str:
    """The text of the picture, for those who cannot see it."""
    return "Over time: " + ", ".join(port.name for ports in panels for port in ports)


def panel(ports: Sequence[Port], columns: dict[str, list[float]], times: list[float], top: int) -> Iterator[str]:
    """Grid, curves, their names beside, and the quantity above."""
    display = UNITS[ports[0].unit].display
    unit, factor = (display.name, display.factor) if display else (ports[0].unit, 1.0)
    curves = [[factor * value for value in columns[port.name]] for port in ports]
    low, high = min(map(min, curves)), max(map(max, curves))
    margin = max(0.0, 0.5 * (LEAST * max(abs(low), abs(high)) - (high - low))) or float(high == low)
    low, high = low - margin, high + margin

    def up(value: float) -> float:
        return top + PANEL * (high - value) / (high - low)

    for mark in marks(low, high, 4):
        yield f'<path d="M{LEFT} {up(mark):.1f}h{PLOT}" class="grid"/>'
        yield f'<text x="{LEFT - 6}" y="{up(mark) + 4:.1f}" class="end">{mark:g}</text>'
    shown = f"{min((port.name for port in ports), key=len).replace('_', ' ')} / {f'({unit})' if '/' in unit else unit}"
    yield f'<text transform="translate(12 {top + PANEL // 2}) rotate(-90)" class="mid">{escape(shown)}</text>'
    for k, (port, curve) in enumerate(zip(ports, curves)):
        points = " ".join(f"{across(t, times):.1f},{up(value):.1f}" for t, value in zip(times, curve))
        yield f'<polyline points="{points}" class="c{k}"/>'
        yield f'<text x="{LEFT + PLOT + 8}" y="{top + 12 + 15 * k}" class="c{k}">{escape(port.name)}</text>'


def across(time: float, times: list[float]) -> float:
    """Place of a time on the horizontal axis."""
    return LEFT + PLOT * (time - times[0]) / (times[-1] - times[0])


def marks(low: float, high: float, most: int) -> list[float]:
    """Round numbers from low to high, so many at most."""
    step = next(s for s in STEPS if (high - low) / s < most - ROUNDING)
    first, last = -int((ROUNDING - low / step) // 1.0), int((ROUNDING + high / step) // 1.0)
    return [k * step for k in range(first, last + 1)]
