"""What was found of the gap: the law as a table beside the set, its slopes, and whether positions are explained."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from rich.table import Table

from gapsense._os.files import write_atomically, write_columns
from gapsense.actuators.solenoid_valve import GapLaw
from gapsense.identification.gap_law import choice
from gapsense.identification.gap_law.laws import rows
from gapsense.identification.measurements.record import Record
from gapsense.identification.residual import EXPLAINED
from gapsense.identification.transfer import TABLE_UNITS
from gapsense.identification.valve.device import value
from gapsense.identification.valve.file import Known
from gapsense.identification.valve.form import shape
from gapsense.identification.valve.gap.usable import EXACT
from gapsense.identification.valve.identified import Identified
from gapsense.identification.valve.model import Trajectory
from gapsense.report.table import quantity, table


def kept(known: Known, result: Identified, to: Path) -> Known:
    """What is known, with the law that was found; a table is written beside the file of the parameter set."""
    law = GapLaw(int(value(result.parameters, "gap_law"))).name
    if result.form.law is None:
        return known._replace(table=known.table if law == "table" else None)
    made = rows(result.form.law_at(result.ratios), float(value(result.parameters, "stop_upper")))
    file = to.with_name(f"{to.stem}_law.csv")
    file.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(file, lambda out: write_columns(out, made, TABLE_UNITS))
    return known._replace(table=file)


def told(result: Identified, records: Sequence[Record]) -> list[Table | str]:
    """What was found of the gap, and whether the model explains the positions."""
    return [*slopes(result), *(_verdict(r, m) for r, m in zip(records, result.models) if r.position_noise)]


def _verdict(record: Record, model: Trajectory) -> str:
    """What the model leaves of a position."""
    assert record.position is not None and record.position_noise is not None
    left = choice.rms(record.position[-model.position.size :] - model.position)
    is_noise = left < max(EXPLAINED * record.position_noise, EXACT * float(np.ptp(record.position)))
    return f"{record.name}: the model leaves {quantity(left, 'm')} of the position, " + (
        "which is noise."
        if is_noise
        else f"{left / record.position_noise:.2g} times its noise: the mechanics is another one (friction, bounces, a"
        " spring that is not linear), or the sensor (its scale, its delay)."
    )


def slopes(result: Identified) -> list[Table | str]:
    """The slopes of a table that was fitted, with their errors; what is the gap's of the rest."""
    if result.form.law is None:
        return []
    law, errors = result.form.law_at(result.ratios), result.uncertainty.shape
    made: list[Table | str] = []
    if errors:
        numbers = zip(law.knots, law.numbers, shape(law)[1:])
        cells = ((quantity(h, "m"), quantity(x, "1/(H.m)"), f"{100.0 * errors[name]:.2g} %") for h, x, name in numbers)
        made.append(table("Slope of the gap reluctance", ("gap", "slope", "standard error"), cells))
    core = float(value(result.parameters, "core_reluctance"))
    return [
        *made,
        f"Of {quantity(law.offset + core, '1/H')} without gap {quantity(core, '1/H')} are the core's, which saturates.",
    ]
