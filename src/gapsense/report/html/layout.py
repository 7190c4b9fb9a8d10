"""Where the boxes and wires of a wiring picture are: columns by what drives what, long wires around the boxes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

CHARACTER, LINE, HEAD, PAD = 6.7, 17.0, 40.0, 10.0  # widths and heights [pixels]
ACROSS, BETWEEN, LANE = 74.0, 22.0, 13.0  # room between columns, between boxes, and for a wire that passes them
SWEEPS = 6


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


Boxes = dict[str, Box]


def longest(texts: Sequence[str]) -> int:
    """Characters of the longest text."""
    return max(map(len, texts), default=0)


def arranged(heads: Mapping[str, tuple[str, ...]], wires: Sequence[Wire]) -> tuple[Boxes, list[tuple[Wire, list[str]]]]:
    """Boxes with their places, and for each wire those it passes, from first to last; empty for one that goes back.

    Parameters
    ----------
    heads : mapping
        Lines at the top of each component, in the order in which they step.
    wires : sequence of Wire
        Between these components.
    """
    columns = columns_of(list(heads), wires)
    boxes = {name: Box(name, columns[name], lines) for name, lines in heads.items()}
    for wire in wires:
        add(boxes[wire.source[0]].outputs, wire.source[1])
        add(boxes[wire.target[0]].inputs, wire.target[1])
    ways = [(wire, way(wire, boxes)) for wire in wires]
    stacked(boxes, [names for _, names in ways if names])
    return boxes, ways


def add(names: list[str], name: str) -> None:
    """Put a name into a list that does not have it."""
    if name not in names:
        names.append(name)


def columns_of(names: Sequence[str], wires: Sequence[Wire]) -> dict[str, int]:
    """Column of each component: right of all that step before it and drive it."""
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


def stacked(boxes: Boxes, ways: Sequence[Sequence[str]]) -> None:
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
    centred(by_column)


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


def centred(columns: Sequence[Sequence[Box]]) -> None:
    """Put the columns beside one another, each in the middle of the height."""
    heights = [sum(box.height + BETWEEN for box in column) - BETWEEN for column in columns]
    x = 0.0
    for column, height in zip(columns, heights):
        across = max(box.width for box in column)
        for box in column:
            box.x, box.y, box.across = x, box.y + 0.5 * (max(heights) - height), across
        x += across + ACROSS
