"""What the identified model leaves of the measured current, beside the noise: whether and where it fails to explain it.

Standard errors follow from the residuals as if these were noise.  Where the model is another one than the device, or
the record is not what the coil saw, they are small all the same; the residual, several times the noise, tells.

The noise of voltage and current is what estimators that use such signals are to take.  Slow noise shows at rest only,
and what a converter hides shows nowhere.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from gapsense.identification.least_squares import rms
from gapsense.identification.measurements.hum import Hum, hum
from gapsense.identification.measurements.operations import coarse, starts
from gapsense.identification.measurements.record import Record, Vector
from gapsense.identification.measurements.signals import SIGMAS, hidden, noise, resolution, true_runs
from gapsense.identification.valve.model import JUMP, Trajectory
from gapsense.report.table import quantity

EXPLAINED = 1.25  # times the noise
FLOOR = 1e-3  # of the largest current: the sampling alone leaves 1e-4
SMALL = 3e-3  # of the largest current: less does not count
REST = 20  # samples before the first operation that tell the noise
AFTER = 4  # samples after a jump of the voltage that count as its edge
HUMS = 3.0  # amplitudes of hum that a residual may have by it: in the voltage's balance and the offset, too
CAUSES = {
    "edges": "what the voltage is between two samples (`--voltage`), or too few samples",
    "motion": "the mechanics, the law of the gap, or core losses or a saturation that this model does not have: see"
    " `gapsense commission`",
    "hold": "a voltage that is not the coil's (drops of the driver, a supply that sags, PWM sampled in step), a coil"
    " that gets warm, or a core that saturates otherwise (`gapsense commission`)",
    "decay": "core losses, which this model does not have, or a drop in the path of the falling current",
    "rest": "an offset of the current",
}
MUCH = 0.25  # part of the squares while the coil is held, from which on what creeps there is the cause
CREEPS = {  # while the coil is held
    "rises": "a zero of the current that drifts, or a supply that rises by more than the recorded voltage",
    "falls": "a coil that gets warm, or a zero of the current that drifts",
}


class Residual(NamedTuple):
    """Of one record, from its first operation on."""

    record: str
    rms: float  # [A]
    noise: float  # of the measured current, what the converter hides included [A]
    limit: float  # up to which the model explains the record [A]
    correlation: float  # of neighbouring residuals; 0 for noise
    places: Mapping[str, float]  # part of the squares, by where they lie
    hum: Hum | None  # of the current at rest, if too much is left, which may be due to it
    creep: float = 0.0  # by which what is left moves steadily while the coil is held, if it does [A]

    @property
    def is_explained(self) -> bool:
        """Whether noise explains it."""
        return self.rms <= self.limit

    @property
    def worst(self) -> str:
        """Where most of it lies."""
        return max(self.places, key=lambda place: self.places[place])


def residual(record: Record, model: Trajectory, first: int) -> Residual:
    """What the model, which begins at sample `first`, leaves of a record."""
    i, error = record.current[first:], record.current[first:] - model.current
    squares, where = error**2, _places(record, model, first)
    sigma = float(np.hypot(noise_of(record, first), _estimate_drive_noise(record, model, first, where["hold"])))
    left, limit = rms(error), max(EXPLAINED * sigma, _floor(i))
    found = hum(record) if left > limit else None
    places = {name: float(squares[at].sum() / squares.sum()) for name, at in where.items()}
    return Residual(
        record=record.name,
        rms=left,
        noise=sigma,
        limit=limit,
        correlation=float(error[1:] @ error[:-1] / (error @ error)),
        places=places,
        hum=found if found and left**2 < sigma**2 + (HUMS * found.amplitude) ** 2 else None,
        creep=_creep(error, where["hold"]) if left > limit else 0.0,
    )


def noise_of(record: Record, first: int) -> float:
    """Noise of the current: slow noise shows at rest only, and what a converter hides shows nowhere [A]."""
    i = record.current
    return float(max(noise(i), hidden(i), coarse(i), i[:first].std() if first >= REST else 0.0))


def _estimate_drive_noise(record: Record, model: Trajectory, first: int, hold: npt.NDArray[np.bool_]) -> float:
    """Estimate the noise that the voltage of a coarse converter makes in the model's current while held [A]."""
    a, b = _longest(hold)
    if b - a < 2 * REST:
        return 0.0
    late, x = slice((a + b) // 2, b), np.arange(b - (a + b) // 2)
    i, v = model.current[late], record.voltage
    moved = float(np.std(i - np.polyval(np.polyfit(x, i, 2), x)))
    most = max(_of_drive(v, first), np.sqrt(3.0) * rounding(v))  # of a level between two steps, half of one
    return min(moved, float(most * np.mean(i) / np.mean(v[first:][late])))


def _creep(error: Vector, hold: npt.NDArray[np.bool_]) -> float:
    """How far what is left moves late in the longest hold, if it does so at one pace and is little else; or 0 [A]."""
    a, b = _longest(hold)
    if b - a < 4 * REST:
        return 0.0
    held = error[a + (b - a) // 4 : b]
    steps = np.diff([part.mean() for part in np.array_split(held, 4)])
    chance = SIGMAS * noise(held) * np.sqrt(8.0 / held.size)
    least, most = np.sort(np.abs(steps))[[0, -1]]
    whole = float(steps.sum()) * 4.0 / 3.0
    is_steady = least > max(chance, 0.5 * most) and abs(float(np.sign(steps).sum())) == steps.size
    return whole if is_steady and abs(whole) > rms(held) else 0.0


def _longest(hold: npt.NDArray[np.bool_]) -> tuple[int, int]:
    """The longest time that the coil is held."""
    return max(true_runs(hold), key=lambda run: run[1] - run[0], default=(0, 0))


def is_small(error: Vector, record: Record, first: int) -> bool:
    """Whether an error of the current is no more than sampling alone leaves."""
    return float(np.sqrt(np.mean(error**2))) <= _floor(record.current[first:])


def _floor(current: Vector) -> float:
    return FLOOR * float(np.abs(current).max())


def _places(record: Record, model: Trajectory, first: int) -> dict[str, npt.NDArray[np.bool_]]:
    """Samples by what the device does there."""
    v, at = record.voltage[first:], model.position
    jumps = np.flatnonzero(np.abs(np.diff(v)) > JUMP * np.ptp(v))
    edges = np.zeros(v.size, dtype=bool)
    edges[np.clip(jumps[:, None] + np.arange(AFTER + 1), 0, v.size - 1)] = True
    moves = np.convolve(np.diff(at, prepend=at[0]) != 0.0, np.ones(3), mode="same") > 0.0  # and their neighbours
    flows = np.abs(model.current) > SMALL * np.abs(model.current).max()
    driven = v > 0.5 * v.max()
    left = ~edges & ~moves
    return {
        "edges": edges,
        "motion": moves & ~edges,
        "hold": left & flows & driven,
        "decay": left & flows & ~driven,
        "rest": left & ~flows,
    }


def verdict(found: Residual, current: str, allowed: str, causes: Mapping[str, str] = CAUSES) -> str:
    """Whether the model explains the record; `current` and `allowed` are the residual and its limit as text."""
    if found.is_explained:
        return f"{found.record}: the model explains the current to {current}, which is noise."
    return (
        f"{found.record}: the model leaves {current} of the current, more than {allowed}, {found.rms / found.noise:.2g}"
        f" times its noise: it does not explain this record. Do not rely on values and standard errors."
        f" {100.0 * found.places[found.worst]:.0f} % of it lies in `{found.worst}`; {cause(found, causes)}."
    )


def cause(found: Residual, causes: Mapping[str, str] = CAUSES) -> str:
    """What has usually gone wrong where such a residual is left."""
    if said := hums([found]):
        return said
    if found.creep and found.places["hold"] > MUCH:
        moves = "rises" if found.creep > 0.0 else "falls"
        by = quantity(abs(found.creep), "A")
        return f"while the coil is held it {moves} steadily by {by}: the usual cause is {CREEPS[moves]}"
    return f"the usual cause is {causes[found.worst]}"


def hums(found: Sequence[Residual]) -> str:
    """That the usual cause is hum of the mains, if it is."""
    most = max((r.hum for r in found if r.hum), key=lambda hum: hum.amplitude, default=None)
    return f"{most.told}: the usual cause is hum of the mains" if most else ""


LEAST = 1e-3  # of the largest value: with less, an estimator takes what its model leaves for a fault
COARSEST = 0.02  # step of a converter relative to the range; what is coarser are levels of the drive


def noises(records: Sequence[Record]) -> dict[str, float]:
    """The largest noise of some records, by the parameters of estimators; three digits are more than it is known to."""
    firsts = [next(iter(starts(record)), 0) for record in records]
    found = {
        "noise.voltage": max(_least(_of_drive(r.voltage, first), r.voltage) for r, first in zip(records, firsts)),
        "noise.current": max(_least(noise_of(r, first), r.current) for r, first in zip(records, firsts)),
    }
    return {name: float(f"{value:.3g}") for name, value in found.items()}


def _of_drive(v: Vector, first: int) -> float:
    """That of the voltage: at rest if there is any, for a drive that switches often has jumps everywhere."""
    return max(rounding(v), float(v[:first].std()) if first >= REST else noise(v))


def rounding(x: Vector) -> float:
    """What the steps of a converter hide of a signal that may also have the few levels of a drive."""
    return hidden(x) if resolution(x) < COARSEST * np.ptp(x) else 0.0


def _least(found: float, x: Vector) -> float:
    return max(found, LEAST * float(np.abs(x).max()))
