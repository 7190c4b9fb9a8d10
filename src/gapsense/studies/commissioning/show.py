"""Table of a commissioning: what was found, how certain it is, how well the model explains the currents."""

from __future__ import annotations

from rich.table import Table

from gapsense.estimators.mhe import Parameters
from gapsense.report.table import quantity, table
from gapsense.studies.commissioning.file import PORTS
from gapsense.studies.commissioning.fit import DEVIATIONS, Commissioned, bent

BELIEVED = 0.7  # of the deviation that was assumed: the record has told little
HEADS = ("parameter", "believed", "found", "standard error", "")


def tables(result: Commissioned, known: Parameters) -> list[Table | str]:
    """Values and standard errors, then what the misfit says."""
    before, rows = bent(known), []
    for field, error in result.errors.items():
        port, note = PORTS[field], "" if error < BELIEVED * DEVIATIONS[field] else "as it was believed"
        values = (quantity(float(getattr(par, field)), port.unit) for par in (before, result.parameters))
        rows.append((port.name, *values, f"{100.0 * error:.2g} %", note))
    said = f"Misfit {result.misfit:.2g}: "
    well = (
        "the model explains the currents."
        if result.misfit < known.health_limit
        else ("the model does not explain the currents. Is the record from rest on, are stops and gap law right?")
    )
    return [table("Parameters", HEADS, rows), said + well]
