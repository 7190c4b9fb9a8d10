"""Parameter values: whether a component takes them, and what they are in the record of its kernel.

Everybody who is given values asks here: the shell in the FMU, the packager, the commands, the studies.  Standard
library only, because a copy travels in every FMU.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from .ports import Component, Limit, Port
from .sentences import say
from .tables import column_name, read_table

KINDS: dict[str, tuple[str, Any]] = {
    "Real": ("number", (int, float)),
    "Integer": ("whole_number", int),
    "Boolean": ("truth_value", bool),
    "String": ("text", str),
}


class ValuesError(ValueError):
    """A component does not take the values that it is given; `problems` are all reasons, one sentence each."""

    def __init__(self, problems: Sequence[str]) -> None:
        self.problems = list(problems)
        super().__init__(" ".join(self.problems))


def fields(component: Component, given: Mapping[str, Any], folder: str | Path) -> dict[str, Any]:
    """Fields of the kernel's `Parameters`: numbers, the index of a choice, a list for each column of a table.

    Parameters that are not `given`, by name, have their start values.  The component's own tables lie in `folder`;
    others are found from the working folder on.  A ValuesError has all `problems`, and those of the tables.
    """
    found = problems(component, given)
    made: dict[str, Any] = {} if found else {**numbers(component, given)}
    for port, value in _values(component, given):
        if port.columns and isinstance(value, str):
            try:
                made.update(_tables(port, value, Path(folder)))
            except (OSError, ValueError) as error:
                found.append(say("of_parameter", port.name, error))
    if found:
        raise ValuesError(found)
    return made


def numbers(component: Component, given: Mapping[str, Any]) -> dict[str, float]:
    """Fields of the kernel's `Parameters` that are no tables, from values without problems."""
    values = [(port, value) for port, value in _values(component, given) if not port.columns]
    return {port.field: float(port.choices.index(value) if port.choices else value) for port, value in values}


def problems(component: Component, given: Mapping[str, Any]) -> list[str]:
    """Everything that is wrong with values of parameters, but for the content of tables; empty if they are taken."""
    values = {port.name: value for port, value in _values(component, given)}
    wrong = {port.name: text for port, value in _values(component, given) if (text := wrong_value(port, value))}
    found = [*(unknown_parameter(name, values) for name in given if name not in values), *wrong.values()]
    falling = [p for p in component.rising if not wrong.keys() & set(p) and not values[p[0]] < values[p[1]]]
    found += [say("is_wrong", a, repr(values[a]), say("less_than", b, repr(values[b]))) for a, b in falling]
    if not wrong and not falling:  # a limit is for parameters in their ranges
        found += [text for limit in component.limits if (text := _excess(limit, values))]
    return found


def unknown_parameter(name: str, known: Iterable[str]) -> str:
    """That there is no parameter of a name, and which may be meant."""
    near = get_close_matches(name, known, n=1)
    return say("no_parameter", name, say("did_you_mean", near[0]) if near else say("remove_it"))


def _values(component: Component, given: Mapping[str, Any]) -> list[tuple[Port, Any]]:
    return [(port, given.get(port.name, port.start)) for port in component.of("parameter")]


def wrong_value(port: Port, value: Any) -> str:
    """What is wrong with a value by itself, or nothing."""
    kind, types = KINDS[port.kind]
    if not isinstance(value, types) or isinstance(value, bool) != (port.kind == "Boolean"):
        expected = say(kind)
    elif port.choices:
        expected = "" if value in port.choices else say("choice", ", ".join(port.choices))
    else:
        expected = "" if isinstance(value, (bool, str)) or _is_in_range(port, value) else _range(port)
    shown = f"`{value}`" if isinstance(value, str) else str(value).lower() if isinstance(value, bool) else repr(value)
    return expected and say("is_wrong", port.name, shown, expected)


def _is_in_range(port: Port, value: float) -> bool:
    low, high = -math.inf if port.min is None else port.min, math.inf if port.max is None else port.max
    return math.isfinite(value) and low <= value <= high


def _range(port: Port) -> str:
    """What a number may be, in few words: hosts cut long messages."""
    unit = "" if port.unit == "1" else f" {port.unit}"
    if port.min is None:
        return say("finite") if port.max is None else say("at_most", port.max, unit)
    return say("at_least", port.min, unit) if port.max is None else say("from_to", port.min, port.max, unit)


def _excess(limit: Limit, values: Mapping[str, Any]) -> str:
    powers = [(values[name], power) for name, power in limit.powers]
    product = math.prod(x if power > 0 else 1.0 / x for x, power in powers for _ in range(abs(power)))
    found = say("beyond_limit", limit.text(), product, limit.below, limit.reason)
    return "" if product < limit.below else found


def _tables(port: Port, file: str, folder: Path) -> dict[str, list[float]]:
    tables = read_table(file, port.columns, folder)
    return {f"{port.field}_{column_name(c)}": t for c, t in zip(port.columns, tables)}
