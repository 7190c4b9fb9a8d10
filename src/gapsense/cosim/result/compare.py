"""Compare a result with its baseline: `|value - reference| <= atol + rtol * nominal`, per signal."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from functools import cached_property

import numpy as np
import numpy.typing as npt

from gapsense._os.files import read_columns
from gapsense.cosim.result.result import TIME, Result, Run
from gapsense.cosim.scenario.records import Baseline, Tolerance, Vector, matching
from gapsense.problems import listing

Rows = npt.NDArray[np.bool_]
SHARE = 0.05  # of the range of a signal: an edge goes beyond it from one row to the next
TYPICAL = 10.0  # median changes from row to row: noise and smooth curves stay below it
EVEN = 0.1  # share of the rows of an even grid that may be farther apart
SHOWN = 3  # stretches of rows in a message
SLACK = 1e-6  # in the distance of rows: times no farther apart than this are equal
BASELINE = "the baseline"
UPDATE = "If the change is meant, update it: `gapsense baseline --write`."


def select_signals(result: Result, baseline: Baseline) -> list[str]:
    """Select the signals that the baseline covers."""
    return list(result.signals) if baseline.signals is None else matching(baseline.signals, result.signals)


def thin_rows(result: Result, baseline: Baseline) -> Result:
    """Select the rows of a result that its baseline holds."""
    n = baseline.decimation
    return replace(result, times=result.times[::n], signals={k: v[::n] for k, v in result.signals.items()})


def compare(result: Result, baseline: Baseline) -> Comparison:
    """Hold a complete result against its baseline, whose file exists.

    The comparison's `sentences` tell everything in which they differ; there are none if the result is as before.
    """
    try:
        columns = read_columns(baseline.file, {**TIME, **result.units})
    except (OSError, ValueError) as error:
        problem = f"baseline `{baseline.file.name}` cannot be read: {error} {UPDATE}"
        return Comparison((problem,))
    times = columns.pop("time", np.empty(0))
    result = thin_rows(result, baseline)
    if problem := other_times(result, times):
        return Comparison((problem,))
    names = select_signals(result, baseline)
    found = [compare_rows(result, name, columns[name], baseline) for name in names if name in columns]
    return Comparison(tuple(other_signals(names, columns)), tuple(found))


def other_times(result: Result, times: Vector) -> str:
    """Sentence on a baseline with other rows than the result, or nothing."""
    if times.size != result.times.size:
        told = [said.partition(". ")[0] for said in apart(result.times, np.sort(times), "the run", BASELINE)]
        where = "".join(f" {said[0].upper()}{said[1:]}." for said in told)
        return f"the baseline has {times.size} rows, the run has {result.times.size}.{where} {UPDATE}"
    wrong = np.abs(times - result.times) > 1e-9 * result.base_step
    if not wrong.any():
        return ""
    row, count = int(np.argmax(wrong)), int(wrong.sum())
    found = f"row {row} of the baseline is at {times[row]:.9g} s, of the run at {result.times[row]:.9g} s"
    return f"{count} rows have other times: {found}. {UPDATE}"


def other_signals(names: list[str], columns: Mapping[str, Vector]) -> list[str]:
    """Sentences on signals that only the run or only the baseline has."""
    new = [name for name in names if name not in columns]
    gone = [name for name in columns if name not in names]
    problems = [f"not in the baseline: {listing(new)}. {UPDATE}"] if new else []
    return problems + ([f"only in the baseline: {listing(gone)}. Record them. {UPDATE}"] if gone else [])


def tolerance_of(name: str, baseline: Baseline) -> Tolerance:
    """Tolerance of a signal: that of the first pattern that matches it, or else the general one."""
    own = (tolerance for pattern, tolerance in baseline.tolerances.items() if fnmatchcase(name, pattern))
    return next(own, baseline.tolerance)


def compare_rows(result: Result, name: str, reference: Vector, baseline: Baseline) -> Difference:
    """A signal of a result beside its reference at the same rows."""
    tolerance, signal = tolerance_of(name, baseline), result.about[name]
    rows = reach(tolerance.edge_steps, step_of(name, result.run), result.times)
    values = result.signals[name]
    return Difference(
        name=name,
        unit=signal.unit,
        times=result.times,
        values=values,
        reference=reference,
        tolerance=tolerance,
        nominal=signal.nominal,
        rows=rows,
        against=BASELINE,
    )


def step_of(name: str, run: Run) -> float:
    """Communication step of the component that a signal is of [s]."""
    component = run.components.get(name.partition(".")[0], {})
    return run.base_step * int(component.get("step", 1))


# How a signal differs from its reference, and the comparison of all signals of a run.


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
            failing &= ~find_moved_edges(self.values, self.reference, self.allowed, self.rows)
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
        """Greatest difference in terms of the tolerance."""
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
        """Signals that differ, the worst in terms of the tolerance first."""
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
        parts += [f"closest to its limit `{nearest.name}`, {nearest.share:.3g} of the tolerance"] if nearest else []
        parts += [f"{edges} only because edges may shift"] if edges else []
        return "; ".join(parts) + "."


# Edges of recorded signals, which may come a step earlier or later in another run.


def edges(values: Vector) -> Rows:
    """Whether there is an edge between each row and the next: much more than a row usually changes."""
    changes = np.abs(np.diff(values))
    known = changes[np.isfinite(changes)]
    if not known.size:
        return np.zeros(changes.shape, dtype=np.bool_)
    finite = values[np.isfinite(values)]
    least = max(SHARE * float(np.ptp(finite)), TYPICAL * float(np.median(known)))
    found: Rows = changes > least
    return found


def reach(steps: int, step: float, times: Vector) -> int:
    """Rows that so many steps of a component span, each `step` long [s]; at least one if rows are further apart."""
    if not steps or times.size < 2:
        return 0
    spacing = float(np.median(np.diff(times)))
    return max(1, math.ceil(steps * step / spacing - 1e-6))


def near_edges(values: Vector, rows: int) -> Rows:
    """Rows that an edge of the signal passes if it comes up to so many rows earlier or later."""
    near = np.zeros(values.shape, dtype=np.bool_)
    for k in np.flatnonzero(edges(values)):
        near[max(0, k - rows + 1) : k + rows + 1] = True
    return near


def envelope(values: Vector, rows: int) -> tuple[Vector, Vector]:
    """Least and greatest value of the signal up to so many rows before and after each row."""
    padded = np.pad(values, rows, mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * rows + 1)
    return windows.min(axis=1), windows.max(axis=1)


def find_moved_edges(values: Vector, reference: Vector, allowed: float, rows: int) -> Rows:
    """Find rows that differ by no more than an edge that came earlier or later.

    They are near an edge: the value lies between those of the reference up to so many rows away, and the reference
    between the values there. So a missing pulse, or one too many, does not pass as an edge that has moved.
    """
    if not rows or not values.size:
        return np.zeros(values.shape, dtype=np.bool_)
    near = near_edges(values, rows) | near_edges(reference, rows)
    return (
        near
        & is_between(values, *envelope(reference, rows), allowed)
        & is_between(reference, *envelope(values, rows), allowed)
    )


def is_between(values: Vector, low: Vector, high: Vector, allowed: float) -> Rows:
    """Tell rows at which a signal lies between two others, but for what is allowed; nothing lies between NaN."""
    inside: Rows = (values >= low - allowed) & (values <= high + allowed)
    return inside


# Two time grids: the rows that are compared, and the value of a signal between its rows.


def slack(*grids: Vector) -> float:
    """Times of these grids that are no further apart than this count as equal [s]."""
    return SLACK * min((spacing(grid) for grid in grids if (np.diff(grid) > 0.0).any()), default=0.0)


def spacing(times: Vector) -> float:
    """How far rows are apart, in the median [s]; 0 for less than two times."""
    widths = np.diff(times)
    return float(np.median(widths[widths > 0.0])) if (widths > 0.0).any() else 0.0


def are_same(times: Vector, other: Vector) -> bool:
    """True for two grids with the same times."""
    return times.shape == other.shape and bool((np.abs(times - other) <= slack(times, other)).all())


def apart(times: Vector, other: Vector, name: str, other_name: str) -> list[str]:
    """Sentences on rows that only one of two grids has, or has twice.

    A grid with every n-th row of the other one is coarser, and nothing is missing in it. Two grids that have little in
    common are only searched for gaps. Rows beyond the end of the other grid are not the subject here.
    """
    near = slack(times, other)
    merged = np.sort(np.concatenate((times, other)))
    moments = merged[np.concatenate(([True], np.diff(merged) > near))]
    places = [np.searchsorted(moments, grid + near, side="right") - 1 for grid in (times, other)]  # among the moments
    counts = [np.bincount(own, minlength=moments.size) for own in places]
    told = []
    for (mine, theirs), of in ((counts, name), (counts[::-1], other_name)):
        twice = mine > np.maximum(theirs, 1)
        if twice.any():
            extra = int((mine - np.maximum(theirs, 1))[twice].sum())
            told.append(f"{of}: {rows(extra)} at times of rows before, {spans(moments, twice)}. Remove the duplicates.")
    has, rest = (count > 0 for count in counts)
    both, smaller = int((has & rest).sum()), min(int(has.sum()), int(rest.sum()))
    for own, full, of, whose in ((has, rest, name, other_name), (rest, has, other_name, name)):
        if 2 * both > smaller:
            missing = lost(moments, own, full, max(spacing(times), spacing(other)))
            beside = f", which {whose} has"
        else:
            missing, beside = holes(moments, own), ""
        if missing.any():
            said = f"{of}: {rows(int(missing.sum()))} missing{beside}, {spans(moments, missing)}"
            told.append(f"{said}. Run again, or compare a part with `--after` and `--before`.")
    return told


def lost(moments: Vector, own: Rows, full: Rows, near: float) -> Rows:
    """Moments that only the other grid has, except rows that a coarser grid leaves out."""
    missing = full & ~own
    at = np.flatnonzero(own[full])  # of the other's rows
    if not missing.any() or at.size == 0:
        return missing
    stride = int(np.median(np.diff(at))) if at.size > 1 else 1
    if stride > 1:
        regular = np.zeros(int(full.sum()), dtype=np.bool_)
        regular[at[0] % stride :: stride] = True
        missing[np.flatnonzero(full)[~regular]] = False
    inside = moments[own]
    missing &= (moments > inside[0] - 1.5 * near) & (moments < inside[-1] + 1.5 * near)
    return missing


def holes(moments: Vector, own: Rows) -> Rows:
    """Moments of others at which a grid that is even elsewhere has no row for longer than from row to row."""
    inside = moments[own]
    wide = np.diff(inside) > 1.5 * spacing(inside)
    missing = np.zeros(moments.shape, dtype=np.bool_)
    if 0 < wide.sum() < EVEN * wide.size:
        for k in np.flatnonzero(wide):
            missing |= (moments > inside[k]) & (moments < inside[k + 1]) & ~own
    return missing


def rows(count: int) -> str:
    """So many rows."""
    return f"{count} row is" if count == 1 else f"{count} rows are"


def spans(moments: Vector, chosen: Rows) -> str:
    """Where some of the moments are: the first stretches of them."""
    at = np.flatnonzero(chosen)
    ends = [(int(part[0]), int(part[-1])) for part in np.split(at, np.flatnonzero(np.diff(at) > 1) + 1)]
    parts = [
        f"at t = {moments[a]:.9g} s" if a == b else f"from t = {moments[a]:.9g} s to {moments[b]:.9g} s"
        for a, b in ends[:SHOWN]
    ]
    return ", ".join(parts) + (f" and at {len(ends) - SHOWN} more places" if len(ends) > SHOWN else "")


def common(times: Vector, other: Vector, after: float, before: float) -> Vector:
    """Times that are compared [s]: the rows of the coarser grid, as far as both go and within the window."""
    near = slack(times, other)
    low, high = max(times[0], other[0], after) - near, min(times[-1], other[-1], before) + near
    first, second = (grid[(grid >= low) & (grid <= high)] for grid in (times, other))
    chosen: Vector = second if second.size < first.size else first
    return chosen


def resample(times: Vector, values: Vector, at: Vector) -> Vector:
    """Resample a signal at some times: its row where there is one, else between two rows.

    There it lies on a straight line. If all its values are whole numbers, as of modes and switches, it has the value of
    the row before.
    """
    before = np.clip(np.searchsorted(times, at + slack(times, at), side="right") - 1, 0, times.size - 1)
    is_row = np.abs(times[before] - at) <= slack(times, at)
    finite = values[np.isfinite(values)]
    if (finite == np.round(finite)).all():
        held: Vector = values[before]
        return held
    after = np.minimum(before + 1, times.size - 1)
    width = np.where(after > before, times[after] - times[before], 1.0)
    part = np.clip((at - times[before]) / width, 0.0, 1.0)
    line = values[before] + part * (values[after] - values[before])
    made: Vector = np.where(is_row, values[before], line)
    return made
