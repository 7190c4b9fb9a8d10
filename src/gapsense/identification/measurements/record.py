"""Records of measured voltage and current: uniform samples in SI units, and the voltage between two of them.

An edge of the drive lies anywhere between two samples: a convention says where.  That of a clamp which lets the current
fall lies where the current has ended, and the current tells it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from gapsense.identification.measurements.low_pass import Filtered, Ramp, find_low_pass

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
    drive); `filtered` is `trapezoid`, but for edges that come through a filter, see `between`.  Where `end` are means
    over intervals, they tell where in an interval a jump is.
    """
    before = np.concatenate((v[:1], v[:-1]))
    found = np.stack((v if convention == "end" else before, before if convention == "start" else v), axis=1)
    for k, part in ends(v, i):
        found[k] = jump(v[k - 1], v[k], part)
    return sharpened(found, v) if convention == "end" else np.asarray(found)


def jump(before: float, after: float, part: float) -> Vector:
    """Means over both halves of an interval, after this part of which the voltage jumps (2,) [V]."""
    return np.asarray(after + (before - after) * np.clip([2.0 * part, 2.0 * part - 1.0], 0.0, 1.0))


def sharpened(found: Vector, means: Vector) -> Vector:
    """Halves (n, 2), with a jump in the intervals whose mean voltage lies between the levels before and after them."""
    v, made = np.pad(means, 2, mode="edge"), np.array(found)
    levels, size = (v[1:-3], v[3:-1]), v[3:-1] - v[1:-3]
    part = (levels[1] - means) / np.where(size, size, 1.0)
    on = np.maximum(np.sign(size) * (levels[0] - v[:-4]), np.sign(size) * (v[4:] - levels[1]))  # a slow edge goes on
    is_one = (on < FLAT * np.abs(size)) & (np.abs(size) > JUMP * np.ptp(means)) & (part > 0.0) & (part < 1.0)
    for k in np.flatnonzero(is_one).tolist():
        made[k] = jump(levels[0][k], levels[1][k], part[k])
    return made


def ends(v: Vector, i: Vector) -> Iterator[tuple[int, float]]:
    """Samples before which a clamp ends with the current, and after which part of the interval it does."""
    sign = float(np.sign(i[int(np.argmax(np.abs(i)))]))
    is_clamped = sign * v < -CLAMP * np.abs(v).max()
    last = np.flatnonzero(is_clamped[LINE - 1 : -LINE] & ~is_clamped[LINE : 1 - LINE]) + LINE
    for k in last.tolist():
        if is_clamped[k - LINE : k].all() and (part := _end(sign * i[k - LINE : k + LINE])) is not None:
            yield k, part


def _end(i: Vector) -> float | None:
    """Where a falling current is zero, after the first half of some samples; None if noise or its bend hides it."""
    before, after = i[:LINE] - np.median(i[LINE:]), i[LINE:]
    slope, last = np.polyfit(STEPS, before, 1)
    hidden = max(float(np.ptp(after)), float(np.ptp(before - slope * STEPS)))
    return min(float(last / -slope), 1.0) if last > 0.0 and -slope > CLEAR * hidden else None


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
    filtered: Filtered | None = None  # a low-pass of both channels, by which the voltage is read
    remarks: tuple[str, ...] = ()  # sentences on what was done to the record, and on what is odd about it

    @property
    def signals(self) -> dict[str, Vector]:
        """Voltage and current by name."""
        return {"voltage": self.voltage, "current": self.current}

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
        halves=sharpened(np.stack((v, v), axis=1), v),
        position=columns.values.get("position"),
        mode=columns.values.get("mode"),
        rows=columns.rows,
        is_mean=columns.is_mean,
        temperature=None if temperature is None or not np.isfinite(temperature).all() else float(temperature.mean()),
    )
    return between(made, convention)


def between(record: Record, convention: str) -> Record:
    """The record with another voltage between its samples; a low-pass that it has is not sought again."""
    if record.is_mean:
        return record
    v, is_filtered = record.voltage, convention == "filtered"
    found = (record.filtered or find_low_pass(v)) if is_filtered else None
    filter_ = None if found and isinstance(found.low_pass, Ramp) else found
    return record._replace(halves=found.halves(v) if found else halves(v, record.current, convention), filtered=filter_)


def part(record: Record, at: slice) -> Record:
    """Some samples of a record."""
    names = ("times", "voltage", "current", "halves", "position", "mode", "rows")
    cut: dict[str, Any] = {name: None if (x := getattr(record, name)) is None else x[at] for name in names}
    return record._replace(**cut)
