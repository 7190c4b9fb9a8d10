"""What makes a record of no use for a model: it does not begin at rest, or has no whole operation."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from gapsense.identification.measurements.flux import estimate
from gapsense.identification.measurements.operations import SIGMAS, SMALL, Operation, noise, operations, starts
from gapsense.identification.measurements.record import SHOWN, Record

SPIKE = 0.2  # of the largest current: all others are smaller, if it is one sample's only
LONGEST_RISE, LONGEST_STEP = 0.3, 0.02  # s; no short-stroke actuator is slower


def _largest_at_rest(record: Record) -> float:
    return SMALL["current"] * float(np.abs(record.current).max()) + SIGMAS * noise(record.current)


def begins_at_rest(record: Record) -> bool:
    """Whether no current flows before the first operation, of which there is one."""
    found = starts(record)
    return bool(found) and abs(float(record.current[: found[0] + 1].mean())) <= _largest_at_rest(record)


def rest_problems(record: Record, file: str) -> Iterator[str]:
    """A record in which nothing operates, or whose first operation does not begin at rest."""
    found = starts(record)
    if not found:
        where = f"{file}: no current flows{_spike(record)}"
        yield f"{where}, so that nothing operates. Record at least one operation, from rest on."
        return
    yield from _slow(record, file, found[0])
    i, limit = float(record.current[: found[0] + 1].mean()), _largest_at_rest(record)
    if not begins_at_rest(record):
        place = f"{file}, row {record.rows[0]} to {record.rows[found[0]]}"
        yield (
            f"{place}: `current` is {i:.4g} A before the first operation; at most {limit:.2g} A is expected. The flux "
            "linkage is an integral from rest on: record from rest, or cut the file to begin there; if the sensor shows"
            " this without current, subtract it."
        )


def _spike(record: Record) -> str:
    """The one sample whose current hides that of all others, if there is one."""
    i = np.abs(record.current)
    k = int(np.argmax(i))
    others = np.delete(i, k)
    is_one = bool(others.max(initial=0.0) < SPIKE * i[k])
    return f" beside row {record.rows[k]} with {record.current[k]:.4g} A, which is to be corrected" if is_one else ""


def operation_problems(record: Record, file: str, period: float | None) -> Iterator[str]:
    """No complete operation, or operations that do not end as they began."""
    found = operations(record, period)
    if not found:
        rows = ", ".join(str(record.rows[k]) for k in starts(record)[: 2 * SHOWN]) or "none"
        yield (
            f"{file}: no complete operation (current begins to flow after row {rows}). Record until the current has "
            "ended, or give the length of a period with `--period` in s."
        )
    limit = 2.0 * _largest_at_rest(record)
    for operation in found[:SHOWN]:
        i = record.current[[operation.start, operation.stop]]
        if abs(i[1] - i[0]) > limit:
            place = f"{file}, row {record.rows[operation.start]} to {record.rows[operation.stop]}"
            yield (
                f"{place}: `current` is {i[0]:.4g} A at the start of this operation and {i[1]:.4g} A at its end;"
                " equal currents are expected for (23). Leave the voltage off for longer, or give the period with "
                "`--period` in s."
            )
    yield from _reversed(record, file, found)


def _slow(record: Record, file: str, start: int) -> Iterator[str]:
    """A current that takes seconds to rise: the times have another unit."""
    i = np.abs(record.current)
    rise = float(record.times[int(np.argmax(i > 0.5 * i.max()))] - record.times[start])
    if rise > LONGEST_RISE or record.dt > LONGEST_STEP:
        yield (
            f"{file}: `current` takes {rise:.3g} s to rise to half of its largest value, in steps of {record.dt:.3g} s;"
            " milliseconds are expected. If the times are in ms or us, write `time [ms]` or `time [us]` in the header."
        )


def _reversed(record: Record, file: str, found: Sequence[Operation]) -> Iterator[str]:
    """Voltage and current of opposite signs, or no voltage."""
    if found and not np.ptp(record.voltage):
        yield f"{file}: `voltage` is the same throughout though current flows. Record the voltage at the coil."
    elif found and (R := float(np.median(estimate(record, list(found)).resistances))) <= 0.0:
        yield (
            f"{file}: voltage and current have opposite signs, so that the resistance would be {R:.3g} Ohm. One of the"
            " sensors is reversed: change the sign of a column."
        )
