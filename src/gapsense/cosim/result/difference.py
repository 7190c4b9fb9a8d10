"""How one signal differs from its reference, and what comparing all signals of a run has shown."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import numpy.typing as npt

from gapsense.cosim.result.edges import Rows, envelope, moved, near_edges
from gapsense.cosim.scenario.records import Tolerance

Vector = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Difference:
    """A signal and its reference at the same times [s]; `rows` is how many an edge may come earlier or later."""

    name: str
    unit: str
    times: Vector = field(repr=False)
    values: Vector = field(repr=False)
    reference: Vector = field(repr=False)
    tolerance: Tolerance
    nominal: float
    rows: int = 0
    against: str = "the reference"

    @property
    def allowed(self) -> float:
        """Greatest difference that is allowed, in the unit of the signal."""
        return self.tolerance.atol + self.tolerance.rtol * self.nominal

    @cached_property
    def error(self) -> Vector:
        """Absolute difference at each row; NaN where one of both is NaN."""
        with np.errstate(invalid="ignore"):
            return np.where(self.values == self.reference, 0.0, np.abs(self.values - self.reference))

    @cached_property
    def failing(self) -> Rows:
        """Rows outside of the tolerance; NaN is outside of any."""
        failing: Rows = ~(self.error <= self.allowed)
        if failing.any():
            failing &= ~moved(self.values, self.reference, self.allowed, self.rows)
        return failing

    @cached_property
    def counted(self) -> Vector:
        """Difference at each row that no edge excuses; infinite where it is no number."""
        excused = (self.error > self.allowed) & ~self.failing
        return np.where(excused, 0.0, np.where(np.isnan(self.error), np.inf, self.error))

    @property
    def tube(self) -> tuple[Vector, Vector]:
        """Lowest and highest value that is allowed at each row; near its edges the reference may be that of others."""
        low, high = self.reference, self.reference
        if self.rows:
            near = near_edges(self.reference, self.rows)
            low, high = (np.where(near, end, self.reference) for end in envelope(self.reference, self.rows))
        return low - self.allowed, high + self.allowed

    @property
    def passed(self) -> bool:
        """True if every row is within the tolerance."""
        return not self.failing.any()

    @property
    def is_equal(self) -> bool:
        """True if every row has the same number."""
        return bool(np.array_equal(self.values, self.reference))

    @property
    def share(self) -> float:
        """Greatest difference in terms of what is allowed."""
        largest = float(self.counted.max(initial=0.0))
        return 0.0 if largest == 0.0 else largest / self.allowed if self.allowed else np.inf

    @property
    def edges(self) -> int:
        """Rows that only an edge which came earlier or later excuses."""
        return int(((self.error > self.allowed) & ~self.failing).sum())

    def at(self, row: int) -> str:
        """Time, value and reference of a row."""
        return f"t = {self.times[row]:.9g} s: {self.values[row]:.9g} instead of {self.reference[row]:.9g}"

    def __str__(self) -> str:
        """Three lines on a signal that differs: what, where, by how much."""
        unit = f" {self.unit}" if self.unit not in ("", "1") else ""
        first, worst = int(np.argmax(self.failing)), int(np.argmax(np.where(self.failing, self.counted, -1.0)))
        error, tolerance = self.error[worst], self.tolerance
        times = f", {error / self.allowed:.3g} times" if self.allowed and np.isfinite(error) else ", beyond"
        head = f"{self.name}{f' [{self.unit}]' if self.unit else ''}"
        within = f", edges within {self.rows} row{'s' * (self.rows > 1)}" if self.rows else ""
        return "\n".join(
            (
                f"{head}: {self.failing.sum()} of {self.times.size} rows differ from {self.against} by more than "
                f"{self.allowed:.3g}",
                f"  first {self.at(first)}; worst {self.at(worst)}",
                f"  worst by {error:.3g}{unit}{times} the {self.allowed:.3g}{unit} allowed: atol {tolerance.atol:.3g} "
                f"+ rtol {tolerance.rtol:.3g} x nominal {self.nominal:.3g}{within}",
            )
        )


@dataclass(frozen=True)
class Comparison:
    """What comparing two runs has shown: what could not be compared, and each signal that both have."""

    problems: tuple[str, ...] = ()
    signals: tuple[Difference, ...] = ()

    @property
    def failing(self) -> list[Difference]:
        """Signals that differ, the worst in terms of what is allowed first."""
        return sorted((d for d in self.signals if not d.passed), key=lambda d: -d.share)

    @property
    def within(self) -> list[Difference]:
        """Signals within their tolerance, the nearest to its end first."""
        return sorted((d for d in self.signals if d.passed), key=lambda d: -d.share)

    @property
    def passed(self) -> bool:
        """True if nothing differs."""
        return not self.problems and all(d.passed for d in self.signals)

    @property
    def sentences(self) -> list[str]:
        """Everything in which they differ: the signals first, three lines each."""
        return [*map(str, self.failing), *self.problems]

    @property
    def summary(self) -> str:
        """One line on the signals that do not differ."""
        same = sum(d.is_equal for d in self.signals)
        edges = sum(d.edges > 0 for d in self.within)
        parts = [f"{len(self.within)} of {len(self.signals)} signals within their tolerance, {same} of them equal"]
        nearest = next((d for d in self.within if d.share), None)
        parts += [f"nearest to its end `{nearest.name}`, {nearest.share:.3g} of what is allowed"] if nearest else []
        parts += [f"{edges} only because edges may move"] if edges else []
        return "; ".join(parts) + "."
