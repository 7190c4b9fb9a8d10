"""Parameters of the estimators of [RTS]: the defaults of their components."""

from __future__ import annotations

from typing import Any

from kernel_cases import components

from gapsense.fmi.settings import kernel_parameters


def defaults(kernel: Any, **changes: Any) -> Any:
    """The kernel's `Parameters` with the defaults of its component, but for changes by field."""
    return kernel_parameters(components()[kernel.__name__][1], {})._replace(**changes)
