"""Operations of a record, from rest to rest, their resistances and the flux linkage: [UKF] (19)-(23).

Operations are found from voltage and current together, whatever the levels are.  The current shows where there is rest.
The voltage shows when an operation begins: it leaves its value at rest before the current can be seen. If the current
never ends, operations are cut at the rising edges of the voltage.

The flux linkage is not measured but integrated, (21), so that an unknown start stays unknown: periodicity gives the
resistance (23), never the offset.  So a record must begin at rest, without current, and the integral begins with its
first operation.  With the resistance of (23) for each operation the integral ends where it began, so that no error is
carried from one operation to the next.  The sums as printed are biased by half a sample: the voltage is that of the
interval, the current its trapezoid.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from gapsense.identification.measurements.record import Record, Vector
from gapsense.identification.measurements.signals import SIGMAS, hidden, noise, resolution, true_runs

Places = npt.NDArray[np.int_]

LOW, HIGH = 0.25, 0.75  # levels between the lowest and the highest voltage that tell an edge from noise
SMALL = {"voltage": 0.02, "current": 0.01}  # what counts as rest, relative to the range of a signal
PAUSE = 0.1  # a rest shorter than this part of the longest activity ends no operation
FEW = 3  # samples; an activity that is shorter is a spike
DRIFT = 0.01  # of the largest current: a level at rest that moves by less is steady
WHITE = 0.7  # of the root mean square of a signal: with more of it in its second differences, it is noise
MANY = 20  # samples at rest whose mean tells its level
EDGES = 3.0  # samples of the largest voltage by which two operations may differ without a resistance that grows
HELD, STEADY = 4, 2e-3  # last part of a closing, as 1 over it, in which means change by less, relative to the range


class Operation(NamedTuple):
    """Samples `start` to `stop` of one operation; the flux linkage is the same at both, unless the coil is held."""

    start: int
    stop: int
    held: int = 0  # samples at the end in which a coil that stays on has settled

    @property
    def inside(self) -> slice:
        """The samples whose intervals, those before them, belong to the operation."""
        return slice(self.start + 1, self.stop + 1)

    @property
    def balanced(self) -> slice:
        """The samples over which the flux linkage does not change, for (23): all, or those of a held coil."""
        return slice(self.stop + 1 - self.held, self.stop + 1) if self.held else self.inside


def coarse(x: Vector) -> float:
    """Standard deviation of noise and rounding together, if the steps of a converter are larger than the noise; or 0.

    The median of the second differences is zero or one step then. Differences above two steps belong to the signal.
    """
    step, curvature = resolution(x), np.abs(np.diff(x, 2))
    works = curvature[np.abs(x[1:-1]) > SMALL["current"] * np.ptp(x)]
    if not works.size or np.median(curvature) > 1.01 * step:
        return 0.0
    return float(np.sqrt(np.mean(np.minimum(works, 2.0 * step) ** 2) / 6.0))


def drift(record: Record) -> float:
    """How far the level of the current at rest moves from operation to operation, beyond chance [A].

    Rest before each operation counts, and that at the end of the record, where the current is steady.
    """
    i, off = record.current, np.abs(record.voltage) < leaves(record.voltage, "voltage")
    ends = [k for k in (*starts(record), record.times.size) if k >= MANY]
    rests = [i[k - MANY : k] for k in ends if off[k - MANY : k].all()]
    sigma = max(noise(i), hidden(i)) / np.sqrt(MANY / 2)
    still = [x for x in rests if abs(x[: MANY // 2].mean() - x[MANY // 2 :].mean()) < SIGMAS * np.sqrt(2.0) * sigma]
    if len(still) < 2:
        return 0.0
    levels = np.array([x.mean() for x in still])
    moved = float(levels[-1] - levels[0])
    return moved if abs(moved) > max(SIGMAS * sigma, DRIFT * float(np.abs(i).max())) else 0.0


def leaves(x: Vector, name: str) -> float:
    """How far the voltage or the current may be from its value at rest; the levels of a drive are no converter's."""
    found = SMALL[name] * float(np.ptp(x)) + SIGMAS * max(noise(x), hidden(x))
    return min(found, LOW * float(np.ptp(x))) if name == "voltage" else found


def at_rest(record: Record) -> int:
    """How many samples at the start of a record differ by nothing but noise."""
    first = record.times.size
    for name in SMALL:
        x = np.asarray(getattr(record, name))
        left = np.flatnonzero(np.abs(x - np.median(x[: 2 * FEW])) > leaves(x, name))
        first = min([first, *left[:1].tolist()])
    return first


def activities(record: Record) -> list[tuple[int, int]]:
    """First sample of each stretch in which current flows, and the first one after it."""
    i = record.current  # however coarse, it is noise where neighbouring samples differ as much as all samples do
    if i.size > 2 and np.std(np.diff(i, 2)) / np.sqrt(6.0) > WHITE * np.sqrt(np.mean(i**2)) > 0.0:
        return []
    rest = float(np.median(i[: max(1, at_rest(record))]))
    runs = [run for run in true_runs(np.abs(i - rest) > leaves(i, "current")) if run[1] - run[0] >= FEW]
    pause = PAUSE * max((end - begin for begin, end in runs), default=0)
    v, limit, joined = record.voltage, leaves(record.voltage, "voltage"), list[tuple[int, int]]()
    for begin, end in runs:
        ended = joined[-1][1] if joined else 0
        # If the voltage stays at rest until the next activity ends, this is due to a mover that goes back.
        is_one = begin - ended < pause or np.all(np.abs(v[ended:end] - np.median(v[ended:begin])) <= limit)
        joined.append((joined.pop()[0] if joined and is_one else begin, end))
    return joined


def starts(record: Record) -> list[int]:
    """The last sample at rest before each operation, complete or not."""
    return _before(activities(record), record)


def _before(active: list[tuple[int, int]], record: Record) -> list[int]:
    v, limit, found, rest = record.voltage, leaves(record.voltage, "voltage"), list[int](), 0
    for begin, end in active:
        usual, k = float(np.median(v[rest : max(rest + 1, begin)])), max(begin - 1, rest)
        while k > rest and abs(v[k] - usual) > limit:
            k -= 1
        found.append(k)
        rest = end
    return found


def operations(record: Record, period: float | None = None) -> list[Operation]:
    """Complete operations: from rest to rest, or every `period` [s] from the first one on.

    The last one ends with its usual length, or else with the record, if the current has ended by then.  Without any, a
    closing is one if the coil is held until all has settled.
    """
    active, last = activities(record), record.times.size - 1
    begins = _before(active, record)
    if not begins:
        return []
    if period is not None:
        count = int((last - begins[0]) * record.dt / period + 1e-6)
        return _split_at(np.round(begins[0] + np.arange(count + 1) * (period / record.dt)).astype(int).tolist())
    end = active[-1][1]
    if len(begins) == 1 and end > last:
        begins = edges(record.voltage).tolist()
        ends = [2 * begins[-1] - begins[-2]] if len(begins) > 1 else []
        return _split_at(begins + [k for k in ends if k <= last]) or _closing(record, begins[0] if begins else 0, last)
    usual = 2 * begins[-1] - begins[-2] if len(begins) > 1 else last
    return _split_at(begins + ([usual if end <= usual <= last else last] if end <= last else []))


def _closing(record: Record, start: int, stop: int) -> list[Operation]:
    """The operation of a coil that stays on, if its voltage and its current do not change in the last part of it."""
    count = (stop - start) // HELD
    if count < MANY:
        return []
    last = slice(stop + 1 - 2 * (count // 2), stop + 1)
    for name in SMALL:
        x = getattr(record, name)
        before, after = x[last].reshape(2, -1).mean(axis=1)
        chance = SIGMAS * max(noise(x), hidden(x)) / np.sqrt(count / 4.0)
        if abs(after - before) > max(chance, STEADY * np.ptp(x)) or abs(after) < leaves(x, name):
            return []
    return [Operation(start, stop, last.stop - last.start)]


def _split_at(places: list[int]) -> list[Operation]:
    return [Operation(a, b) for a, b in zip(places[:-1], places[1:])]


def edges(voltage: Vector) -> Places:
    """Last sample before each rise of the voltage from its low to its high level."""
    low, high = float(voltage.min()), float(voltage.max())
    level = np.where(voltage < low + LOW * (high - low), 0, np.where(voltage > low + HIGH * (high - low), 1, -1))
    known = np.flatnonzero(level >= 0)
    rises = known[1:][(level[known[1:]] == 1) & (level[known[:-1]] == 0)]
    first = [int(known[np.searchsorted(known, k) - 1]) for k in rises]
    return np.array(([0] if level[0] == 1 else []) + first, dtype=int)


class Flux(NamedTuple):
    """Resistance and flux linkage of a record, from the start of its first operation on."""

    operations: list[Operation]  # complete ones
    resistances: Vector  # of each [Ohm], (23)
    per_sample: Vector  # resistance of the interval before each sample [Ohm]
    flux_linkage: Vector  # at each sample [Wb]; zero before the first operation
    warmed: Vector  # what a growing resistance takes beside that from the interval before each sample [V]


def trapezoid(current: Vector) -> Vector:
    """Mean current over the interval before each sample (..., n) [A]; the first has no interval."""
    return np.concatenate((current[..., :1], 0.5 * (current[..., 1:] + current[..., :-1])), axis=-1)


def estimate(record: Record, found: list[Operation]) -> Flux:
    """Flux linkage by (21), with the resistance of every operation by (23): it ends where it began."""
    means, applied = trapezoid(record.current), record.applied
    resistances = np.array([applied[o.balanced].sum() / means[o.balanced].sum() for o in found])
    per_sample = np.full(record.times.size, resistances[-1])
    per_sample[: found[0].start + 1] = resistances[0]
    for operation, R in zip(found, resistances):
        per_sample[operation.inside] = R
    volts = min(float(np.abs(applied[o.inside]).sum()) for o in found)
    more = estimate_warming(
        means, found, resistances, EDGES * float(np.abs(applied).max()) / volts if volts else np.inf
    )
    rates = applied - per_sample * means - more
    rates[: found[0].start + 1] = 0.0
    return Flux(
        operations=found,
        resistances=resistances,
        per_sample=per_sample,
        flux_linkage=record.dt * np.cumsum(rates),
        warmed=more,
    )


def estimate_warming(means: Vector, found: list[Operation], R: Vector, least: float) -> Vector:
    """Estimate what a resistance that grows from operation to operation takes beside its mean [V].

    Within an operation that is less at first, then more. The resistance must grow by `least` of itself in all, because
    the places of edges change it too.
    """
    more = np.zeros(means.size)
    if len(found) < 2 or R[-1] < (1.0 + least) * R[0] or np.any(np.diff(R) <= 0.0):
        return more
    places = [np.arange(o.start + 1.0, o.stop + 1.0) for o in found]
    middles = [float(np.average(at, weights=means[o.inside])) for at, o in zip(places, found)]
    for at, middle, slope, o in zip(places, middles, np.gradient(R, middles), found):
        more[o.inside] = slope * (at - middle) * means[o.inside]
    return more


def mean_resistance(*records: Record) -> float:
    """Mean resistance by (23) of all operations of some records [Ohm]."""
    return float(np.mean(np.concatenate([estimate(record, operations(record)).resistances for record in records])))


def coil(record: Record, operation: Operation) -> tuple[float, float]:
    """Inductance of the coil of constant L and R that is nearest to an operation, and how far it is from that.

    The integral of v = R i + L di/dt, by least squares: unlike (23) it does not depend on the end of the operation.
    """
    i, means = record.current[operation.inside], trapezoid(record.current[operation.start : operation.stop + 1])[1:]
    charge, volts = (np.cumsum(x) * record.dt for x in (means, record.halves[operation.inside].mean(axis=1)))
    both = np.stack((charge, i), axis=1)
    found = np.linalg.lstsq(both, volts, rcond=None)[0]
    L = float(found[1])
    largest = float(np.abs(L * i).max())
    return L, float(np.sqrt(np.mean((volts - both @ found) ** 2))) / largest if largest else 0.0
