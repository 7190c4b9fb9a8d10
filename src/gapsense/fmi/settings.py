"""Parameters of a kernel from values by port name, as the shell in the FMU makes them: for use in Python."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
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
    problems = [unknown(name, component.name, ports) for name in values if name not in ports]
    fields: dict[str, Any] = {}
    for port in ports.values():
        value = values.get(port.name, port.start)
        try:
            fields |= fields_of(port, value, folder)
        except ValueError as error:
            given = f"`{port.name}`: " if port.columns else f"`{port.name}` is {value!r}; "
            problems.append(given + str(error))
    if problems:
        raise ValueError("; ".join(problems) + ".")
    return kernel_of(component).module.Parameters(**fields)


def unknown(name: str, component: str, ports: Iterable[str]) -> str:
    """That a component has no such parameter, and what may be meant."""
    near = get_close_matches(name, ports, n=1)
    hint = f"Did you mean `{near[0]}`?" if near else "Its page lists them"
    return f"`{name}` is no parameter of {component}. {hint}"


def fields_of(port: Port, value: Any, folder: Path) -> dict[str, Any]:
    """Fields of the record that one parameter sets; a ValueError says what was expected."""
    if port.columns:
        shipped = folder / value
        try:
            tables = read_table(shipped if shipped.is_file() else Path(value), port.columns)
        except ValueError as error:
            raise ValueError(str(error).rstrip(".")) from error
        return {f"{port.field}_{column_name(column)}": table for column, table in zip(port.columns, tables)}
    if port.choices:
        if value not in port.choices:
            raise ValueError(f"expected one of {', '.join(port.choices)}")
        return {port.field: float(port.choices.index(value))}
    low, high = (-math.inf if port.min is None else port.min), (math.inf if port.max is None else port.max)
    if isinstance(value, str) or not (math.isfinite(value) and low <= value <= high):
        raise ValueError(f"expected a number from {low:g} to {high:g}")
    return {port.field: float(value)}
