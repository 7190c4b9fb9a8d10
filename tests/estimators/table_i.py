"""Parameters of the estimators of [RTS]: the defaults of their components."""

from __future__ import annotations

from typing import Any

from kernel_cases import components

from gapsense.fmi.components import kernel_parameters

QUIET = {"process_flux_linkage": 2e-6, "process_current_error": 1e-3, "process_force_error": 20e-3}  # a right model


def defaults(kernel: Any, **changes: Any) -> Any:
    """The kernel's `Parameters` with the defaults of its component, but for changes by field."""
    return kernel_parameters(components()[kernel.__name__][1], {})._replace(**changes)
