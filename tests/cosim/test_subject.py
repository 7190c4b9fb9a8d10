"""What is found once for many runs, or for all values at once, has the bits of the plain way."""

from __future__ import annotations

from dataclasses import replace
from fnmatch import fnmatchcase

import numpy as np
import pytest

from gapsense.cosim import Master, load, prepare, run, run_once
from gapsense.cosim.result.metrics import KINDS
from gapsense.cosim.result.result import measure_all
from gapsense.cosim.run.recording import times
from gapsense.cosim.scenario.records import Experiment, Metric, Record, matching


@pytest.mark.parametrize("start", [0.0, -0.3, 1.0 / 3.0])
@pytest.mark.parametrize("decimation", [1, 7])
def test_times_of_all_rows_have_the_bits_of_each(write, chain, fmus, start, decimation):
    base, rows = 25e-6 / 3.0, 4001
    grid = Experiment(start, start + base * rows * decimation, base, rows * decimation)
    scenario = replace(load(write(chain)), experiment=grid, record=Record(decimation=decimation))
    assert times(scenario, rows).tolist() == [grid.time(row * decimation) for row in range(rows)]
    assert times(scenario, 0).size == 0


def plainly(metric, result):
    """Value of a metric, by a loop over rows."""
    component = result.run.components[metric.signal.partition(".")[0]]
    slack, rows = 1e-9 * result.base_step, []
    for row in range(result.times.size):
        since = row * result.run.decimation - component["offset"]
        time = result.times[row] if metric.time is None else result[metric.time][row]
        is_sample = since > 0 and since % component["step"] == 0
        is_inside = (metric.after or -9.0) + slack < time < (metric.before or 9.0) - slack
        if is_sample and is_inside and (metric.where is None or result[metric.where][row]):
            rows.append(row)
    samples, other = result[metric.signal][rows], 0.0
    if metric.reference is not None:
        other = result[metric.reference][rows]
    kind = KINDS[metric.kind]
    if kind.takes_flows:
        return kind.compute(samples, other, *(result[flow][rows] for flow in metric.flows))
    if kind.takes_times:
        return kind.compute(samples - other, result.times[rows] - (metric.after or 0.0))
    return kind.compute(samples, other) if kind.reference == "axis" else kind.compute(samples - other)


FLOWS = (None, ("gain.y", "source.y"))


def test_metrics_that_share_samples_have_the_values_of_each_alone(write, chain, fmus):
    slow = chain.replace('fmu = "Source"', 'fmu = "Source"\nstep = 2\noffset = 1')
    result = run(write(slow), fmus=fmus)
    windows = [(None, None), (0.2, None), (None, 0.7), (0.2, 0.7)]
    metrics = [
        Metric(f"{kind} {signal} {place}", kind, signal, other, *window, where=where, flows=FLOWS[about.takes_flows])
        for kind, about in KINDS.items()
        for signal, other in (("source.y", "lag.y"), ("lag.y", "gain.y"))
        for place, window in enumerate(windows)
        for where in (None, "source.steps")
        if other is None or about.reference != "none"
    ]
    found = measure_all([replace(m, name=f"{m.name} {m.where}") for m in metrics], result)
    assert len(found) == len(metrics)
    for metric in metrics:
        expected = plainly(metric, result)
        assert found[f"{metric.name} {metric.where}"].value.hex() == float(expected).hex(), metric


def test_names_match_as_patterns_or_as_they_are():
    names = ["a.x", "a.x[1]", "ab.x", "b.x1", "b.y|c", "B.x"]
    for patterns in (["*"], [], ["a.*"], ["a.x[1]"], ["b.x[1]"], ["?b.x", "b.y|c"], ["[ab].x"], ["a.x", "nothing"]):
        expected = [n for n in names if any(n == p or fnmatchcase(n, p) for p in patterns)]
        assert matching(patterns, names) == expected


def test_facts_of_a_run_are_those_of_its_scenario_whatever_ran_before(write, chain, fmus):
    with Master(*prepare(write(chain), None, fmus)) as master:
        before = run_once(master)
        assert master.adopt(*prepare(write(chain.replace('title = "', 'title = "Other ')), None, fmus))
        after = run_once(master)
    assert after.run.title != before.run.title
    assert after.run.files != before.run.files
    assert np.array_equal(after["lag.y"], before["lag.y"])
