"""What makes a record of no use: uneven times, clipped signals, no start at rest, no whole operation."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import numpy.typing as npt

from gapsense.identification.measurements.hum import hum
from gapsense.identification.measurements.operations import SMALL, Operation, drift, estimate, operations, starts
from gapsense.identification.measurements.record import SHOWN, UNITS, Columns, Record, Vector
from gapsense.identification.measurements.signals import SIGMAS, noise, resolution, true_runs
from gapsense.problems import number_of

FEWEST_SAMPLES = 8
JITTER = 0.01  # largest deviation of a time step from their median, relative
MANY = 50  # steps, whose mean is not rounded much
DIGITS = 12  # after the point, or in all, that times may have
FEWEST_DIGITS = 4  # in all, of rounded times
COARSEST = 5e-3  # rounding of times relative to the length of a record
LARGEST = 1e6  # V and A
CLIPPED = 5  # equal samples at the end of the range
STEEP = 1e-3  # change before a flat end of the range that no settling current has, relative to the range


def time_problems(columns: Columns) -> Iterator[str]:
    """Too few samples, or time steps that differ by more than the times are rounded."""
    t, rows, file = columns.values["time"], columns.rows, columns.file
    if t.size < FEWEST_SAMPLES:
        yield f"{file}: {number_of(t.size, 'row')} found, at least {FEWEST_SAMPLES} expected. Record more."
        return
    wrong, usual = uneven(t)
    if wrong.size and rounding(t) > 0.0:
        return
    if usual <= 0.0:
        said = f"{file}: `time` {'falls' if usual < 0.0 else 'does not change'} from row to row, it is to rise."
        yield f"{said} Sort the rows, or name another column with `--column time=NAME`."
        return
    steps = np.diff(t)
    for k in wrong[:SHOWN]:
        yield (
            f"{file}, row {rows[k + 1]}: `time` is {t[k + 1]:.9g} s, {steps[k]:.6g} s after the row before; equal steps"
            f" of {usual:.6g} s are expected. Record with one sampling period, or resample."
        )
    if wrong.size > SHOWN:
        yield f"{file}: `time` has other steps in {wrong.size - SHOWN} more rows."


def uneven(t: Vector) -> tuple[npt.NDArray[np.int_], float]:
    """Steps that differ by more than a rounding of less than half a step, and what a step usually is [s]."""
    steps = np.diff(t)
    many = min(MANY, steps.size)
    usual = float(np.median(t[many:] - t[:-many])) / many  # one step may be rounded
    last = digit(t)
    most = JITTER * abs(usual) + (1.01 * last if last < 0.5 * abs(usual) else 0.0)
    return np.flatnonzero((np.abs(steps - usual) > most) | (steps <= 0.0)), usual


def even_out(columns: Columns) -> tuple[Columns, tuple[str, ...]]:
    """Columns without problems, with equal steps where the times are rounded by more, and a sentence on that."""
    t = columns.values["time"]
    if not uneven(t)[0].size:
        return columns, ()
    even = np.linspace(t[0], t[-1], t.size)
    said = (
        f"`time` is rounded to {rounding(t):.2g} s, coarsely for steps of {even[1] - even[0]:.6g} s: these are assumed."
    )
    return columns._replace(values={**columns.values, "time": even}), (said,)


def digit(t: Vector) -> float:
    """The last decimal digit that times have."""
    for k in range(DIGITS + 1):
        if np.allclose(np.round(t, k), t, rtol=0.0, atol=1e-3 * 10.0**-k):
            return float(10.0**-k)
    return 0.0


def rounding(t: Vector) -> float:
    """How coarsely equally spaced times are rounded, as programs of oscilloscopes do; 0 if they are not rounded so.

    No time may be farther from the straight line through all of them than the rounding, to significant digits or to
    digits after the point. So no sample can be missing unless several times look the same.
    """
    steps, ends = np.arange(t.size), t[-1] - t[0]
    units = np.maximum(significant(t), digit(t))
    line = t[0] + ends / (t.size - 1) * steps
    coarsest = float(units.max())
    is_straight = bool(np.all(np.abs(t - line) <= 1.01 * units + JITTER * ends / (t.size - 1)))
    return coarsest if is_straight and coarsest < COARSEST * ends and bool(np.all(np.diff(t) >= 0.0)) else 0.0


def significant(t: Vector) -> Vector:
    """The last digit of each time, if all of them have the same number of digits."""
    sizes = np.abs(t)
    tens = np.floor(np.log10(np.where(t == 0.0, sizes[sizes > 0.0].min(initial=1.0), sizes)))
    for k in range(FEWEST_DIGITS, DIGITS + 1):
        unit = 10.0 ** (tens - k + 1)
        if np.all(np.abs(t - np.round(t / unit) * unit) <= 1e-3 * unit):
            return np.asarray(unit)
    return np.zeros(t.size)


def size_problems(columns: Columns, name: str) -> Iterator[str]:
    """Values that no coil has."""
    x, unit = columns.values[name], UNITS[name]
    k = int(np.argmax(np.abs(x))) if x.size else 0
    if x.size and abs(x[k]) > LARGEST:
        yield (
            f"{columns.file}, row {columns.rows[k]}: `{name}` is {x[k]:.4g} {unit}, at most {LARGEST:g} {unit} are"
            " expected. Correct the value, or the unit in the header of the column."
        )


def clipping(columns: Columns, name: str) -> Iterator[str]:
    """Flat ends of the range, where a converter saturates."""
    x, rows = columns.values[name], columns.rows
    unit = {"voltage": "V", "current": "A"}[name]
    for extreme, word in ((x.max(initial=0.0), "largest"), (x.min(initial=0.0), "smallest")):
        is_flat = x == extreme
        clipped = [] if extreme == 0.0 else [run for run in true_runs(is_flat) if run[1] - run[0] >= CLIPPED]
        if clipped and not _is_noisy(x[~is_flat]):
            least = max(STEEP * float(np.ptp(x)), 2.0 * resolution(x)) if name == "current" else np.inf
            before = [
                np.diff(x[max(first - 2, 0) : first + 1]) for first, _ in clipped
            ]  # where one that settles is flat
            clipped = [run for run, steps in zip(clipped, before) if np.abs(steps).max(initial=0.0) > least]
        if clipped:
            first, end = clipped[0]
            yield (
                f"{columns.file}, row {rows[first]} to {rows[end - 1]}: `{name}` stays at its {word} value {extreme:g} "
                f"{unit}, in {len(clipped)} places: the signal is clipped. Widen the measuring range and record again, "
                "or add `--clipped` if it is not."
            )


def _is_noisy(x: Vector) -> bool:
    """Noise of several digits, with which no stretch of equal samples is possible."""
    steps = np.diff(x)
    alternates = float(np.mean(steps[1:] * steps[:-1] < 0.0)) if steps.size > 1 else 0.0
    return alternates > 0.25 and noise(x) > 2.0 * resolution(x)


SPIKE = 0.2  # if all other currents are below this share of the largest one, it is a spike
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
    yield from slow_problems(record, file)
    i, limit = float(record.current[: found[0] + 1].mean()), _largest_at_rest(record)
    if not begins_at_rest(record):
        place = f"{file}, row {record.rows[0]} to {record.rows[found[0]]}"
        yield (
            f"{place}: `current` is {i:.4g} A before the first operation; at most {limit:.2g} A is expected. The flux "
            "linkage is an integral from rest on: record from rest, or cut the file to begin there; if the sensor shows"
            " this without current, subtract it."
        )


def _spike(record: Record) -> str:
    """The one sample whose current dwarfs that of all others, if there is one."""
    i = np.abs(record.current)
    k = int(np.argmax(i))
    others = np.delete(i, k)
    is_one = bool(others.max(initial=0.0) < SPIKE * i[k])
    return f" beside row {record.rows[k]} with {record.current[k]:.4g} A, which is to be corrected" if is_one else ""


def operation_problems(record: Record, file: str, period: float | None) -> Iterator[str]:
    """No complete operation, or operations that do not end as they began."""
    found = operations(record, period)
    moved = drift(record)
    if (moved or not found) and (buzz := hum(record)):
        yield (f"{file}: {buzz.told}: hum of the mains. Shield the sensor's wires, or filter both channels alike.")
    elif moved:
        yield (
            f"{file}: the current at rest moves by {moved:.4g} A from the first operation to the end of the record: its"
            " zero drifts, or it has not ended between operations. Let the sensor warm up, pause for longer, or record"
            " fewer operations."
        )
    elif not found:
        rows = ", ".join(str(record.rows[k]) for k in starts(record)[: 2 * SHOWN]) or "none"
        yield (
            f"{file}: no complete operation (current begins to flow after row {rows}). Record until the current has "
            "ended, or settled while the coil is held, or give the length of a period with `--period` in s;"
            " `gapsense commission` takes a record that ends earlier."
        )
    limit = 2.0 * _largest_at_rest(record)
    for operation in [o for o in found[:SHOWN] if not o.held]:
        i = record.current[[operation.start, operation.stop]]
        if abs(i[1] - i[0]) > limit:
            place = f"{file}, row {record.rows[operation.start]} to {record.rows[operation.stop]}"
            yield (
                f"{place}: `current` is {i[0]:.4g} A at the start of this operation and {i[1]:.4g} A at its end;"
                " equal currents are expected for (23). Leave the voltage off for longer, or give the period with "
                "`--period` in s."
            )
    yield from _check_signs(record, file, found)


def slow_problems(record: Record, file: str) -> Iterator[str]:
    """A current that takes seconds to rise: the times have another unit."""
    i = np.abs(record.current)
    begun = starts(record)[:1] or [0]
    rise = float(record.times[int(np.argmax(i > 0.5 * i.max()))] - record.times[begun[0]])
    if rise > LONGEST_RISE or record.dt > LONGEST_STEP:
        yield (
            f"{file}: `current` takes {rise:.3g} s to rise to half of its largest value, in steps of {record.dt:.3g} s;"
            " milliseconds are expected. If the times are in ms or us, write `time [ms]` or `time [us]` in the header."
        )


def _check_signs(record: Record, file: str, found: Sequence[Operation]) -> Iterator[str]:
    """Report voltage and current of opposite signs, or no voltage."""
    if found and not np.ptp(record.voltage):
        yield f"{file}: `voltage` is the same throughout though current flows. Record the voltage at the coil."
    elif found and (R := float(np.median(estimate(record, list(found)).resistances))) <= 0.0:
        yield (
            f"{file}: voltage and current have opposite signs, so that the resistance would be {R:.3g} Ohm. One of the"
            " sensors is reversed: change the sign of a column."
        )
