"""Records of measured voltage and current: uniform samples in SI units, and the voltage between two of them.

An edge of the drive lies anywhere between two samples: a convention says where.  That of a clamp which lets the current
fall lies where the current has ended, and the current tells it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from gapsense.identification.measurements.low_pass import Filtered, Ramp, find_low_pass
from gapsense.identification.measurements.signals import ANYWHERE, noise
from gapsense.identification.options import SHARP

Vector = npt.NDArray[np.float64]

CLAMP = 0.1  # of the largest voltage, against the current, from which it is clamped
LINE = 4  # samples of a falling current through which a line is drawn, and of the rest after it
STEPS = np.arange(1.0 - LINE, 1.0)
CLEAR = 8.0  # times by which it falls in a sample more than noise or bend hide
JUMP, FLAT = 0.1, 0.1  # least jump between two levels, of the range; by how much of it levels may change in a sample


def halves(v: Vector, i: Vector, convention: str) -> Vector:
    """Voltage during the two halves of the interval before each sample (n, 2) [V].

    Of a convention, `trapezoid` takes up to the middle the voltage of the first sample, then that of the second (an
    edge lies half-way on the average); `end` or `start`, that of the sample at the end or the start (held by the
    drive); `filtered` and `slow` are `trapezoid`, but for edges that take their
    time, see `with_convention`.  Where `end` are means over intervals, they tell where in an interval a jump is.
    """
    before = np.concatenate((v[:1], v[:-1]))
    found = np.stack((v if convention == "end" else before, before if convention == "start" else v), axis=1)
    for k, part in ends(v, i):
        found[k] = jump(v[k - 1], v[k], part)
    return sharpen_jumps(found, v) if convention == "end" else np.asarray(found)


def jump(before: float, after: float, part: float) -> Vector:
    """Means over both halves of an interval, after this part of which the voltage jumps (2,) [V]."""
    return np.asarray(after + (before - after) * np.clip([2.0 * part, 2.0 * part - 1.0], 0.0, 1.0))


def sharpen_jumps(found: Vector, means: Vector) -> Vector:
    """Sharpen halves (n, 2) to jumps in intervals whose mean voltage lies between the levels before and after them."""
    v, made = np.pad(means, 2, mode="edge"), np.array(found)
    before, after = v[1:-3], v[3:-1]
    part, is_one = place_jumps((v[:-4], before), means, (after, v[4:]))
    for k in np.flatnonzero(is_one & (np.abs(after - before) > JUMP * np.ptp(means))).tolist():
        made[k] = jump(before[k], after[k], part[k])
    return made


def place_jumps(
    before: Sequence[Vector], means: Vector, after: Sequence[Vector]
) -> tuple[Vector, npt.NDArray[np.bool_]]:
    """Parts of intervals after which the voltage jumps between the levels around them, and whether it does.

    There are two levels `before` each interval and two `after` it: a slow edge goes on in them.
    """
    size = after[0] - before[1]
    on = np.maximum(np.sign(size) * (before[1] - before[0]), np.sign(size) * (after[1] - after[0]))
    part = (after[0] - means) / np.where(size, size, 1.0)
    return part, (on < FLAT * np.abs(size)) & (part > 0.0) & (part < 1.0)


def ends(v: Vector, i: Vector) -> Iterator[tuple[int, float]]:
    """Samples before which a clamp ends with the current, and after which part of the interval it does."""
    yield from ((k, part) for k, part, _ in seen_ends(v, i) if part is not None)


def seen_ends(v: Vector, i: Vector) -> Iterator[tuple[int, float | None, float]]:
    """The same with the standard error of each part, those that noise or the bend of the current hides included."""
    sigma = noise(i)
    sign = float(np.sign(i[int(np.argmax(np.abs(i)))]))
    is_clamped = sign * v < -CLAMP * np.abs(v).max()
    last = np.flatnonzero(is_clamped[LINE - 1 : -LINE] & ~is_clamped[LINE : 1 - LINE]) + LINE
    for k in last.tolist():
        if is_clamped[k - LINE : k].all():
            yield k, *_end(sign * i[k - LINE : k + LINE], sigma)


def _end(i: Vector, sigma: float) -> tuple[float | None, float]:
    """Where a falling current is zero, after the first half of some samples, or None if noise or its bend hides it.

    With the standard error by noise `sigma` of the line that leads there; what is hidden is anywhere in the interval.
    """
    before, after = i[:LINE] - np.median(i[LINE:]), i[LINE:]
    slope, last = np.polyfit(STEPS, before, 1)
    hidden = max(float(np.ptp(after)), float(np.ptp(before - slope * STEPS)))
    if last <= 0.0 or -slope <= CLEAR * hidden:
        return None, ANYWHERE
    part = min(float(last / -slope), 1.0)
    line = 1.0 / LINE + (part - STEPS.mean()) ** 2 / (LINE * STEPS.var())
    return part, float(sigma / -slope * np.sqrt(line + 1.0 / LINE))


UNITS = {"time": "s", "voltage": "V", "current": "A", "position": "m", "mode": "1", "temperature": "degC"}
NEEDED = ("time", "voltage", "current")
SHOWN = 3  # rows that are named for each kind of problem


class Reading(NamedTuple):
    """How files are read."""

    names: Mapping[str, str] = {}  # columns or signals that hold a quantity, where its name does not tell
    convention: str = "trapezoid"  # see `to_record`
    separator: str = ","
    decimal: str = "."
    may_clip: bool = False  # signals at the limits of their converter are taken


class Columns(NamedTuple):
    """What a file holds, in SI units; `rows` are the numbers of its lines, NaN stands for what is no number."""

    file: str
    rows: npt.NDArray[np.int_]
    values: Mapping[str, Vector]
    is_mean: bool = False  # the voltage is the mean over the interval before each sample


class Offset(NamedTuple):
    """What a signal is at rest, where it should be zero."""

    value: float
    error: float  # standard error


class Record(NamedTuple):
    """Uniform samples."""

    name: str  # file without folder and ending
    times: Vector  # [s]
    voltage: Vector  # [V]
    current: Vector  # [A]
    halves: Vector  # voltage during the two halves of the interval before each sample (n, 2) [V]; the first: no meaning
    position: Vector | None  # [m], where it was recorded
    mode: Vector | None  # [1], likewise
    rows: npt.NDArray[np.int_]  # lines of the file, for messages
    is_mean: bool = False  # the voltage is the mean over the interval before each sample
    offsets: Mapping[str, Offset] = {}  # of voltage and current, which have been subtracted
    position_noise: float | None = None  # [m], where the position is to be fitted
    temperature: float | None = None  # mean [degC], where it was recorded
    drive: Mapping[str, float] = {}  # what else than the samples tell is to be taken out of them, see `causes`
    are_edges_seen: bool = False  # whether the edges of the voltage were looked at
    slow: Filtered | None = None  # what they tell, if they take their time; None: they are sharp, or were not looked at
    is_filtered: bool = False  # whether it is a low-pass of both channels, by which the voltage is read
    remarks: tuple[str, ...] = ()  # sentences on what was done to the record, and on what is odd about it

    @property
    def signals(self) -> dict[str, Vector]:
        """Voltage and current by name."""
        return {"voltage": self.voltage, "current": self.current}

    @property
    def filtered(self) -> Filtered | None:
        """The low-pass of both channels, by which the voltage is read."""
        return self.slow if self.is_filtered else None

    @property
    def applied(self) -> Vector:
        """Mean voltage over the interval before each sample [V]."""
        return np.asarray(self.halves.mean(axis=1))

    @property
    def dt(self) -> float:
        """Sampling period [s]."""
        return float((self.times[-1] - self.times[0]) / (self.times.size - 1))


def to_record(columns: Columns, convention: str = "trapezoid") -> Record:
    """Record of columns without problems; see `halves`."""
    v, i, temperature = columns.values["voltage"], columns.values["current"], columns.values.get("temperature")
    made = Record(
        name=Path(columns.file).stem,
        times=columns.values["time"],
        voltage=v,
        current=i,
        halves=sharpen_jumps(np.stack((v, v), axis=1), v),
        position=columns.values.get("position"),
        mode=columns.values.get("mode"),
        rows=columns.rows,
        is_mean=columns.is_mean,
        temperature=None if temperature is None or not np.isfinite(temperature).all() else float(temperature.mean()),
    )
    return with_convention(made, convention)


def with_convention(record: Record, convention: str) -> Record:
    """Give the record another voltage between its samples; edges that it has are not looked at again.

    Slow edges are `filtered` by a low-pass of both channels, or those of a `slow` driver, which the current follows.
    """
    if record.is_mean:
        return record
    seen = record if convention in SHARP else look_at_edges(record)
    slow = None if convention in SHARP else seen.slow
    return seen._replace(
        halves=slow.halves(record.voltage) if slow else halves(record.voltage, record.current, convention),
        is_filtered=convention == "filtered" and can_be("filtered", slow),
    )


def look_at_edges(record: Record) -> Record:
    """The record with what slow edges of its voltage tell."""
    return record if record.are_edges_seen else record._replace(are_edges_seen=True, slow=find_low_pass(record.voltage))


def read_each(records: Sequence[Record], conventions: Sequence[str]) -> dict[str, list[Record]]:
    """The records by each convention that the edges of the first one allow, or by all."""
    seen = [look_at_edges(record) for record in records] if conventions else []
    names = [name for name in conventions if can_be(name, seen[0].slow)] or conventions
    return {name: [with_convention(record, name) for record in seen] for name in names}


def can_be(convention: str, slow: Filtered | None) -> bool:
    """Whether a voltage is read so by its edges: a steady slope is that of a driver, any other that of a filter."""
    if slow is None:
        return convention in SHARP
    return convention == ("slow" if isinstance(slow.low_pass, Ramp) else "filtered")


def part(record: Record, at: slice) -> Record:
    """Some samples of a record."""
    names = ("times", "voltage", "current", "halves", "position", "mode", "rows")
    cut: dict[str, Any] = {name: None if (x := getattr(record, name)) is None else x[at] for name in names}
    return record._replace(**cut)
