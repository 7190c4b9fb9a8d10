"""Parameters of a kernel from values by port name, as the shell in the FMU makes them: for use in Python."""

from __future__ import annotations

import math
from collections.abc import Mapping
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from gapsense.fmi.package import kernel_of, load_component
from gapsense.fmi.ports import Port
from gapsense.fmi.tables import column_name, read_table


def kernel_parameters(folder: Path, values: Mapping[str, Any]) -> Any:
    """The `Parameters` of the kernel of the component in `folder`; what is not in `values` has its start value.

    Raises
    ------
    ValueError
        With all names that are no parameters and all values that the component does not take.
    """
    component = load_component(folder)
    ports = {port.name: port for port in component.of("parameter")}
    problems = [_unknown(name, component.name, ports) for name in values if name not in ports]
    fields: dict[str, Any] = {}
    for port in ports.values():
        fields |= _fields(port, values.get(port.name, port.start), folder, problems)
    if problems:
        raise ValueError("; ".join(problems) + ".")
    return kernel_of(component).module.Parameters(**fields)


def _unknown(name: str, component: str, ports: Mapping[str, Port]) -> str:
    near = get_close_matches(name, ports, n=1)
    hint = f"Did you mean `{near[0]}`?" if near else "Its page lists them"
    return f"`{name}` is no parameter of {component}. {hint}"


def _fields(port: Port, value: Any, folder: Path, problems: list[str]) -> dict[str, Any]:
    """Fields of the record that one parameter sets; none if the value is refused."""
    if port.columns:
        shipped = folder / value
        try:
            tables = read_table(shipped if shipped.is_file() else Path(value), port.columns)
        except ValueError as error:
            problems.append(f"`{port.name}`: {str(error).rstrip('.')}")
            return {}
        return {f"{port.field}_{column_name(column)}": table for column, table in zip(port.columns, tables)}
    if port.choices:
        if value in port.choices:
            return {port.field: float(port.choices.index(value))}
        problems.append(f"`{port.name}` is `{value}`; expected one of {', '.join(port.choices)}")
        return {}
    low, high = (-math.inf if port.min is None else port.min), (math.inf if port.max is None else port.max)
    if isinstance(value, str) or not (math.isfinite(value) and low <= value <= high):
        problems.append(f"`{port.name}` is {value!r}; expected a number from {low:g} to {high:g}")
        return {}
    return {port.field: float(value)}
