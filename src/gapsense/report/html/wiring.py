"""The wiring picture: components in the order in which they step, their connections, as inline SVG."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from gapsense.cosim.result.result import Run
from gapsense.report.html.layout import HEAD, LANE, PAD, Box, Boxes, Wire, arranged
from gapsense.report.html.style import colour, variable
from gapsense.report.table import quantity

MARGIN = 12.0
KINDS = {
    "direct": "to an input with direct feedthrough: the value of the same time",
    "held": "to an input without direct feedthrough: it acts after the step",
    "delayed": "delayed: the value of one step before",
}


def picture(run: Run) -> str:
    """SVG of all components and connections; empty where the result does not tell its connections."""
    heads = {name: head(run, k, name) for k, name in enumerate(run.order, 1)}
    wires = [wire(run, text) for text in run.wires]
    if not wires:
        return ""
    boxes, ways = arranged(heads, wires)
    deepest = max(box.y + box.height for box in boxes.values())
    returns = [w for w, names in ways if not names]
    width = max(box.x + box.width for box in boxes.values()) + 2 * MARGIN
    height = deepest + LANE * (len(returns) + 1) + 2 * MARGIN
    numbers = {name: k for k, name in enumerate(run.order)}
    drawn = [line(w, names, boxes, numbers, deepest + LANE * (1 + place(w, returns))) for w, names in ways]
    shapes = "".join([*dict.fromkeys(drawn), *(shape(box) for box in boxes.values() if box.heads)])
    size = f'width="{width:.0f}" height="{height:.0f}" viewBox="{-MARGIN} {-MARGIN} {width:.0f} {height:.0f}"'
    return f'<svg class="wiring" {size} role="img" aria-label="{escape(told(run), quote=True)}">{shapes}</svg>'


def told(run: Run) -> str:
    """The picture in words."""
    return f"Wiring. Components in the order in which they step: {', '.join(run.order)}. {'; '.join(run.wires)}."


def head(run: Run, number: int, name: str) -> tuple[str, ...]:
    """Name of a component, and its FMU with its step."""
    facts = run.components[name]
    step = quantity(facts["step"] * run.base_step, "s")
    later = f", first at {quantity(facts['offset'] * run.base_step, 's')}" if facts["offset"] else ""
    return f"{number}. {name}", f"{facts['fmu'].removesuffix('.fmu')}, {step}{later}"


def wire(run: Run, text: str) -> Wire:
    """A connection as the result tells it."""
    source, target = (tuple(end.split(".", 1)) for end in text.split(" -> ", 1))
    kind = "delayed" if text in run.delayed else "direct" if text in run.direct else "held"
    return Wire((source[0], source[1]), (target[0], target[1]), kind)


def place(w: Wire, wires: Sequence[Wire]) -> int:
    """Number of a wire, 0 for one that is not among them."""
    return wires.index(w) if w in wires else 0


def line(w: Wire, names: Sequence[str], boxes: Boxes, numbers: dict[str, int], depth: float) -> str:
    """A wire with its arrow; one that goes back passes below all boxes."""
    source, target = boxes[w.source[0]], boxes[w.target[0]]
    x, y = source.x + source.width, source.port(w.source[1], is_input=False)
    end = target.x, target.port(w.target[1], is_input=True)
    if names:
        path = f"M{x:.1f} {y:.1f}" + through(x, y, [boxes[name] for name in names[1:-1]], end)
    else:
        path = around(x, y, *end, depth)
    ends = ".".join(w.source), ".".join(w.target)
    texts = f"<title>{escape(f'{ends[0]} to {ends[1]}, {KINDS[w.kind]}')}</title>"
    stroke = variable(colour(numbers[w.source[0]]))
    tip = f'<path class="tip" style="fill:{stroke}" d="M{end[0]:.1f} {end[1]:.1f}l-7 -3.5v7z"/>'
    return f'<g><path class="wire {w.kind}" style="stroke:{stroke}" d="{path}"/>{tip}{texts}</g>'


def through(x: float, y: float, lanes: Sequence[Box], end: tuple[float, float]) -> str:
    """Path from a point through lanes to the end."""
    path = ""
    for lane in lanes:
        path += curve(x, y, lane.x, lane.port("", True)) + f"h{lane.across:.1f}"
        x, y = lane.x + lane.across, lane.port("", True)
    return path + curve(x, y, *end)


def curve(x: float, y: float, to_x: float, to_y: float) -> str:
    """Smooth way to a point, level at both ends."""
    bend = max(24.0, 0.5 * (to_x - x))
    return f"C{x + bend:.1f} {y:.1f} {to_x - bend:.1f} {to_y:.1f} {to_x:.1f} {to_y:.1f}"


def around(x: float, y: float, to_x: float, to_y: float, depth: float) -> str:
    """Way back, below everything."""
    out, back = x + 24, to_x - 24
    return f"M{x:.1f} {y:.1f}H{out:.1f}V{depth:.1f}H{back:.1f}V{to_y:.1f}H{to_x:.1f}"


def shape(box: Box) -> str:
    """A component with its ports."""
    parts = [f'<rect x="{box.x:.1f}" y="{box.y:.1f}" width="{box.width:.1f}" height="{box.height:.1f}" rx="4"/>']
    for k, text in enumerate(box.heads):
        parts.append(label(box.x + PAD, box.y + 16 + 15 * k, text, "name" if k == 0 else "fmu"))
    parts.append(f'<path class="rule" d="M{box.x:.1f} {box.y + HEAD - 4:.1f}h{box.width:.1f}"/>')
    parts += [label(box.x + PAD, box.port(name, True) + 4, name, "port") for name in box.inputs]
    right = box.x + box.width - PAD
    parts += [label(right, box.port(name, False) + 4, name, "port out") for name in box.outputs]
    return f"<g>{''.join(parts)}</g>"


def label(x: float, y: float, text: str, kind: str) -> str:
    """A text."""
    return f'<text class="{kind}" x="{x:.1f}" y="{y:.1f}">{escape(text)}</text>'


def kinds(run: Run) -> str:
    """The strokes of the picture, those that are in it."""
    found = {wire(run, text).kind for text in run.wires}
    sample = '<svg width="34" height="10" aria-hidden="true"><path class="wire {}" d="M1 5h32"/></svg>'
    shown = [f"<li>{sample.format(kind)} {escape(text)}</li>" for kind, text in KINDS.items() if kind in found]
    return f'<ul class="kinds">{"".join(shown)}</ul>'
