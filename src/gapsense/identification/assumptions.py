"""What a record of voltage and current does not tell: it is asked for by name, or assumed, listed and marked.

Two things cannot be told from a record. Another stroke explains it as well, if mass, stiffness and damping go with the
inverse of its square. Another gap law explains it as well, if turns and core go with it. Without these values the
answer is relative.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from gapsense.fmi.ports import Port
from gapsense.problems import InputError
from gapsense.report.table import quantity
from gapsense.tables import Value


class Scale(NamedTuple):
    """A parameter that a record does not tell."""

    what: str  # for the user who is asked for it
    doubt: float  # standard deviation of an assumed value: of its logarithm, or in parts
    means: str = ""  # what an answer with an assumed value is worth
    parts: str = ""  # what the doubt is a part of, for a value that may be 0


STROKE = (
    "positions are right as parts of the stroke only, and with another stroke mass, stiffness and damping go with the"
    " inverse of its square"
)
GAP = (
    "with another slope of the gap law the turns go with its square root, and the reluctance of the core goes with it;"
    " positions, flux linkages and forces stay as they are"
)
BOUNCES = "the mover of the model does not bounce; of one that does, what the model leaves of the current shows it"
SCALES: Mapping[str, Scale] = {
    "stop.lower": Scale("the smallest gap, 0 if the mover closes it", 0.1, STROKE, "the stroke"),
    "stop.upper": Scale("the largest gap", math.log(2.0), STROKE),
    "gap.slope": Scale("the reluctance per gap, 1/(4e-7 pi A) for a pole area A in m2", math.log(3.0), GAP),
    "gap.area": Scale("the pole area", math.log(3.0), GAP),
    "gap.window": Scale("the height of the winding window", math.log(3.0)),
    "spring.rest": Scale(
        "the gap at which the spring is relaxed: the largest gap plus preload over stiffness",
        math.log(6.0),
        "with another relaxed gap the stiffness goes with about its inverse, since a record tells the preload",
    ),
    "coil.turns": Scale(
        "the number of turns",
        math.log(3.0),
        "with other turns all reluctances go with their square; positions, flux linkages and forces stay as they are",
    ),
    "stop.restitution": Scale("speed after an impact over that before it", 0.1, BOUNCES, "1"),
}
OTHER = Scale("", math.log(3.0))
DEVICE = ("coil", "mover", "spring", "damping", "stop", "core", "gap", "initial")  # groups of parameters


def scale(name: str) -> Scale:
    """What is known of a parameter that is not known."""
    return SCALES.get(name, OTHER)


def is_device(name: str) -> bool:
    """Whether a parameter describes a device, not an estimator."""
    return name.partition(".")[0] in DEVICE


def ask(names: Sequence[str], ports: Mapping[str, Port], where: str, source: str = "", more: str = "") -> None:
    """Ask for missing parameters, all in one sentence, unless there are none; `source` has what `--assume` takes."""
    if not names:
        return
    wanted = ", ".join(f"`{name}` ({_describe_port(name, ports[name])})" for name in names)
    relative = f", or take the values of {source} with `--assume`, for a relative answer" if source else ""
    example = next((n for n in names if n == "stop.upper"), names[0])
    key = f'"{example}"' if "." in example else example
    raise InputError(
        [
            f"{where}: {wanted}: missing or only assumed, and records do not show it. Give each as a line like"
            f" `{key} = {ports[example].start!r}` below `[values]` in a file for `--parameters`"
            f"{more}{relative}."
        ]
    )


def _describe_port(name: str, port: Port) -> str:
    what = scale(name).what or port.description
    return what if port.unit == "1" or port.choices else f"{what}, in {port.unit}"


def describe_doubt(name: str, doubt: float) -> str:
    """The standard error of an assumed value, as text."""
    if parts := scale(name).parts:
        return f"+- {doubt:.2g}" + ("" if parts == "1" else f" of {parts}")
    return f"a factor of {math.exp(doubt):.2g}" if doubt > 0.1 else f"+- {100.0 * doubt:.2g} %"


def list_values(values: Mapping[str, Value], ports: Mapping[str, Port], names: Iterable[str]) -> str:
    """Some names and values, with units."""
    return ", ".join(f"`{name}` = {_format_value(values[name], ports.get(name))}" for name in names)


def _format_value(value: Value, port: Port | None) -> str:
    if isinstance(value, (str, bool)):
        return f"{value}".rpartition("/")[2]
    return quantity(float(value), port.unit if port else "").strip()


def meanings(names: Iterable[str]) -> list[str]:
    """What an answer is worth that rests on these assumed values, each sentence once."""
    said = dict.fromkeys(scale(name).means for name in names)
    return [f"{text[0].upper()}{text[1:]}." for text in said if text]


def marks(names: Sequence[str]) -> list[str]:
    """Lines of a parameter-set file that mark values as assumed."""
    quoted = ", ".join(f'"{name}"' for name in names)
    return [f"assumed = [{quoted}]", *(f"# {text}" for text in meanings(names))] if names else []
