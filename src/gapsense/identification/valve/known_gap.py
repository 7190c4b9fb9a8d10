"""What is known of the gap: from inductances, or else from positions, or as it was given."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from gapsense.actuators.solenoid_valve import Parameters
from gapsense.identification.measurements.record import Record
from gapsense.identification.valve.forms import Sought
from gapsense.identification.valve.gap.inductances import of_inductances
from gapsense.identification.valve.gap.positions import of_positions
from gapsense.identification.valve.gap.start import Gap
from gapsense.identification.valve.gap.usable import usable


def known(
    par: Parameters,
    records: Sequence[Record],
    sought: Sought,
    inductances: Path | None,
    conventions: Sequence[str],
    period: float | None = None,
) -> Gap:
    """What is known and sought; unchanged where there are neither inductances nor positions."""
    found = [usable(record, par, period) for record in records]
    if inductances is not None:
        return of_inductances(inductances, par, found, sought, conventions)
    if any(record.position_noise for record in found):
        return of_positions(par, found, sought, conventions, period)
    return Gap(par, sought, found, conventions)
