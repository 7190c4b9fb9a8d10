"""What a signal does as the base step of its run is halved: its order, its limit, and how far it is off."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gapsense.cosim.fmu.descriptions import Variable
from gapsense.cosim.result.compare import moved

Vector = npt.NDArray[np.float64]
ROUNDING = 1e-9  # of the range: changes below it tell nothing
RATIOS = 2  # of changes that have to give the same order
ORDERS, APART = (0.5, 8.0), 0.25  # orders that are believed, and by how much two in a row may differ
FINEST_QUANTUM = 2.0**-24  # in the range of a signal; converters are no finer
EDGE_ROWS = 1  # by which an edge may come earlier or later


@dataclass(frozen=True)
class Tendency:
    """What a recorded signal does as the base step is halved; errors and changes are in its unit.

    They are the greatest of all rows, but for rows next to an edge that has moved by no more than a row.
    """

    signal: str
    unit: str
    nominal: float
    range: float  # range in the finest run; the nominal value if that is nearly 0
    changes: tuple[float, ...]  # from each run to the next finer one
    errors: tuple[float, ...]  # of each run
    order: float | None  # observed; None where there is none
    step: float | None  # the longest base step [s] that keeps the tolerance; None if it is not known
    is_least: bool = False  # a longer step than `step` would do too
    at_edges: float = 0.0  # greatest difference at the step of the scenario where an edge comes a row earlier or later
    why: str = ""  # it does not converge

    @property
    def is_same(self) -> bool:
        """True if the step does not matter, but for rounding and next to edges."""
        return all(change <= ROUNDING * self.range for change in self.changes)

    @property
    def error(self) -> float:
        """Error at the step of the scenario."""
        return self.errors[0]

    @property
    def of_range(self) -> float:
        """Error at the step of the scenario as a share of the range."""
        return self.error / self.range

    @property
    def of_nominal(self) -> float:
        """The same as a share of the nominal value."""
        return self.error / self.nominal


def is_discrete(variable: Variable, values: Iterable[Vector]) -> bool:
    """True for a signal that has whole numbers only, as modes and switches do."""
    return variable.type != "Real" or all(bool((v == np.round(v)).all()) for v in values)


def excused(values: Vector, reference: Vector) -> npt.NDArray[np.bool_]:
    """Rows at which a signal differs only because an edge, or a gap of lost samples, comes a row earlier or later."""
    mine, theirs = np.isnan(values), np.isnan(reference)
    gap = (mine != theirs) & beside(mine) & beside(theirs) & beside(~mine) & beside(~theirs)
    found: npt.NDArray[np.bool_] = moved(values, reference, 0.0, EDGE_ROWS) | gap
    return found


def beside(rows: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """Rows that are chosen or next to one that is."""
    padded = np.pad(rows, 1)
    found: npt.NDArray[np.bool_] = padded[:-2] | padded[1:-1] | padded[2:]
    return found


def greatest(values: Vector, reference: Vector, limit: Vector | None = None) -> float:
    """Greatest difference that no edge excuses, to the reference or to the limit of all runs."""
    difference = apart(values, reference if limit is None else limit)
    return float(np.where(excused(values, reference), 0.0, difference).max(initial=0.0))


def largest(differences: Vector) -> float:
    """Greatest of those that are finite."""
    return float(differences[np.isfinite(differences)].max(initial=0.0))


def apart(values: Vector, reference: Vector) -> Vector:
    """Difference at each row: none where both are lost samples, infinite where one is."""
    with np.errstate(invalid="ignore"):
        difference = np.abs(values - reference)
    return np.where(np.isnan(values) & np.isnan(reference), 0.0, np.where(np.isnan(difference), np.inf, difference))


def observed(changes: Sequence[float], rounding: float, ratios: int = 2) -> float | None:
    """Order p at which changes fall as 2^-p, from the last ones above rounding; None if they tell two orders.

    An order is believed if so many ratios in a row give nearly the same.
    """
    counted = [change for change in changes if change > rounding][-ratios - 1 :]
    if len(counted) <= ratios:
        return None
    found = [math.log2(a / b) for a, b in zip(counted, counted[1:])]
    is_one = max(found) - min(found) <= APART and ORDERS[0] <= min(found) and max(found) <= ORDERS[1]
    return sum(found) / ratios if is_one else None


def errors_of(values: Sequence[Vector], changes: Sequence[float], order: float | None) -> tuple[float, ...]:
    """Error of each run: against the limit by Richardson, or against the finest run with what it still changed by."""
    last = values[-1]
    if order is None:
        return (*(greatest(v, last) + changes[-1] for v in values[:-1]), changes[-1])
    limit = last + (last - values[-2]) / (2.0**order - 1.0)
    return (*(greatest(v, last, limit) for v in values[:-1]), changes[-1] / (2.0**order - 1.0))


def longest(
    steps: Sequence[float], errors: Sequence[float], order: float | None, allowed: float, limit: float
) -> tuple[float | None, bool]:
    """The longest step [s] with no more than the allowed error, and whether a longer one would do too.

    Beyond the runs it is found by the order, but no farther below the finest than that is below the first.
    """
    first = next((k for k, error in enumerate(errors) if error <= allowed), None)
    if order is None:  # nothing is known of what no run has had
        return (None, False) if first is None else (steps[first], first == 0)
    if first is None:
        step = steps[-1] * (allowed / errors[-1]) ** (1.0 / order)
        return (step if step >= steps[-1] ** 2 / steps[0] else None), False
    error = max(errors[first], ROUNDING * allowed)
    if first:  # between two runs
        slope = math.log2(errors[first - 1] / error)
        return steps[first - 1] * (allowed / errors[first - 1]) ** (1.0 / slope), False
    step = steps[0] * (allowed / error) ** (1.0 / order)
    return min(step, limit), step > limit


def differing(values: Sequence[Vector]) -> str:
    """How many rows of a discrete signal differ from those of the finest run."""
    first, last = (int((v != values[-1]).sum()) for v in (values[0], values[-2]))
    return f"{first} of {values[0].size} rows differ at the step of the scenario, {last} at the finest but one"


def quantum(values: Vector) -> float:
    """By how much neighbouring values of a signal differ if all are whole multiples of it apart; else 0."""
    gaps = np.diff(np.unique(values))
    if gaps.size < 2:
        return 0.0
    least = float(gaps.min())
    if least < FINEST_QUANTUM * float(gaps.sum()):
        return 0.0
    ratios = gaps / least
    return least if bool((np.abs(ratios - np.round(ratios)) < 1e-3).all()) else 0.0


def listed(numbers: Iterable[float]) -> str:
    """The last numbers, in short."""
    return ", ".join(f"{number:.3g}" for number in [*numbers][-RATIOS - 2 :])
