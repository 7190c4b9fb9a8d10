"""Compare a result with its baseline: `|value - reference| <= atol + rtol * nominal`, per signal."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from fnmatch import fnmatchcase

import numpy as np
import numpy.typing as npt

from gapsense._os.files import read_columns
from gapsense.cosim.result.difference import Comparison, Difference
from gapsense.cosim.result.edges import reach
from gapsense.cosim.result.grids import apart
from gapsense.cosim.result.result import TIME, Result, Run
from gapsense.cosim.scenario.records import Baseline, Tolerance
from gapsense.cosim.scenario.signals import matching
from gapsense.problems import listing

Vector = npt.NDArray[np.float64]
BASELINE = "the baseline"


def selected(result: Result, baseline: Baseline) -> list[str]:
    """Signals that the baseline covers."""
    return list(result.signals) if baseline.signals is None else matching(baseline.signals, result.signals)


def thinned(result: Result, baseline: Baseline) -> Result:
    """The rows of a result that its baseline holds."""
    n = baseline.decimation
    return replace(result, times=result.times[::n], signals={k: v[::n] for k, v in result.signals.items()})


def compare(result: Result, baseline: Baseline) -> Comparison:
    """Hold a result against its baseline.

    Parameters
    ----------
    result : Result
        Complete.
    baseline : Baseline
        Whose file exists.

    Returns
    -------
    Comparison
        Its `sentences` tell everything in which they differ; there are none if the result is as before.
    """
    try:
        columns = read_columns(baseline.file, {**TIME, **result.units})
    except (OSError, ValueError) as error:
        problem = f"baseline `{baseline.file.name}` cannot be read: {error} Update the baseline."
        return Comparison((problem,))
    times = columns.pop("time", np.empty(0))
    result = thinned(result, baseline)
    problem = other_times(result, times)
    if problem:
        return Comparison((problem,))
    names = selected(result, baseline)
    found = [difference(result, name, columns[name], baseline) for name in names if name in columns]
    return Comparison(tuple(other_signals(names, columns)), tuple(found))


def other_times(result: Result, times: Vector) -> str:
    """Sentence on a baseline with other rows than the result, or nothing."""
    if times.size != result.times.size:
        told = [said.partition(". ")[0] for said in apart(result.times, np.sort(times), "the run", BASELINE)]
        where = "".join(f" {said[0].upper()}{said[1:]}." for said in told)
        return f"the baseline has {times.size} rows, the run has {result.times.size}.{where} Update the baseline."
    wrong = np.abs(times - result.times) > 1e-9 * result.base_step
    if not wrong.any():
        return ""
    row, count = int(np.argmax(wrong)), int(wrong.sum())
    found = f"row {row} of the baseline is at {times[row]:.9g} s, of the run at {result.times[row]:.9g} s"
    return f"{count} rows are at other times: {found}. Update the baseline."


def other_signals(names: list[str], columns: Mapping[str, Vector]) -> list[str]:
    """Sentences on signals that only the run or only the baseline has."""
    new = [name for name in names if name not in columns]
    gone = [name for name in columns if name not in names]
    problems = [f"not in the baseline: {listing(new)}. Update the baseline."] if new else []
    return problems + ([f"only in the baseline: {listing(gone)}. Record them or update the baseline."] if gone else [])


def tolerance_of(name: str, baseline: Baseline) -> Tolerance:
    """Tolerance of a signal: that of the first pattern that matches it, or else the general one."""
    own = (tolerance for pattern, tolerance in baseline.tolerances.items() if fnmatchcase(name, pattern))
    return next(own, baseline.tolerance)


def difference(result: Result, name: str, reference: Vector, baseline: Baseline) -> Difference:
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
