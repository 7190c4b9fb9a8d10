"""A scenario that runs as vectors has the bits that it has through FMUs, in every run, whatever the others do."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
import scenarios_of_ours
from measured import largest
from scenarios_of_ours import read

from gapsense import campaign, cosim
from gapsense._os.native import own_compiler
from gapsense.cosim import FmuError, load, prepare, read_result, run, sweep
from gapsense.cosim.run.recording import Subject, finish_recording
from gapsense.cosim.scenario.records import ITERATIVE
from gapsense.fmi.components import own
from gapsense.fmi.package import build
from gapsense.vectors.engine import Vectors, obstacle

pytestmark = pytest.mark.skipif(own_compiler() is None, reason="needs a C compiler")
SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"
QUICK = [  # those of many estimators take 15 s to compile
    ("semera_valve", None),
    ("locked_plunger", "static"),
    ("pot_magnet", "late"),
    ("soft_landing", None),
]
LONG = ("run_to_run_day", "firmware")
EVERY = [
    (p.parent.name, v)
    for p, v in scenarios_of_ours.EVERY
    if not any(component.board for component in read(p, v).components.values())  # which are no vectors
    and read(p, v).experiment.method != ITERATIVE  # nor are loops that are iterated; power_stage has an explicit one
]
VALVE = """
title = "Valves of which each has other parameters, and to which other things happen"
[experiment]
start = -1e-3
stop = 30e-3
base_step = 25e-6
METHOD
[components.drive]
fmu = "DriveVoltage"
[components.valve]
fmu = "SolenoidValve"
[components.sensor]
fmu = "Sensor"
step = 2
offset = 3
set = { sample_time = 50e-6 }
[components.late]
fmu = "Sensor"
step = 4
set = { sample_time = 50e-6 }
[components.slow]
fmu = "Sensor"
step = 2
set = { sample_time = 200e-6 }
[components.before]
fmu = "Sensor"
set = { sample_time = 25e-6 }
[components.semera]
fmu = "Semera"
set = { sample_time = 50e-6 }
step = 2
offset = 3
[connect]
"valve.voltage" = "drive.voltage_mean"
"sensor.voltage" = "drive.voltage"
"sensor.current" = "valve.current"
"sensor.mode" = "valve.mode"
"late.voltage" = "drive.voltage"
"late.mode" = "valve.mode"
"slow.voltage" = "drive.voltage"
"slow.current" = "valve.current"
"slow.mode" = "valve.mode"
"slow.position" = "valve.position"
"semera.voltage" = "sensor.voltage_measured"
"semera.current" = "sensor.current_measured"
[[connections]]
from = "valve.current"
to = "late.current"
factor = -1e3
bias = 0.5
unit = "A"
[[connections]]
from = "valve.current"
to = "before.current"
delayed = true
[inputs]
"drive.enable" = 1.0
"late.position" = 0.0
"sensor.position" = 1e-4
"before.position" = 0.0
"before.voltage" = 0.0
"before.mode" = 0.0
[inputs."drive.reference"]
times = [-1e-3, 5e-3, 40e-3]
values = [0.0, 0.1, 0.3]
[seeds]
sensor = 1
late = 7
[record]
signals = ["*"]
decimation = 3
[events.warm]
target = "valve.coil.resistance"
action = "ramp"
value = 60.0
at = 5e-3
over = 10e-3
[events.lost]
target = "sensor.current"
action = "bias"
value = 0.01
duration = 2e-3
when = { signal = "valve.current", above = 0.2 }
[events.stuck]
target = "valve.current"
action = "stuck"
duration = 1e-3
when = { signal = "valve.position", below = 0.4e-3, for = 0.2e-3, again = true }
[events.rough]
target = "semera.voltage"
action = "noise"
value = 0.2
at = 12e-3
until = 14e-3
[sweep]
"valve.coil.resistance" = [50.0, 55.0, 61.0]
"valve.mover.mass" = [1.6e-3, 2.2e-3, 3.3e-3]
"events.lost.when.above" = [0.1, 0.25]
[metrics.bits]
kind = "rmse"
signal = "semera.resistance"
reference = "valve.coil.resistance"
"""


@pytest.fixture(scope="module")
def fmus(natives):
    """Native ones, which have the bits of the Python ones in all scenarios: tests/native/test_scenarios.py."""
    return natives


def differing(fmus, scenario, variant, runs, compared):
    """Names of what differs between runs through FMUs and as vectors, in some of them."""
    subject = Subject(*prepare(scenario, variant, fmus))
    assert not obstacle(subject)
    points = subject.scenario.plan.points
    takes = [subject.make_take(k, k % points if subject.scenario.swept else None) for k in range(runs)]
    found = dict(Vectors(subject).record(takes))
    assert sorted(found) == [*range(runs)]
    wrong = []
    for k in compared:
        try:
            expected = run(scenario, variant, fmus, seed_shift=k, point=k % points if subject.scenario.swept else None)
        except FmuError:
            wrong += [f"run {k} is not lost"] * (found[k] is not None)
            continue
        assert found[k] is not None, f"run {k} is lost"
        result = finish_recording(subject, takes[k], found[k])
        wrong += [f"{n} of run {k}" for n, v in expected.signals.items() if v.tobytes() != result.signals[n].tobytes()]
        wrong += [] if repr(result.metrics) == repr(expected.metrics) else [f"metrics of run {k}"]
        wrong += [] if repr(result.parameters) == repr(expected.parameters) else [f"parameters of run {k}"]
        wrong += [] if result.events == expected.events else [f"events of run {k}"]
        assert [t.calls for t in result.timing.values()] == [t.calls for t in expected.timing.values()]
        assert np.array_equal(result.times, expected.times)
    return wrong


@pytest.mark.parametrize(("name", "variant"), QUICK)
def test_bits_are_those_of_the_fmus(fmus, name, variant):
    assert differing(fmus, SCENARIOS / name, variant, 3, (0, 2)) == []


@pytest.mark.slow
@pytest.mark.parametrize(("name", "variant"), EVERY)
def test_bits_of_every_scenario_are_those_of_the_fmus(natives, name, variant):
    assert differing(natives, SCENARIOS / name, variant, *((1, (0,)) if name in LONG else (10, (0, 9)))) == []


@pytest.mark.parametrize("method", ["gauss-seidel", "jacobi"])
def test_runs_differ_in_parameters_and_in_what_happens_to_them(fmus, tmp_path, method):
    (tmp_path / "valve").mkdir()
    file = tmp_path / "valve" / "scenario.toml"
    file.write_text(VALVE.replace("METHOD", f'method = "{method}"'), encoding="utf-8")
    every_value = (0, 5, 10, 15, 18)  # of what is swept, and one point again with other noise
    assert differing(fmus, file, None, 19, every_value) == []


def test_sweep_has_the_same_numbers_and_signals(fmus, tmp_path):
    swept = {
        engine: sweep(
            SCENARIOS / "semera_valve", 9, fmus=fmus, out=tmp_path / engine, measure=largest, keep=True, engine=engine
        )
        for engine in ("fmu", "auto")
    }
    one, other = swept.values()
    assert (one.engine, other.engine) == ("fmu", "vectors") and other.computed == 9
    assert one.metrics.keys() == other.metrics.keys() and "largest" in other.metrics
    assert all(np.array_equal(one.metrics[name], other.metrics[name]) for name in one.metrics)
    kept = [[read_result(files.kept[k]) for files in (one, other)] for k in (0, 8)]
    assert all(np.array_equal(a[name], b[name]) for a, b in kept for name in a.signals)
    assert [result.run.versions["loop"] for result in kept[0]] == ["C", "vectors"]
    table = [(tmp_path / engine / "semera_valve_sweep.csv").read_bytes() for engine in swept]
    assert table[0] == table[1]


STUDY = """
title = "Damping"
scenario = "SCENARIO"
seeds = 2
[grid]
"valve.damping" = [0.1, 0.2, VALUE]
[trajectories]
signals = ["valve.position"]
"""


def test_campaign_has_the_same_numbers_and_a_run_that_fails_says_why(fmus, tmp_path):
    study = tmp_path / "study.toml"
    text = STUDY.replace("SCENARIO", (SCENARIOS / "semera_valve").as_posix())
    study.write_text(text.replace("VALUE", "1e300"), encoding="utf-8")
    found = {e: campaign(study, 2, tmp_path / e, fmus, engine=e) for e in ("fmu", "vectors")}
    one, other = found.values()
    assert (one.engine, other.engine, one.failed, other.failed) == ("fmu", "vectors", 2, 2)
    assert [str(row) for row in one.errors(9)] == [str(row) for row in other.errors(9)]
    for name in one.metrics:
        assert np.array_equal(one.column(name), other.column(name), equal_nan=True)


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"experiment.isolation": "process"}, "separate processes"),
        ({"experiment.pace": 100.0}, "a pace"),
        (None, "not from this version: `valve` (SolenoidValve.fmu)"),
    ],
)
def test_why_not_is_said_where_vectors_were_asked_for(fmus, tmp_path, caplog, change, why):
    folder = tmp_path / "fmus"
    shutil.copytree(fmus, folder)
    if change is None:
        build(own("SolenoidValve"), folder, {"damping": 0.3})
    file = Path(shutil.copytree(SCENARIOS / "semera_valve", tmp_path / "valve")) / "scenario.toml"
    lines = [f"{key.partition('.')[2]} = {value!r}" for key, value in (change or {}).items()]
    file.write_text(file.read_text("utf-8").replace("[experiment]", "\n".join(["[experiment]", *lines])), "utf-8")
    assert sweep(file, 2, fmus=folder).engine == "fmu" and not caplog.records
    assert sweep(file, 2, fmus=folder, engine="vectors").engine == "fmu"
    assert why in caplog.records[0].message and "runs with FMUs instead of vectors" in caplog.records[0].message


def test_unknown_engine_is_refused(fmus):
    with pytest.raises(cosim.ScenarioError, match=r"engine: `vector` found. Did you mean `vectors`\?"):
        sweep(SCENARIOS / "semera_valve", 2, fmus=fmus, engine="vector")


@pytest.mark.slow
def test_vectors_hold_every_metric_and_baseline(fmus):
    outcomes = cosim.test_scenarios(SCENARIOS, fmus, engine="vectors")
    assert not [o for o in outcomes if not o.passed] and len(outcomes) > 40
    loops = {(load(o.path, o.variant).experiment.method == ITERATIVE, o.result.run.versions["loop"]) for o in outcomes}
    assert loops == {(False, "vectors"), (True, "Python only")}
