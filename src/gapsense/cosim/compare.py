"""Compare a result with its baseline: `|value - reference| <= atol + rtol * nominal`, per signal."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from fnmatch import fnmatchcase

import numpy as np
import numpy.typing as npt

from gapsense.cosim.record import TIME, Result
from gapsense.cosim.scenario import Baseline, Tolerance
from gapsense.cosim.signals import matching
from gapsense.files import read_columns
from gapsense.problems import listing

Vector = npt.NDArray[np.float64]


def selected(result: Result, baseline: Baseline) -> list[str]:
    """Signals that the baseline covers."""
    return list(result.signals) if baseline.signals is None else matching(baseline.signals, result.signals)


def thinned(result: Result, baseline: Baseline) -> Result:
    """The rows of a result that its baseline holds."""
    n = baseline.decimation
    return replace(result, times=result.times[::n], signals={k: v[::n] for k, v in result.signals.items()})


def compare(result: Result, baseline: Baseline) -> list[str]:
    """Everything in which a result differs from its baseline.

    Parameters
    ----------
    result : Result
        Complete.
    baseline : Baseline
        Whose file exists.

    Returns
    -------
    list of str
        Differences, one sentence each; empty if the result is as before.
    """
    try:
        columns = read_columns(baseline.file, {**TIME, **result.units})
    except (OSError, ValueError) as error:
        return [f"baseline `{baseline.file.name}` cannot be read: {error} Update the baseline."]
    times = columns.pop("time", np.empty(0))
    result = thinned(result, baseline)
    problem = other_times(result, times)
    if problem:
        return [problem]
    names = selected(result, baseline)
    both = [name for name in names if name in columns]
    found = (difference(result, name, columns[name], tolerance_of(name, baseline)) for name in both)
    return [*other_signals(names, columns), *filter(None, found)]


def other_times(result: Result, times: Vector) -> str:
    """Sentence on a baseline with other rows than the result, or nothing."""
    if times.size != result.times.size:
        return f"the baseline has {times.size} rows, the run has {result.times.size}. Update the baseline."
    apart = np.abs(times - result.times) > 1e-9 * result.base_step
    if not apart.any():
        return ""
    row = int(np.argmax(apart))
    return f"row {row} of the baseline is at {times[row]:.9g} s, of the run at {result.times[row]:.9g} s. Update it."


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


def difference(result: Result, name: str, reference: Vector, tolerance: Tolerance) -> str:
    """Sentence on a signal that differs from its reference, or nothing; NaN differs from everything."""
    values, signal = result.signals[name], result.about[name]
    allowed = tolerance.atol + tolerance.rtol * signal.nominal
    error = np.abs(values - reference)
    failing = ~(error <= allowed)
    if not failing.any():
        return ""
    rows = np.argmax(failing), np.argmax(np.where(np.isnan(error), np.inf, error))
    first, worst = (f"t = {result.times[r]:.9g} s: {values[r]:.9g} instead of {reference[r]:.9g}" for r in rows)
    return (
        f"{name}{f' [{signal.unit}]' if signal.unit else ''}: {failing.sum()} of {values.size} rows differ from "
        f"the baseline by more than {allowed:.3g}; first {first}; worst {worst}"
    )
