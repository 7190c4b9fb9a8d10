"""Table of a commissioning: what was found, how certain it is, how well the model explains the currents."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from rich.table import Table

from gapsense.estimators.mhe.model import Parameters
from gapsense.fmi.ports import Port
from gapsense.identification.actuator.drive import SLOWEST
from gapsense.identification.actuator.file import PORTS
from gapsense.identification.actuator.fit import Commissioned, bent, position_error
from gapsense.identification.actuator.problem import DEVIATIONS
from gapsense.identification.actuator.verdict import CAUSES
from gapsense.identification.assumptions import listed, meanings
from gapsense.identification.residual import verdict
from gapsense.identification.valve.show import about, measured_and_model, validation
from gapsense.identification.valve.validation import Validation
from gapsense.report.table import quantity, table
from gapsense.tables import Value

BELIEVED = 0.7  # of the deviation that was assumed: the record has told little
FAR = 3.0  # of the same deviations from what was believed
MOVES = 0.01  # of the stroke
HEADS = ("parameter", "believed", "found", "standard error", "")


def tables(
    result: Commissioned, known: Parameters, checks: Sequence[Validation] = (), assumed: Sequence[str] = ()
) -> list[Table | str]:
    """Values and standard errors, then what the residuals and the misfit say."""
    before, rows = bent(known), []
    for field, error in result.errors.items():
        port, note = PORTS[field], "as it was believed" if error >= BELIEVED * result.believed[field] else ""
        note = "assumed" if port.name in assumed else note
        values = (quantity(float(getattr(par, field)), port.unit) for par in (before, result.parameters))
        rows.append((port.name, *values, f"{100.0 * error:.2g} %", note))
    records = [*(drive.record for drive in result.drives), *(check.record for check in checks)]
    return [
        table("Parameters", HEADS, rows),
        *([validation(checks)] if checks else []),
        *assumptions(known, assumed),
        *remarks(result, before),
        *(text for record in records for text in about(record)),
    ]


def assumptions(known: Parameters, names: Sequence[str]) -> list[str]:
    """What nobody has given, and what that means."""
    ports = {port.name: port for port in PORTS.values()}
    values = {name: known_value(known, ports[name]) for name in names}
    return [f"Assumed, and not given: {listed(values, ports, names)}.", *meanings(names)] if names else []


def known_value(known: Parameters, port: Port) -> Value:
    """Value of a parameter, or where a table is from."""
    return "as shipped" if port.columns else float(getattr(known, port.field))


def remarks(result: Commissioned, before: Parameters) -> list[str]:
    """Sentences: how well the model explains the records, and what these do not tell."""
    said = [verdict(r, quantity(r.rms, "A"), quantity(r.limit, "A"), CAUSES) for r in result.residuals]
    said += [
        f"{d.record.name}: the voltage switches with fewer than {SLOWEST:g} samples from edge to edge, so that its mean"
        " is a guess. Values and standard errors are not to be relied on: sample faster or, through a filter, the mean."
        for d in result.drives
        if d.is_too_fast
    ]
    well = "" if result.misfit < before.health_limit else ", of which less than 1 is usual: the model is another one"
    said.append(f"Misfit {result.misfit:.2g}{well}.")
    said.append(
        f"By the standard errors, positions of the model are certain to {1e6 * position_error(result):.2g} um RMS."
    )
    stroke = before.stop_upper - before.stop_lower
    if all(np.ptp(model.position) < MOVES * stroke for model in result.models):
        said.append("The mover does not leave its stop: mass, spring and damping stay as they were believed.")
    if held := [PORTS[name].name for name in DEVIATIONS if name not in result.names]:
        said.append(f"Held, for they are 0 or in a file: {', '.join(held)}.")
    for name in result.names:
        factor = float(getattr(result.parameters, name) / getattr(before, name))
        if abs(math.log(factor)) > FAR * result.believed[name]:
            said.append(
                f"`{PORTS[name].name}` is {factor:.2g} times what was believed, much farther off than it should be:"
                " check what was given, or the voltage."
            )
    return said


def figure(result: Commissioned, checks: Sequence[Validation]) -> Figure:
    """Measured currents and those of the model, and its positions."""
    runs = [(drive.record, model, drive.first, "fit") for drive, model in zip(result.drives, result.models)]
    return measured_and_model("Measured and commissioned", runs, checks)
