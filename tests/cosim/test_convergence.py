"""What `converge` tells of a scenario is what its error is; what has no order gets none."""

import csv
import json
import math
from dataclasses import replace
from inspect import signature

import numpy as np
import pytest
from typer.testing import CliRunner

import gapsense
from gapsense import cosim
from gapsense.cli import app
from gapsense.cli import compare as cli
from gapsense.cosim import convergence
from gapsense.cosim.check import both_ways
from gapsense.cosim.convergence import estimate_order, find_excused, greatest, longest, quantum
from gapsense.problems import FmuError, ScenarioError

PAIR = """
title = "Two lags that drive each other"
[experiment]
stop = 2.0
base_step = {step}
[components.first]
fmu = "Lag"
[components.second]
fmu = "Lag"
set = {{ "time.constant" = 0.25 }}
[connect]
"second.u" = "first.y"
[[connections]]
from = "second.y"
to = "first.u"
factor = -2.0
bias = 10.0
"""
NOISE = """
[components.noise]
fmu = "Noise"
set = {{ sample_time = {sample} }}
[components.noisy]
fmu = "Lag"
[[connections]]
from = "noise.y"
to = "noisy.u"
[seeds]
noise = 3
"""


def pair(step=0.01, more=""):
    """Text of the two lags, with tables of further components."""
    return PAIR.format(step=step) + more


def by(method, text):
    """The same with a method of exchange."""
    return text.replace("[experiment]\n", f'[experiment]\nmethod = "{method}"\n')


def exact(times):
    """Both outputs: y1' = 2 (10 - 2 y2 - y1), y2' = 4 (y1 - y2), from 0 on."""
    matrix, rest = np.array([[-2.0, -4.0], [4.0, -4.0]]), np.array([10.0, 10.0]) / 3.0
    values, vectors = np.linalg.eig(matrix)
    parts = np.linalg.solve(vectors, -rest)
    return rest + (np.exp(np.outer(times, values)) * parts @ vectors.T).real


@pytest.fixture
def lags(write, fmus):
    return lambda step=0.01, more="", **options: gapsense.converge(write(pair(step, more)), fmus=fmus, **options)


def error_at(write, fmus, step, method="gauss-seidel"):
    """Greatest errors of the two lags, against the exact solution."""
    result = gapsense.run(write(by(method, pair(step))), fmus=fmus)
    y = np.column_stack([result["first.y"], result["second.y"]])
    return np.abs(y - exact(result.times)).max(axis=0)


@pytest.mark.parametrize("method", ["gauss-seidel", "jacobi"])
def test_told_error_and_order_are_those_against_the_exact_solution(method, write, fmus):
    found = gapsense.converge(write(by(method, pair())), fmus=fmus)
    for name, error in zip(("first.y", "second.y"), error_at(write, fmus, 0.01, method)):
        told = found.signals[name]
        assert told.order == pytest.approx(1.0, abs=0.1)
        assert told.error == pytest.approx(error, rel=0.02)
        assert told.of_range == pytest.approx(error / told.range, rel=0.02)
    assert not found.passed
    assert found.held == () and found.steps[:2] == (0.01, 0.005)


def test_longest_step_that_is_told_keeps_the_tolerance_and_not_much_more(lags, write, fmus):
    found = lags(tolerance=5e-3)
    told = found.signals["second.y"]
    step = 2.0 / math.ceil(2.0 / told.step)
    error = error_at(write, fmus, step)[1] / told.range
    assert 4.7e-3 < error <= 5.05e-3
    assert found.step == pytest.approx(0.01 / math.ceil(0.01 / min(t.step for t in found.judged)))
    wide = lags(step=0.001, tolerance=0.01).signals["second.y"]
    assert not wide.is_least and 0.001 < wide.step < 0.008  # extrapolated no farther than the runs reach
    assert error_at(write, fmus, 2.0 / math.ceil(2.0 / wide.step))[1] / wide.range == pytest.approx(0.01, rel=0.1)


def test_runs_end_when_nothing_changes_any_more_and_at_what_is_allowed(lags):
    assert len(lags().steps) == 4
    found = lags(step=0.25, runs=5)  # too coarse for an order
    assert len(found.steps) <= 5
    early = lags(step=0.25, budget=1e-9)
    assert len(early.steps) == 4 and "1e-09 s of the budget" in early.stopped


def test_sampled_noise_is_the_same_at_every_step_and_other_noise_is_told(lags):
    sampled = lags(more=NOISE.format(sample=0.01))
    assert sampled.held == ("noise",)
    assert sampled.signals["noise.y"].is_same and not sampled.signals["noise.y"].why
    assert sampled.signals["first.y"].order == pytest.approx(1.0, abs=0.1)
    free = lags(more=NOISE.format(sample=0.0))
    for name in ("noise.y", "noisy.y", "noisy.u"):
        told = free.signals[name]
        assert told.why.startswith("noise: `noise`") and (told.order, told.step) == (None, None)
    assert free.signals["first.y"].order == pytest.approx(1.0, abs=0.1)
    kept = lags(more=NOISE.format(sample=0.0), keep="noise")
    assert kept.signals["noise.y"].is_same


def test_steps_of_what_is_sampled_limit_the_longest_step(lags):
    sampled = lags(step=0.001, more=NOISE.format(sample=0.001), tolerance=0.5)
    told = sampled.signals["first.y"]
    assert (told.step, told.is_least) == (0.001, True)


def test_discrete_signal_gets_no_order(lags):
    found = lags(more='[components.source]\nfmu = "Source"\n')
    told = found.signals["source.steps"]
    assert told.why.startswith("discrete: 200 of 200 rows differ") and told.order is None
    assert "Signals that do not converge" in str(found)


def test_event_noise_is_told_as_noise(lags):
    event = '[events.hum]\ntarget = "second.u"\naction = "noise"\nvalue = 0.1\nat = 0.5\n'
    assert lags(more=event).signals["second.y"].why.startswith("noise: `hum`")


def test_event_at_another_base_step_leaves_no_order(lags, write, fmus):
    """Its time is late by a part of a base step: the first changes may fall as those of an order, by chance."""
    kick = '[events.kick]\ntarget = "second.u"\naction = "bias"\nvalue = 5.0\nduration = 0.2\n'
    kick += 'when = { signal = "first.y", above = 2.0 }\n'
    found = lags(more=kick)
    assert len(found.steps) == 6 and "6 runs were allowed" in found.stopped
    assert {t.why for t in found.signals.values()} == {"event: `kick` comes at another base step"}
    assert not found.passed and found.step is None and "No signal converges." in str(found)


def test_what_follows_a_signal_that_switches_is_told_so(write, fmus):
    """A lag on a count of steps: the count is discrete, and twice as large with each halving."""
    more = '[components.source]\nfmu = "Source"\n[components.slow]\nfmu = "Lag"\n'
    more += '[[connections]]\nfrom = "source.steps"\nto = "slow.u"\nfactor = 1.0\nunit = "V"\n'
    found = gapsense.converge(write(pair(more=more)), fmus=fmus)
    assert found.signals["source.steps"].why.startswith("discrete")
    assert found.signals["slow.y"].why == "follows `source.steps`: discrete"
    assert found.signals["first.y"].order == pytest.approx(1.0, abs=0.1)


def test_scenario_of_a_program_tells_its_error_too_and_every_signal_is_told_once(fmus):
    s = gapsense.Scenario("lags", stop=2.0, base_step=0.01)
    s.add("one", str(fmus / "Lag.fmu"), u=1.0).add("two", str(fmus / "Lag.fmu")).connect("one.y", "two.u")
    s.add("still", str(fmus / "Source.fmu")).record("*.y", "*.u")
    found = s.converge(runs=4)
    assert found.signals["one.y"].order == pytest.approx(1.0, abs=0.1)
    assert found.signals["still.y"].is_same
    told = str(found)
    assert [told.count(name) for name in found.signals] == [1] * len(found.signals)


def test_order_is_believed_only_if_two_ratios_agree():
    assert estimate_order([8.0, 4.0, 2.0, 1.0], 1e-9) == pytest.approx(1.0)
    assert estimate_order([9.0, 16.0, 4.0, 1.0], 1e-9) == pytest.approx(2.0)
    assert estimate_order([16.0, 4.0, 1.0, 1e-12], 1e-9) == pytest.approx(2.0)  # the last one is rounding
    assert estimate_order([16.0, 4.0, 3.0], 1e-9) is None
    assert estimate_order([1.0, 2.0, 4.0], 1e-9) is None
    assert estimate_order([1.0, 0.9, 0.81], 1e-9) is None  # too slow to be an order
    assert estimate_order([4.0, 1.0], 1e-9) is None


def test_longest_step_without_an_order_is_one_that_was_run():
    steps = [8.0, 4.0, 2.0, 1.0]
    assert longest(steps, [9.0, 5.0, 1.0, 1.0], None, 2.0, 100.0) == (2.0, False)
    assert longest(steps, [9.0, 5.0, 4.0, 3.0], None, 2.0, 100.0) == (None, False)
    assert longest(steps, [1.0, 1.0, 1.0, 1.0], None, 2.0, 100.0) == (8.0, True)
    assert longest(steps, [16.0, 4.0, 1.0, 0.25], 2.0, 9.0, 100.0) == (pytest.approx(6.0), False)
    assert longest(steps, [16.0, 4.0, 1.0, 0.25], 2.0, 0.0625, 100.0) == (pytest.approx(0.5), False)
    assert longest(steps, [16.0, 4.0, 1.0, 0.25], 2.0, 0.001, 100.0) == (None, False)  # too far from all runs
    assert longest(steps, [1.0, 0.25], 2.0, 100.0, 16.0) == (16.0, True)


def test_quantum_is_found_in_readings_and_in_nothing_else(seed=5):
    random = np.random.default_rng(seed)
    smooth = np.cumsum(random.standard_normal(1000))
    assert quantum(smooth) == 0.0
    assert quantum(np.round(smooth / 0.01) * 0.01) == pytest.approx(0.01)
    assert quantum(np.ones(9)) == 0.0


def test_edge_that_comes_a_row_later_is_told_apart_and_a_later_one_counts():
    times = np.arange(100)
    early, late, later = (np.where(times < k, 0.01 * times, 50.0 + 0.01 * times) for k in (40, 41, 43))
    assert greatest(late, early) == 0.0 and find_excused(late, early).sum() >= 1
    assert greatest(later, early) == pytest.approx(50.0)
    lost = np.where(times == 7, math.nan, early)
    assert greatest(lost, lost) == 0.0 and greatest(lost, early) == math.inf
    gaps = [np.where((times >= k) & (times < k + 9), math.nan, early) for k in (60, 61, 63)]
    assert greatest(gaps[1], gaps[0]) == 0.0 and greatest(gaps[2], gaps[0]) == math.inf


def test_options_that_make_no_sense_are_refused_together(lags):
    with pytest.raises(ScenarioError) as caught:
        lags(runs=3, tolerance=2.0, keep=["frist"])
    assert len(caught.value.problems) == 3 and "Did you mean `first`?" in str(caught.value)
    with pytest.raises(ScenarioError, match="nothing to measure"):
        lags(keep=["first", "second"])


def test_runs_that_the_memory_does_not_hold_are_refused(lags, monkeypatch):
    monkeypatch.setattr(convergence, "memory", lambda: 8.0 * 201 * (5 * 4 + 1))  # as much as five runs of four signals
    assert len(lags(runs=5).steps) == 4
    with pytest.raises(ScenarioError, match="fewer `--runs`"):
        lags(runs=6)


def test_failure_at_a_finer_step_tells_the_step(write, fmus):
    late = '[components.late]\nfmu = "Faulty"\nset = { fault = "raise", at = 1.995 }\n[inputs]\n"late.u" = 0.0\n'
    with pytest.raises(FmuError, match=r"late, t = 1\.995 s .*coil burnt.* base step of 0\.005 s"):
        gapsense.converge(write(pair(more=late)), fmus=fmus)


def test_check_reminds_of_what_drives_each_other_until_it_is_measured(write, fmus, chain):
    path = write(pair())
    assert cosim.check(path, fmus=fmus) == []
    (said,) = cosim.remarks(path, fmus=fmus)
    assert "`second` and `first` drive each other, `second.y -> first.u` one step late" in said
    assert cosim.run(path, fmus=fmus).run.remarks == (said,)  # which the report shows
    assert cosim.remarks(write(chain, "one_way"), fmus=fmus) == []
    found = gapsense.converge(path, fmus=fmus, write=True)
    assert cosim.remarks(path, fmus=fmus) == []
    written = json.loads((path.parent / "converged.json").read_text(encoding="utf-8"))
    assert written["signals"]["first.y"]["error"] == found.signals["first.y"].error
    path.write_text(pair(0.02), encoding="utf-8")
    assert len(cosim.remarks(path, fmus=fmus)) == 1  # another step is not measured


def test_sampled_component_on_the_way_is_no_coupling(write, fmus):
    read, descriptions = cosim.prepare(write(pair()), fmus=fmus)
    assert len(list(both_ways(read, descriptions))) == 1
    assert list(both_ways(read, {**descriptions, "first": sampled_like(descriptions["first"])})) == []
    parallel, solved = (replace(read, experiment=replace(read.experiment, method=m)) for m in ("jacobi", "iterative"))
    assert len(list(both_ways(parallel, descriptions))) == 1
    assert list(both_ways(solved, descriptions)) == []  # where values of one step agree, nothing is late
    late = replace(solved, connections=tuple(replace(c, delayed=True) for c in solved.connections))
    assert len(list(both_ways(late, descriptions))) == 1


def sampled_like(description):
    """The same FMU with a sample time."""
    own = replace(description.variables["time.constant"], name="sample_time", start=0.1)
    return replace(description, variables={**description.variables, "sample_time": own})


def test_command_prints_writes_and_ends_with_its_code(write, fmus, tmp_path):
    path, out = write(pair()), {name: tmp_path / f"out.{name}" for name in ("csv", "json", "png")}
    more = ["--export", out["csv"], "--figure", out["png"], "--write"]
    done = CliRunner().invoke(app, [*map(str, ("converge", path, "--fmus", fmus, *more))])
    assert done.exit_code == 1, done.output
    said = " ".join(done.output.split())  # however wide the console is
    assert "Errors at a base step of 10 ms, from 4 runs down to 1.25 ms" in said
    assert "0 of 4 signals that converge are within 0.1 % of the range" in said
    rows = list(csv.DictReader(out["csv"].open(encoding="utf-8")))
    assert {row["signal"] for row in rows} == {"first.u", "first.y", "second.u", "second.y"}
    assert out["png"].stat().st_size > 1000 and (path.parent / "converged.json").is_file()
    more = ["--tolerance", 0.5, "--export", out["json"]]
    done = CliRunner().invoke(app, [*map(str, ("converge", path, "--fmus", fmus, *more))])
    assert done.exit_code == 0, done.output
    assert json.loads(out["json"].read_text(encoding="utf-8"))["passed"] is True


def test_command_and_function_have_the_same_defaults():
    command, function = (signature(f).parameters for f in (cli.converge, gapsense.converge))
    for name in ("runs", "budget", "tolerance", "write"):
        assert command[name].default == function[name].default


def test_command_refuses_before_it_runs(write, fmus, tmp_path):
    path = write(pair())
    for more, said in (
        (("--export", tmp_path / "out.xlsx"), "ends in `.csv` or `.json`"),
        (("--set", "second.time.constant=1", "--write"), "leave out --set"),
        (("--budget", "-1"), "a time above 0 expected"),
        (("--keep", "third"), "there is no component `third`"),
    ):
        done = CliRunner().invoke(app, [*map(str, ("converge", path, "--fmus", fmus, *more))])
        assert done.exit_code == 2 and said in " ".join(done.output.split())
        assert not (path.parent / "converged.json").exists()
