"""The wiring picture: components in the order in which they step, in columns by what drives what, and their wires.

Long wires go around the boxes. The template `wiring.svg` draws what is computed here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from gapsense.cosim.result.result import Run
from gapsense.report.html.style import colour
from gapsense.report.table import quantity

CHARACTER, LINE, HEAD, PAD = 6.7, 17.0, 40.0, 10.0  # widths and heights [pixels]
ACROSS, BETWEEN, LANE = 74.0, 22.0, 13.0  # room between columns, between boxes, and for a wire that passes them
SWEEPS = 6
MARGIN = 12.0
KINDS = {
    "direct": "to an input with direct feedthrough: the value of the same time",
    "held": "to an input without direct feedthrough: it acts after the step",
    "delayed": "delayed: the value of one step before",
}


class Label(NamedTuple):
    """A text of a box."""

    kind: str
    x: float
    y: float
    text: str


class Wire(NamedTuple):
    """A connection: component and variable at both ends; `kind` is direct, held or delayed."""

    source: tuple[str, str]
    target: tuple[str, str]
    kind: str


@dataclass
class Box:
    """A component, or, without lines in it, the place where a wire passes a column."""

    name: str
    column: int
    heads: tuple[str, ...] = ()
    inputs: list[str] = field(default_factory=list)
    outputs: list[str] = field(default_factory=list)
    x: float = 0.0
    y: float = 0.0
    across: float = 0.0  # width of its column

    @property
    def height(self) -> float:
        """Height [pixels]."""
        rows = max(len(self.inputs), len(self.outputs))
        return HEAD + LINE * rows + PAD / 2 if self.heads else LANE

    @property
    def width(self) -> float:
        """Width [pixels], by the longest texts."""
        sides = longest(self.inputs) + longest(self.outputs)
        return max(CHARACTER * sides + 3 * PAD, CHARACTER * longest(self.heads) + 2 * PAD) if self.heads else 0.0

    def port(self, name: str, is_input: bool) -> float:
        """Height at which a wire ends [pixels]."""
        if not self.heads:
            return self.y + LANE / 2
        names = self.inputs if is_input else self.outputs
        return self.y + HEAD + LINE * (names.index(name) + 0.35)

    @property
    def rule(self) -> float:
        """Height of the line between its heads and its ports [pixels]."""
        return self.y + HEAD - 4

    def labels(self) -> list[Label]:
        """Its texts."""
        left, right = self.x + PAD, self.x + self.width - PAD
        heads = [Label("fmu" if k else "name", left, self.y + 16 + 15 * k, text) for k, text in enumerate(self.heads)]
        inputs = [Label("port", left, self.port(name, True) + 4, name) for name in self.inputs]
        outputs = [Label("port out", right, self.port(name, False) + 4, name) for name in self.outputs]
        return [*heads, *inputs, *outputs]


Boxes = dict[str, Box]


class Line(NamedTuple):
    """A wire as it is drawn, with its arrow at the end."""

    kind: str
    colour: str
    path: str
    end: tuple[float, float]
    words: str


class Picture(NamedTuple):
    """The whole picture, and what its strokes mean."""

    width: float
    height: float
    words: str
    lines: list[Line]
    boxes: list[Box]
    kinds: list[tuple[str, str]]
    corner: float = -MARGIN


def longest(texts: Sequence[str]) -> int:
    """Characters of the longest text."""
    return max(map(len, texts), default=0)


def arrange_boxes(
    heads: Mapping[str, tuple[str, ...]], wires: Sequence[Wire]
) -> tuple[Boxes, list[tuple[Wire, list[str]]]]:
    """Give boxes their places, and each wire the boxes it passes, first to last; none if it goes back.

    The `heads` are the lines at the top of each component, in the order in which they step.
    """
    columns = columns_of(list(heads), wires)
    boxes = {name: Box(name, columns[name], lines) for name, lines in heads.items()}
    for name, port in dict.fromkeys(wire.source for wire in wires):
        boxes[name].outputs.append(port)
    for name, port in dict.fromkeys(wire.target for wire in wires):
        boxes[name].inputs.append(port)
    ways = [(wire, way(wire, boxes)) for wire in wires]
    stack_boxes(boxes, [names for _, names in ways if names])
    return boxes, ways


def columns_of(names: Sequence[str], wires: Sequence[Wire]) -> dict[str, int]:
    """Column of each component: to the right of all components that step before it and drive it."""
    place, columns = {name: k for k, name in enumerate(names)}, dict.fromkeys(names, 0)
    for name in names:
        before = [w.source[0] for w in wires if w.target[0] == name and place[w.source[0]] < place[name]]
        columns[name] = 1 + max((columns[source] for source in before if source in columns), default=-1)
    return columns


def way(wire: Wire, boxes: Boxes) -> list[str]:
    """Boxes that a wire goes through, with a lane in each column between; all wires of one output share them."""
    (source, port), target = wire.source, wire.target[0]
    first, last = boxes[source].column, boxes[target].column
    if first >= last:
        return []
    lanes = []
    for column in range(first + 1, last):
        name = f"{source} {port} {column}"
        boxes.setdefault(name, Box(name, column))
        lanes.append(name)
    return [source, *lanes, target]


def stack_boxes(boxes: Boxes, ways: Sequence[Sequence[str]]) -> None:
    """Give the boxes their places: in each column in the order of what they are connected with."""
    beside: dict[str, set[str]] = {name: set() for name in boxes}
    for names in ways:
        for a, b in zip(names[:-1], names[1:]):
            beside[a].add(b)
            beside[b].add(a)
    by_column = [[b for b in boxes.values() if b.column == k] for k in range(1 + max(b.column for b in boxes.values()))]
    for column in by_column:
        put(column)
    for sweep in range(SWEEPS):
        for column in by_column if sweep % 2 == 0 else reversed(by_column):
            column.sort(key=lambda box: middle(box, beside[box.name], boxes))
            put(column)
    centre_columns(by_column)


def middle(box: Box, others: set[str], boxes: Boxes) -> float:
    """Mean height of the boxes that a box is connected with."""
    heights = [boxes[name].y + boxes[name].height / 2 for name in others]
    return sum(heights) / len(heights) if heights else box.y + box.height / 2


def put(column: Sequence[Box]) -> None:
    """Stack the boxes of a column."""
    y = 0.0
    for box in column:
        box.y = y
        y += box.height + BETWEEN


def centre_columns(columns: Sequence[Sequence[Box]]) -> None:
    """Put the columns beside one another, each in the middle of the height."""
    heights = [sum(box.height + BETWEEN for box in column) - BETWEEN for column in columns]
    x = 0.0
    for column, height in zip(columns, heights):
        across = max(box.width for box in column)
        for box in column:
            box.x, box.y, box.across = x, box.y + 0.5 * (max(heights) - height), across
        x += across + ACROSS


def picture(run: Run) -> Picture | None:
    """All components and connections; none where the result does not tell its connections."""
    heads = {name: head(run, k, name) for k, name in enumerate(run.order, 1)}
    if not (wires := [wire(run, text) for text in run.wires]):
        return None
    boxes, ways = arrange_boxes(heads, wires)
    deepest = max(box.y + box.height for box in boxes.values())
    returns = [w for w, names in ways if not names]
    numbers = {name: k for k, name in enumerate(run.order)}
    depths = {w: deepest + LANE * k for k, w in enumerate(dict.fromkeys(returns), 1)}
    lines = [line(w, names, boxes, numbers, depths.get(w, deepest)) for w, names in ways]
    found = {w.kind for w in wires}
    return Picture(
        width=max(box.x + box.width for box in boxes.values()) + 2 * MARGIN,
        height=deepest + LANE * (len(returns) + 1) + 2 * MARGIN,
        words=f"Wiring. Components in the order in which they step: {', '.join(run.order)}. {'; '.join(run.wires)}.",
        lines=list(dict.fromkeys(lines)),
        boxes=[box for box in boxes.values() if box.heads],
        kinds=[(kind, words) for kind, words in KINDS.items() if kind in found],
    )


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


def line(w: Wire, names: Sequence[str], boxes: Boxes, numbers: dict[str, int], depth: float) -> Line:
    """A wire with its arrow; one that goes back passes below all boxes."""
    source, target = boxes[w.source[0]], boxes[w.target[0]]
    x, y = source.x + source.width, source.port(w.source[1], is_input=False)
    end = target.x, target.port(w.target[1], is_input=True)
    if names:
        path = f"M{x:.1f} {y:.1f}" + through(x, y, [boxes[name] for name in names[1:-1]], end)
    else:
        path = f"M{x:.1f} {y:.1f}H{x + 24:.1f}V{depth:.1f}H{end[0] - 24:.1f}V{end[1]:.1f}H{end[0]:.1f}"
    words = f"{'.'.join(w.source)} to {'.'.join(w.target)}, {KINDS[w.kind]}"
    return Line(kind=w.kind, colour=colour(numbers[w.source[0]]), path=path, end=end, words=words)


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
