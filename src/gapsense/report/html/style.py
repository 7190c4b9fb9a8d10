"""Colours and strokes that colour-blind readers can tell apart too, on light and dark ground."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

INK, GRID, FAIL, BOUND = "#1b1f24", "#d9dee4", "#b3261e", "#8f6a00"
DARK = {  # of each colour on light ground
    INK: "#e8ebef",
    GRID: "#3a414a",
    FAIL: "#ff8a80",
    "#57606a": "#a3acb6",
    "#0072b2": "#5db0ee",
    "#d55e00": "#ff9a57",
    "#00805c": "#3ccfa5",
    "#b5478f": "#f0a3d0",
    "#8f6a00": "#f0c04a",
    "#5a4fcf": "#a9a2ff",
}
AXES = "#57606a"
CURVES = tuple(DARK)[4:]
DASHES = ((), (7, 3), (2, 2), (9, 3, 2, 3))
# Of the values of a strip, whose numbers are white on any ground: none of those above.
VALUES = ("#6e7781", "#0067a3", "#916200", "#007a57", "#a83f84", "#3f6d9e", "#5247c4", "#b3470a")


def colours(components: Iterable[str]) -> Mapping[str, int]:
    """Number of each component; a component has the same colour on the whole page."""
    return {name: k for k, name in enumerate(dict.fromkeys(components))}


def colour(number: int) -> str:
    """Colour of a component."""
    return CURVES[number % len(CURVES)]


def dash(number: int, turn: int) -> tuple[int, ...]:
    """Stroke of the curve `turn` that a component has in a panel."""
    return DASHES[(number // len(CURVES) + turn) % len(DASHES)]


def variables() -> str:
    """Custom properties of CSS for both grounds: `--c-0072b2` is that colour or its counterpart."""
    light = "".join(f"--c-{name[1:]}:{name};" for name in DARK)
    dark = "".join(f"--c-{name[1:]}:{other};" for name, other in DARK.items())
    return f":root{{{light}}}@media screen and (prefers-color-scheme:dark){{:root{{{dark}}}}}"


def variable(name: str) -> str:
    """A colour as CSS names it: by its property, if it has one."""
    return f"var(--c-{name[1:]})" if name in DARK else name
