"""Causes that make a record wrong about its device: each changes the recorded voltage or current by one value."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from gapsense.identification.measurements import signals
from gapsense.identification.measurements.operations import trapezoid
from gapsense.identification.measurements.record import Vector
from gapsense.identification.measurements.signals import SIGMAS, noise, true_runs
from gapsense.identification.measurements.switching import is_switched

Matrix = npt.NDArray[np.float64]
ON = 0.25  # of the largest voltage: what is more is on, also pulses of less height
LEVEL = 0.01  # of the range of the current, by which its end is found
LONGEST = 50  # samples over which the noise of a current that ends is averaged
PLACE = "place."  # begins the name of a cause that is about one edge of the voltage: `place.RECORD.SAMPLE`
STEEP = 0.1  # of the range of the voltage: a change between two samples of an edge
BESIDE = 3  # samples before and after an edge that go with it, and with no other one
MOST = 60  # edges whose places are sought
ANYWHERE = 0.5  # standard deviation of the place of an edge, in samples, before anything is known


class Signals(NamedTuple):
    """Voltage and current of a record, or of the part that is fitted."""

    halves: Matrix  # voltage during the two halves of the interval before each sample (n, 2) [V]
    current: Vector  # [A]
    dt: float  # sampling period [s]
    resistance: float  # of the coil, about [Ohm]
    first: int = 0  # sample of the record with which it begins


class Cause(NamedTuple):
    """One cause."""

    unit: str
    scale: Callable[[Signals], float]  # what is large
    change: Callable[[Signals, float], Signals]  # the signals of the model, if the cause has this value
    sentence: str  # what it is, before its value
    is_positive: bool = False  # as resistances are
    small: float = 1e-4  # value for a difference quotient, of `scale`


def apply_causes(s: Signals, values: Mapping[str, float]) -> Signals:
    """The signals that the model is to explain, if the causes have these values."""
    for name, value in values.items():
        s = cause(name).change(s, value)
    return s


def cause(name: str) -> Cause:
    """The cause of that name, which may be about one edge."""
    if not is_place(name):
        return CAUSES[name] if name in CAUSES else HIDDEN[name]
    sample = int(name.rpartition(".")[2])
    said = "an edge that comes later, in samples, by"
    return Cause("1", _one, lambda s, x: move_edge(s, sample, x), said, small=0.01)


def is_place(name: str) -> bool:
    """Whether a cause is about one edge."""
    return name.startswith(PLACE)


def of_record(values: Mapping[str, float], number: int) -> dict[str, float]:
    """Those values of causes that concern the record of that number."""
    return {name: x for name, x in values.items() if not is_place(name) or name.startswith(f"{PLACE}{number}.")}


def edges(voltage: Vector, hidden: Collection[int] = ()) -> list[int]:
    """The sample after each edge of a voltage; none if edges follow each other too fast. The end of a clamp is no edge.

    The current tells where a clamp ends, see `halves`. If it does not (`hidden`), that end is an edge, if it is far
    enough from the others.
    """
    steps, least, found, unseen = np.abs(np.diff(voltage)), STEEP * float(np.ptp(voltage)), list[int](), list[int]()
    for a, b in signals.edges(voltage, STEEP):
        is_end = voltage[a] < -least and abs(voltage[b]) < least
        (unseen if is_end else found).append(a + 1 + int(np.argmax(steps[a:b])))
    apart = np.diff([-BESIDE, *found])
    if len(found) > MOST or np.any(apart <= 2 * BESIDE):
        return []
    more = [k for k in unseen if k in hidden and all(abs(k - at) > 2 * BESIDE for at in found)]
    return sorted([*found, *more]) if len(found) + len(more) <= MOST else found


def move_edge(s: Signals, sample: int, later: float) -> Signals:
    """Move the edge before a sample of the record later by so many samples, with the volt-seconds that it brings."""
    k = sample - s.first
    if not 0 < k < len(s.halves):
        return s
    at = slice(max(k - BESIDE, 1), k + BESIDE + 1)
    sums = np.cumsum(np.pad(s.halves[at].reshape(-1), 2 * BESIDE, mode="edge"))
    places = np.arange(sums.size)
    moved, halves = np.interp(places - 2.0 * later, places, sums), s.halves.copy()
    halves[at] = np.diff(moved)[2 * BESIDE - 1 : 1 - 2 * BESIDE - 1].reshape(-1, 2)
    return s._replace(halves=halves)


def delay_voltage(s: Signals, value: float) -> Signals:
    """Delay the voltage by so many seconds; before the first sample it was as at that."""
    flat = s.halves.reshape(-1)
    at = np.arange(flat.size) - 2.0 * value / s.dt
    return s._replace(halves=np.interp(at, np.arange(flat.size), flat).reshape(-1, 2))


def series(s: Signals, value: float) -> Signals:
    """A resistance in series takes its part of the voltage while this is on."""
    before = np.concatenate((s.current[:1], s.current[:-1]))
    of_halves = np.stack((0.75 * before + 0.25 * s.current, 0.25 * before + 0.75 * s.current), axis=1)
    return s._replace(halves=s.halves - np.where(is_on(s), value * of_halves, 0.0))


def drop(s: Signals, value: float) -> Signals:
    """A diode in the path of the current takes its part while the voltage is off."""
    return s._replace(halves=s.halves - value * falls(s))


def eddy(s: Signals, value: float) -> Signals:
    """Eddy currents, as a conductance beside the coil."""
    return s._replace(current=s.current - value * (s.halves.mean(axis=1) - s.resistance * trapezoid(s.current)))


def tail(s: Signals, value: float) -> Signals:
    """A drop of so many volts ends later, by as much as its end is uncertain."""
    return s._replace(halves=s.halves - value * (falls(s, 1.0) - falls(s)))


def drift(s: Signals, value: float) -> Signals:
    """The resistance grows by this part while current flows."""
    grown = np.zeros(s.current.size)
    for first, last in true_runs(np.abs(s.current) > LEVEL * float(np.ptp(s.current))):
        grown[first:last] = np.linspace(-0.5, 0.5, last - first)
    lost = value * s.resistance * trapezoid(grown * s.current)
    return s._replace(halves=s.halves - lost[:, None])


def is_on(s: Signals) -> npt.NDArray[np.bool_]:
    """Whether the voltage is on, in each half."""
    return np.asarray(s.halves > ON * s.halves.max())


def falls(s: Signals, later: float = 0.0) -> Matrix:
    """How much of each half the current falls in, from where the voltage is off to where nothing flows any more.

    The current ends in noise, so its end is where a line through two and one hundredths of its range leads to. It may
    be taken `later`, in times that this line needs.
    """
    level, i, on = LEVEL * float(np.ptp(s.current)), s.current, is_on(s)
    half = int(np.clip((2.0 * SIGMAS * noise(i) / level) ** 2, 0.0, LONGEST)) // 2 if level else 0
    length = 2 * half + 1  # odd, or what is smooth would be early
    smooth = np.convolve(i, np.full(length, 1.0 / length), mode="same")
    edges = 0.5 * np.arange(on.size) - 1.0  # where the halves begin, in samples
    part = np.zeros(on.size)
    for first, last in true_runs(smooth > 2.0 * level):
        below = np.flatnonzero(smooth[last:] <= level)
        end = last + (2.0 + later) * float(below[0]) if below.size else float(i.size)
        begin = first + float(np.argmax(on[first:last].any(axis=1)))
        part = np.maximum(part, np.where(edges >= begin, np.clip(2.0 * (end - edges), 0.0, 1.0), 0.0))
    return np.where(on, 0.0, part.reshape(-1, 2))


def shift_pwm_mean(s: Signals, value: float) -> Signals:
    """Shift the mean of PWM from its samples by so many volts."""
    pulses = is_switched(s.halves.reshape(-1), s.current.repeat(2))
    return s._replace(halves=s.halves - value * pulses.reshape(-1, 2))


def _volts(s: Signals) -> float:
    return float(np.abs(s.halves).max())


def _one(s: Signals) -> float:
    return 1.0


CAUSES: Mapping[str, Cause] = {
    "delay": Cause("s", lambda s: s.dt, delay_voltage, "a current that is late, beside the voltage, by", small=1e-2),
    "offset": Cause(
        unit="A",
        scale=lambda s: float(np.abs(s.current).max()),
        change=lambda s, x: s._replace(current=s.current - x),
        sentence="an offset of the current of",
    ),
    "shift": Cause("V", _volts, lambda s, x: s._replace(halves=s.halves - x), "an offset of the voltage of"),
    "series": Cause(
        "Ohm", lambda s: s.resistance, series, "a resistance in series while the voltage is on, of", is_positive=True
    ),
    "drop": Cause("V", _volts, drop, "a drop while the current falls, of", is_positive=True),
    "eddy": Cause("S", lambda s: 1.0 / s.resistance, eddy, "eddy currents of a core with", is_positive=True),
    "switched": Cause("V", _volts, shift_pwm_mean, "a mean of the PWM that its samples do not tell, off by"),
    "drift": Cause("1", _one, drift, "a coil that gets warm: its resistance grows during an operation, relatively, by"),
}
HIDDEN = {  # no residual need show these: other values of the parameters explain much the same; relative, but for volts
    "current": Cause(
        "1", _one, lambda s, x: s._replace(current=s.current * (1.0 - x)), "a current that is too large by"
    ),
    "voltage": Cause("1", _one, lambda s, x: s._replace(halves=s.halves * (1.0 - x)), "a voltage that is too large by"),
    "tail": Cause("V", _volts, tail, "a drop that ends later, of"),
}
