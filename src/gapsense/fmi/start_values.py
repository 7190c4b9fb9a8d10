"""Components with other start values of their parameters."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from gapsense.fmi.ports import Component, Port


def unknown_names(components: Iterable[Component], names: Iterable[str]) -> list[str]:
    """One sentence for each name that is a parameter of no component."""
    known = sorted({port.name for component in components for port in component.of("parameter")})
    sentences = []
    for name in names:
        if name not in known:
            near = get_close_matches(name, known, n=1)
            hint = f"Did you mean `{near[0]}`?" if near else "`gapsense list` and the pages of the FMUs name them."
            sentences.append(f"`{name}`: no component has this parameter. {hint}")
    return sentences


def with_start_values(component: Component, values: Mapping[str, Any]) -> tuple[Component, dict[str, Path]]:
    """The component with these start values of its own parameters, and the files to put into its resources.

    Parameters
    ----------
    component : Component
        As its folder declares it.
    values : mapping
        By the names of its parameters; a table of a CSV file is given by its path.

    Raises
    ------
    ValueError
        With all values of a wrong type, or out of range.
    """
    problems = [f"{component.name}, `{n}`: {p}" for n, v in values.items() if (p := _problem(_port(component, n), v))]
    if problems:
        raise ValueError("\n".join(problems))
    if "sample_time" in values:
        component = component._replace(step_size=float(values["sample_time"]))  # of the default experiment
    files = {Path(str(v)).name: Path(str(v)) for n, v in values.items() if _port(component, n).columns}
    ports = tuple(_started(port, values[port.name]) if port.name in values else port for port in component.ports)
    resources = tuple(dict.fromkeys((*component.resources, *files)))
    return component._replace(ports=ports, resources=resources), files


def _port(component: Component, name: str) -> Port:
    return next(port for port in component.of("parameter") if port.name == name)


def _started(port: Port, value: Any) -> Port:
    if port.columns:
        return port._replace(start=Path(str(value)).name)
    if port.kind != "Real":
        return port._replace(start=value)
    return port._replace(start=float(value), nominal=abs(float(value)) or 1.0)


def _problem(port: Port, value: Any) -> str:
    """What is wrong with a start value, or nothing."""
    if port.choices:
        expected = "one of " + ", ".join(port.choices)
        return "" if value in port.choices else f"`{value}` found, {expected} expected. Correct it."
    types: dict[str, Any] = {"Real": (int, float), "Integer": int, "Boolean": bool, "String": str}
    if not isinstance(value, types[port.kind]) or isinstance(value, bool) != (port.kind == "Boolean"):
        return f"`{value}` found, a value of type {port.kind} expected. Correct it."
    if port.kind not in ("Real", "Integer"):
        return ""
    low, high = -math.inf if port.min is None else port.min, math.inf if port.max is None else port.max
    is_inside = low <= float(value) <= high
    return "" if is_inside else f"{value:g} found, {low:g} to {high:g} {port.unit} expected. Correct it."
