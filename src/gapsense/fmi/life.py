"""The life of an instance: which calls of FMI 2.0 are allowed in which phase.

Calls that are not listed are always allowed.  Standard library only, because a copy travels in every FMU; the native
build makes C of the table.
"""

from __future__ import annotations

PHASES = ("instantiated", "initializing", "running", "terminated", "failed")
KINDS = ("Real", "Integer", "Boolean", "String")
ALLOWED = {
    "fmi2SetupExperiment": ("instantiated",),
    "fmi2EnterInitializationMode": ("instantiated",),
    "fmi2ExitInitializationMode": ("initializing",),
    "fmi2DoStep": ("running",),
    "fmi2Terminate": ("running",),
    **{f"fmi2Set{kind}": ("instantiated", "initializing", "running") for kind in KINDS},
    **{f"fmi2Get{kind}": ("initializing", "running", "terminated", "failed") for kind in KINDS},
}


def phases_of(call: str) -> str:
    """Phases in which a call is allowed, as a sentence names them."""
    *others, last = [f"`{phase}`" for phase in ALLOWED[call]]
    return f"{', '.join(others)} or {last}" if others else last
