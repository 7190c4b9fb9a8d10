"""Records of measured voltage and current: uniform samples in SI units."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from gapsense.identification.measurements.halves import halves

Vector = npt.NDArray[np.float64]

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
    remarks: tuple[str, ...] = ()  # sentences on what was done to the record, and on what is odd about it

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
    return Record(
        name=Path(columns.file).stem,
        times=columns.values["time"],
        voltage=v,
        current=i,
        halves=np.stack((v, v), axis=1) if columns.is_mean else halves(v, i, convention),
        position=columns.values.get("position"),
        mode=columns.values.get("mode"),
        rows=columns.rows,
        is_mean=columns.is_mean,
        temperature=None if temperature is None or not np.isfinite(temperature).all() else float(temperature.mean()),
    )


def between(record: Record, convention: str) -> Record:
    """The record with another voltage between its samples."""
    return record if record.is_mean else record._replace(halves=halves(record.voltage, record.current, convention))


def until(record: Record, last: int) -> Record:
    """The record up to a sample."""
    names = ("times", "voltage", "current", "halves", "position", "mode", "rows")
    samples = {name: getattr(record, name) for name in names}
    cut: dict[str, Any] = {name: x if x is None else x[: last + 1] for name, x in samples.items()}
    return record._replace(**cut)
