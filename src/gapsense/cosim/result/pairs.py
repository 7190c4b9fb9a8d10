"""Compare two results of any origin: two files, or all files that two folders have under the same names."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from gapsense._os.files import read_columns, read_sheet
from gapsense.cosim.result.compare import (
    Comparison,
    Difference,
    apart,
    are_same,
    common,
    reach,
    resample,
    spacing,
    step_of,
    tolerance_of,
)
from gapsense.cosim.result.result import TIME, Result, Run, Signal, read_result
from gapsense.cosim.result.sidecar import read_sidecar
from gapsense.cosim.scenario.read import RESULT, other_kind
from gapsense.cosim.scenario.records import Baseline, Tolerance, Vector, matching
from gapsense.problems import InputError, listing, suggest


class Trajectories(NamedTuple):
    """Signals over time [s], with what is known about them and about the run that made them."""

    name: str
    times: Vector
    signals: dict[str, Vector]
    about: dict[str, Signal]  # empty for a CSV file of others
    run: Run | None = None
    problems: tuple[str, ...] = ()


@dataclass(frozen=True)
class Window:
    """What is compared: signals that match a pattern, at times from `after` to `before` [s]."""

    patterns: tuple[str, ...] = ("*",)
    after: float = -math.inf
    before: float = math.inf


def pair_files(result: Path, reference: Path) -> Iterator[tuple[Path, Path]]:
    """Yield the two files, or those of two folders with one name; an InputError tells what only one folder has."""
    if wrong := [found for path in (result, reference) if (found := other_kind(path, RESULT))]:
        raise InputError(wrong)
    if result.is_dir() != reference.is_dir():
        folder, file = (result, reference) if result.is_dir() else (reference, result)
        raise InputError([f"`{folder}` is a folder, `{file}` is not. Name two results, or two folders of results."])
    if not result.is_dir():
        yield result, reference
        return
    ours, theirs = results_in(result), results_in(reference)
    problems = [
        f"`{folder / name}` has no counterpart in `{other}`. Remove it, or add the counterpart."
        for folder, other, names in ((result, reference, ours - theirs), (reference, result, theirs - ours))
        for name in sorted(names)
    ]
    if not ours | theirs:
        problems.append(f"`{result}` and `{reference}`: there is no result in these folders. Correct the paths.")
    if problems:
        raise InputError(problems)
    yield from ((result / name, reference / name) for name in sorted(ours))


def results_in(folder: Path) -> set[str]:
    """Results of runs in a folder and those below, by their path from there."""
    files = (file for file in folder.rglob("*.csv") if read_sidecar(file))
    return {file.relative_to(folder).as_posix() for file in files}


def read_trajectories(path: Path) -> Trajectories:
    """A result with its side-car, or a CSV file without one: a baseline, or what another tool has written."""
    if path.with_suffix(".json").is_file():
        return of_result(read_result(path), str(path))
    problems: list[str] = []
    sheet = read_sheet(path, problems)
    if problems:
        raise InputError(problems)
    columns = read_columns(path, TIME)
    times = columns.pop("time", np.empty(0))
    if times.size < 2 or not np.isfinite(times).all():
        found = "a column `time [s]` of at least two rows with finite numbers is expected"
        raise InputError([f"{path}: {found}. Correct the file."])
    falls = np.flatnonzero(np.diff(times) < 0.0) + 1
    if falls.size:
        first = f"the first in line {sheet.lines[falls[0]]} at {times[falls[0]]:.9g} s"
        said = f"{falls.size} rows have a time before that of the row above, {first}; times do not fall"
        raise InputError([f"{path}: {said} in a result. Put the rows in order."])
    units = dict(zip(sheet.names, sheet.units))
    about = {name: Signal(units[name], math.nan, "") for name in columns}
    return Trajectories(str(path), times, columns, about)


def of_result(result: Result, name: str) -> Trajectories:
    """Trajectories of a result; one that is not complete is a problem."""
    ended = "was interrupted" if result.interrupted else f"failed: {result.failure}" if result.failure else ""
    problems = (f"{name}: the run {ended}.",) if ended else ()
    signals, about = dict(result.signals), dict(result.about)
    return Trajectories(name, result.times, signals, about, run=result.run, problems=problems)


def compare_results(
    result: Result, reference: Result, rtol: float = Tolerance.rtol, atol: float = 0.0, edge_steps: int = 1
) -> Comparison:
    """Hold a result against another one, all signals over the whole run, as `gapsense compare` does.

    Their rows may be at different times. Allowed is `atol + rtol * nominal`, and that an edge comes `edge_steps` steps
    of its component earlier or later.
    """
    both = of_result(result, "the result"), of_result(reference, "the reference")
    return compare_trajectories(*both, Baseline(Path(), tolerance=Tolerance(rtol, atol, edge_steps)), Window())


def compare_trajectories(result: Trajectories, reference: Trajectories, how: Baseline, window: Window) -> Comparison:
    """Hold trajectories against others, with the tolerances of `how`, whose file is not read.

    Where their rows are not at the same times, those of the coarser grid are compared. Signals, units and times that
    only one of them has are among the `problems` of the comparison.
    """
    if not result.times.size or not reference.times.size:
        return Comparison((*result.problems, *reference.problems, "there are no rows to compare. Run again."))
    if not (names := matching(window.patterns, dict.fromkeys((*result.signals, *reference.signals)))):
        known = suggest(window.patterns[0], result.signals)
        raise InputError([f"no signal is or matches {listing(window.patterns)}. {known}"])
    both = [name for name in names if name in result.signals and name in reference.signals]
    problems = [*result.problems, *reference.problems, *spans(result, reference, window)]
    for one, other in ((result, reference), (reference, result)):
        only = [name for name in names if name in one.signals and name not in other.signals]
        problems += [f"only in {one.name}: {listing(only)}. Record them in both, or choose signals."] if only else []
    problems += apart(inside(result.times, window), inside(reference.times, window), result.name, reference.name)
    is_whole = window.after < result.times[0] and window.before > result.times[-1]
    is_same = is_whole and are_same(result.times, reference.times)
    times = reference.times if is_same else common(result.times, reference.times, window.after, window.before)
    if not times.size:
        return Comparison((*problems, "the two have no times in common. Correct the window."))
    found = [compare_resampled(result, reference, name, times, how) for name in both]
    problems += [problem for name in both if (problem := other_unit(result, reference, name))]
    return Comparison(tuple(problems), tuple(found))


def inside(times: Vector, window: Window) -> Vector:
    """Times within the window."""
    chosen: Vector = times[(times >= window.after) & (times <= window.before)]
    return chosen


def spans(result: Trajectories, reference: Trajectories, window: Window) -> list[str]:
    """Sentence on a part of the window that only one of both has, if there is one longer than from row to row."""
    near = max(spacing(t.times) for t in (result, reference))
    (a, b), (c, d) = ((max(t.times[0], window.after), min(t.times[-1], window.before)) for t in (result, reference))
    if abs(a - c) <= near and abs(b - d) <= near:
        return []
    said = f"{result.name} goes from {a:.9g} s to {b:.9g} s, {reference.name} from {c:.9g} s to {d:.9g} s"
    return [f"{said}. Run both over the same time, or choose a part of it."]


def other_unit(result: Trajectories, reference: Trajectories, name: str) -> str:
    """Sentence on a signal with two units, or nothing; where one of them is not told, there is nothing to say."""
    found, expected = (t.about[name].unit for t in (result, reference))
    if not found or not expected or found == expected:
        return ""
    return f"{name}: it is in {found} in {result.name}, in {expected} in {reference.name}. Nothing is converted."


def compare_resampled(
    result: Trajectories, reference: Trajectories, name: str, times: Vector, how: Baseline
) -> Difference:
    """A signal of both at the times that are compared."""
    about = [t.about[name] for t in (reference, result)]
    nominal = next((a.nominal for a in about if math.isfinite(a.nominal)), 1.0)
    unit = next((a.unit for a in about if a.unit), "")
    tolerance = tolerance_of(name, how)
    step = max((step_of(name, t.run) for t in (result, reference) if t.run), default=0.0)
    values, expected = (resample(t.times, t.signals[name], times) for t in (result, reference))
    rows = reach(tolerance.edge_steps, step, times)
    return Difference(
        name=name,
        unit=unit,
        times=times,
        values=values,
        reference=expected,
        tolerance=tolerance,
        nominal=nominal,
        rows=rows,
        against=reference.name,
    )
