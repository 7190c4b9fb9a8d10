"""Parameters of the estimators: the defaults of their components."""

from __future__ import annotations

from typing import Any

from kernel_cases import components


def defaults(kernel: Any, **changes: float) -> Any:
    """The kernel's `Parameters` with the defaults of its component."""
    component, _ = components()[kernel.__name__]
    values = {port.field: 0.0 if port.choices else float(port.start) for port in component.of("parameter")}
    return kernel.Parameters(**{**values, **changes})
