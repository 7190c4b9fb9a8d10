"""Parameters of the estimators of [RTS]: the defaults of their components, and a table of the same gap law."""

from __future__ import annotations

from typing import Any

from kernel_cases import components

from gapsense.fmi.tables import column_name, read_table


def defaults(kernel: Any, **changes: Any) -> Any:
    """The kernel's `Parameters` with the defaults of its component."""
    component, folder = components()[kernel.__name__]
    values: dict[str, Any] = {}
    for port in component.of("parameter"):
        if port.columns:
            tables = read_table(folder / port.start, port.columns)
            values |= {f"{port.field}_{column_name(c)}": table for c, table in zip(port.columns, tables)}
        else:
            values[port.field] = float(port.choices.index(port.start) if port.choices else port.start)
    return kernel.Parameters(**{**values, **changes})
