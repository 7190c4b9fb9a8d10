"""A result beside its baseline: tube of what is allowed, rows that leave it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from gapsense.cosim.compare import compare, other_times, selected, thinned, tolerance_of
from gapsense.cosim.record import TIME, Result
from gapsense.cosim.scenario import Baseline
from gapsense.files import read_columns
from gapsense.report.html.curves import Vector
from gapsense.report.html.subject import Shown


@dataclass(frozen=True)
class Tube:
    """A signal, its reference, and the difference that is allowed, in SI units."""

    name: str
    unit: str
    times: Vector
    values: Vector
    reference: Vector
    allowed: float

    @cached_property
    def error(self) -> Vector:
        """Absolute difference at each row; NaN where one of both is NaN."""
        return np.abs(self.values - self.reference)

    @cached_property
    def failing(self) -> npt.NDArray[np.bool_]:
        """Rows outside of the tube; NaN is outside of any."""
        outside: npt.NDArray[np.bool_] = ~(self.error <= self.allowed)
        return outside

    @cached_property
    def counted(self) -> Vector:
        """Difference at each row, infinite where it is no number."""
        return np.where(np.isnan(self.error), np.inf, self.error)

    @property
    def tube(self) -> tuple[Vector, Vector]:
        """Lowest and highest value that is allowed at each row."""
        return self.reference - self.allowed, self.reference + self.allowed

    @property
    def share(self) -> float:
        """Largest difference in terms of what is allowed."""
        largest = float(self.counted.max(initial=0.0))
        return 0.0 if largest == 0.0 else largest / self.allowed if self.allowed else np.inf


@dataclass(frozen=True)
class Regression:
    """What comparing with the baseline showed; `note` says why nothing was compared, if nothing was."""

    tubes: tuple[Tube, ...] = ()
    problems: tuple[str, ...] = ()
    note: str = ""


def regression(shown: Shown) -> Regression:
    """Tubes of all signals that the baseline covers, the worst first."""
    if shown.scenario is None:
        return Regression(note=shown.note)
    baseline, result = shown.scenario.baseline, shown.result
    if not baseline.file.is_file():
        return Regression(note="The scenario has no baseline; `gapsense baseline --write` makes one.")
    if shown.is_changed:
        return Regression(note="Not compared: this run has other values or seeds than the scenario's baseline.")
    if result.interrupted or result.failure:
        return Regression(note="Not compared: the run did not reach its end.")
    problems = compare(result, baseline)
    return Regression(tuple(sorted(tubes(result, baseline), key=lambda tube: -tube.share)), tuple(problems))


def tubes(result: Result, baseline: Baseline) -> list[Tube]:
    """Tube of each signal that is in both; none where the baseline cannot be read or has other rows."""
    try:
        columns = read_columns(baseline.file, {**TIME, **result.units})
    except (OSError, ValueError):
        return []
    rows = thinned(result, baseline)
    if other_times(rows, columns.get("time", np.empty(0))):
        return []
    names = [name for name in selected(rows, baseline) if name in columns]
    return [tube(rows, name, columns[name], baseline) for name in names]


def tube(rows: Result, name: str, reference: Vector, baseline: Baseline) -> Tube:
    """One signal beside its baseline."""
    tolerance, about = tolerance_of(name, baseline), rows.about[name]
    allowed = tolerance.atol + tolerance.rtol * about.nominal
    return Tube(name, about.unit, rows.times, rows[name], reference, allowed)
