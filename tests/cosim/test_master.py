"""The loop does what the documentation says: checked against a plain loop written by hand.

Everything runs twice: with the C library that does base steps, and with the Python code in its place.
"""

import math
from pathlib import Path

import numpy as np
import pytest
from faulty import FAULTY
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gapsense.cosim import FmuError, Master, check, prepare, run, run_once
from gapsense.cosim.fmu.instance import summary
from gapsense.cosim.run.loop import compiled
from gapsense.cosim.scenario.records import Experiment

GRIDS = st.tuples(st.integers(1, 4), st.integers(0, 3))


@pytest.fixture(scope="module", params=["C", "Python"], autouse=True)
def loop_binary(request):
    with pytest.MonkeyPatch.context() as patch:
        if request.param == "Python":
            patch.setattr(compiled, "BINARY", Path("none.so"))
        elif compiled.entry() is None:
            pytest.skip("the library is for Linux on x86-64")
        yield compiled.BINARY


def by_hand(count, base, is_jacobi, grids, start=0.0, constant=0.5, gain=2.0, slope=2.0):
    """Rows [source.y, lag.u, lag.y, gain.u, gain.y] of the chain, with everything spelt out."""
    source = {"y": 1.0 + slope * (start + grids[0][1] * base)}
    lag, amplifier = {"u": source["y"], "y": 0.0}, {"u": 0.0, "y": gain * 0.0}

    def step_source(k, h):
        source["y"] = 1.0 + slope * ((start + (k - grids[0][0]) * base) + h)

    def take_lag():
        lag["u"] = source["y"]

    def step_lag(k, h):
        lag["y"] += h / constant * (lag["u"] - lag["y"])

    def take_gain():
        amplifier["u"] = lag["y"]

    def step_gain(k, h):
        amplifier["y"] = gain * amplifier["u"]

    parts = [(lambda: None, step_source), (take_lag, step_lag), (take_gain, step_gain)]
    rows = [[source["y"], lag["u"], lag["y"], amplifier["u"], amplifier["y"]]]
    for k in range(1, count + 1):
        for (take, step), (every, offset) in zip(parts, grids):
            if k > offset and (k - offset) % every == 0:
                if not is_jacobi:
                    take()
                step(k, every * base)
        if is_jacobi:
            for (take, _), (every, offset) in zip(parts, grids):
                if k >= offset and (k - offset) % every == 0:
                    take()
        rows.append([source["y"], lag["u"], lag["y"], amplifier["u"], amplifier["y"]])
    return np.array(rows)


def chain_with(chain, method, grids, base=0.1, count=12, start=0.0):
    text = chain.replace("stop = 1.0", f'start = {start!r}\nstop = {start + count * base!r}\nmethod = "{method}"')
    text = text.replace("base_step = 0.1", f"base_step = {base!r}")
    for fmu, (step, offset) in zip(("Source", "Lag", "Gain"), grids):
        text = text.replace(f'fmu = "{fmu}"', f'fmu = "{fmu}"\nstep = {step}\noffset = {offset}')
    return text


@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(method=st.sampled_from(["gauss-seidel", "jacobi"]), grids=st.tuples(GRIDS, GRIDS, GRIDS))
def test_run_equals_the_loop_by_hand(write, chain, fmus, method, grids):
    result = run(write(chain_with(chain, method, grids)), fmus=fmus)
    names = ("source.y", "lag.u", "lag.y", "gain.u", "gain.y")
    got = np.column_stack([result[name] for name in names])
    assert np.array_equal(got, by_hand(12, 0.1, method == "jacobi", grids))
    for name, (step, offset) in zip(("source.y", "lag.y", "gain.y"), grids):
        expected = [k > offset and (k - offset) % step == 0 for k in range(13)]
        assert result.stepped(name).tolist() == expected
    assert [t.calls for t in result.timing.values()] == [(12 - offset) // step for step, offset in grids]


def test_gauss_seidel_has_no_delay_and_jacobi_one_step_per_connection(write, chain, fmus):
    fast = chain.replace('fmu = "Lag"', 'fmu = "Gain"').replace('to = "lag.u"', 'to = "lag.u"')
    fast = fast.replace('from = "lag.y"', 'from = "lag.y"\nfactor = 1.0')
    seidel = run(write(fast), fmus=fmus)
    assert np.array_equal(seidel["gain.y"], 4.0 * seidel["source.y"])
    jacobi = run(write(fast.replace("stop", 'method = "jacobi"\nstop')), fmus=fmus)
    assert np.array_equal(jacobi["gain.y"][2:], 4.0 * jacobi["source.y"][:-2])


LOOP = """
title = "Lag with proportional feedback"
[experiment]
stop = 1.0
base_step = 0.1
[components.gain]
fmu = "Gain"
set = { gain = -3.0 }
[components.lag]
fmu = "Lag"
[[connections]]
from = "gain.y"
to = "lag.u"
factor = 2.0
bias = 1.0
unit = "V"
[[connections]]
from = "lag.y"
to = "gain.u"
"""


def test_loop_is_cut_where_there_is_no_feedthrough(write, fmus):
    result = run(write(LOOP), fmus=fmus)
    assert result.run.order == ("lag", "gain")
    assert result.run.delayed == ("gain.y -> lag.u",)
    y, fed_back, expected = 0.0, -0.0, [0.0]
    for _ in range(10):
        y += 0.1 / 0.5 * (2.0 * fed_back + 1.0 - y)
        fed_back = -3.0 * y
        expected.append(y)
    assert result["lag.y"].tolist() == expected


def test_loop_is_cut_where_a_connection_is_delayed(write, fmus):
    result = run(write(LOOP + "delayed = true\n"), fmus=fmus)
    assert result.run.order == ("gain", "lag")
    assert result.run.delayed == ("lag.y -> gain.u",)
    y, expected = 0.0, [0.0]
    for _ in range(10):
        y += 0.1 / 0.5 * (2.0 * (-3.0 * y) + 1.0 - y)
        expected.append(y)
    assert result["lag.y"].tolist() == expected


OWN = """
title = "A gain that feeds itself"
[experiment]
stop = 0.5
base_step = 0.1
[components.gain]
fmu = "Gain"
set = { gain = 2.0 }
[[connections]]
from = "gain.y"
to = "gain.u"
bias = 1.0
delayed = true
"""


def test_component_may_have_its_own_output_of_the_step_before(write, fmus):
    assert run(write(OWN), fmus=fmus)["gain.y"].tolist() == [2.0 * (2.0**k - 1.0) for k in range(1, 7)]


def test_what_waits_for_the_step_before_of_each_other_is_refused(write, fmus):
    both = LOOP.replace('unit = "V"', 'unit = "V"\ndelayed = true') + "delayed = true\n"
    assert "algebraic loop" in "".join(check(write(both), fmus=fmus))


@given(st.floats(-1e3, 1e3), st.sampled_from([1e-4 / 3, 1 / 60, 25e-6, 0.1, 1 / 7]), st.integers(1, 10**6))
def test_time_is_start_plus_index_times_step(start, base, count):
    experiment = Experiment(start, start + count * base, base, count)
    assert experiment.time(count) == start + count * base
    assert math.isclose(experiment.time(count), experiment.stop, abs_tol=1e-12)


@pytest.mark.parametrize(("base", "count", "start"), [(1e-4 / 3, 3, 0.0), (1 / 60, 60, 0.0), (25e-6, 42, -1.05e-3)])
def test_awkward_grids_are_accepted_and_exact(write, chain, fmus, base, count, start):
    text = chain_with(chain, "gauss-seidel", [(1, 0)] * 3, base, count, start)
    result = run(write(text), fmus=fmus)
    assert result.times.tolist() == [start + k * base for k in range(count + 1)]
    assert np.array_equal(result["gain.y"], by_hand(count, base, False, [(1, 0)] * 3, start)[:, -1])


def test_stop_written_in_decimals_fits_the_grid(write, chain, fmus):
    text = chain.replace("stop = 1.0", "stop = 1e-4").replace("base_step = 0.1", "base_step = 3.3333333333333e-5")
    assert run(write(text), fmus=fmus).times.size == 4


def test_runs_repeat_bit_for_bit_and_reset_equals_fresh(write, chain, fmus):
    text = chain + '[components.noise]\nfmu = "Noise"\n[seeds]\nnoise = 5\n'
    path = write(text)
    first = run(path, fmus=fmus)
    with Master(*prepare(path, None, fmus)) as master:
        shifted, again = run_once(master, 1), run_once(master, 0)
    assert all(np.array_equal(first[name], again[name]) for name in first.signals)
    assert first.parameters == again.parameters
    assert shifted.parameters["noise.seed"] == 6
    assert not np.array_equal(first["noise.y"], shifted["noise.y"])


def test_two_instances_of_one_fmu_do_not_share_state(write, chain, fmus):
    text = chain + '[components.other]\nfmu = "Source"\nset = { level = 7.0 }\n'
    result = run(write(text), fmus=fmus)
    assert result["source.y"][0] == 1.0
    assert set(result["other.y"].tolist()) == {7.0}


FAIL = """
from gapsense.cosim import FmuError, read_result, run
try:
    run(PATH, fmus=fmus)
except FmuError as error:
    print(error.instance, error.time, error.step, error.result.times.size, len(error.log) > 0)
    print(error)
    error.result.save(PATH + ".csv")
    assert read_result(PATH + ".csv").failure == str(error)
"""


@pytest.mark.parametrize(
    ("fault", "head", "words"),
    [
        ("raise", "coil 0.5 6 6 True", "ValueError('coil burnt')"),
        ("discard", "coil 0.5 6 6 True", "fmi2DoStep returned fmi2Discard; the component says: step too long."),
        ("nan", "coil 0.5 6 6 False", "output `y` is nan"),
        ("infinite", "coil 0.5 6 6 False", "output `y` is inf"),
        ("initialization", "coil None None 0 True", "fmi2ExitInitializationMode returned fmi2Fatal"),
    ],
)
def test_failure_names_component_time_step_and_cause(write, python, fault, head, words):
    path = write(FAULTY.replace("FAULT", fault))
    done = python(FAIL.replace("PATH", repr(str(path))))
    assert done.returncode == 0, done
    assert done.stdout.splitlines()[0] == head, done
    assert words in done.stdout


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("one", "one"),
        ("first\n  second\n", "first second"),
        ("where\nTraceback (most recent call last):\n  File x\nValueError: y\n", "where ValueError: y"),
        ("\n", "(empty message)"),
    ],
)
def test_logged_text_becomes_one_line(text, line):
    assert summary(text) == line


def test_warning_does_not_stop_the_run_and_is_kept(write, fmus):
    result = run(write(FAULTY.replace("FAULT", "warn")), fmus=fmus)
    assert result.times.size == 11
    assert ("coil", 1, "getting 100 % warm") in result.messages


def test_master_works_after_a_failure(write, fmus):
    with pytest.raises(FmuError):
        run(write(FAULTY.replace("FAULT", "nan")), fmus=fmus)
    assert run(write(FAULTY.replace("FAULT", "")), fmus=fmus)["coil.y"][-1] == 1.0


INTERRUPT = """
from gapsense.cosim import run, read_result
result = run(PATH, fmus=fmus)
result.save(PATH.parent / "out" / "x")
again = read_result(PATH.parent / "out" / "x.csv")
print(result.interrupted, again.interrupted, again.times[-1], dict(again.metrics))
"""


def test_ctrl_c_leaves_what_was_computed(write, python):
    text = FAULTY.replace("FAULT", "interrupt") + '[metrics.m]\nkind = "final"\nsignal = "coil.y"\n'
    done = python(INTERRUPT.replace("PATH", f"Path({str(write(text))!r})"))
    assert done.stdout.split()[:3] == ["True", "True", "0.6000000000000001"], done
    assert done.stdout.rstrip().endswith("{}")


def test_second_ctrl_c_in_a_step_is_no_failure_of_the_component(write, python):
    done = python(INTERRUPT.replace("PATH", f"Path({str(write(FAULTY.replace('FAULT', 'insist')))!r})"))
    assert done.stdout.split()[:3] == ["True", "True", "0.5"], done


def test_pace_is_kept_and_lateness_reported(write, fmus):
    text = FAULTY.replace("FAULT", "").replace("stop = 1.0", "stop = 1.0\npace = 10.0")
    result = run(write(text), fmus=fmus)
    assert 0.1 <= result.wall < 1.0
    slow = run(write(FAULTY.replace("FAULT", "slow").replace("stop = 1.0", "stop = 1.0\npace = 50.0")), fmus=fmus)
    assert slow.run.overruns >= 4
    assert slow.run.lag > 0.01


def test_progress_ends_at_the_whole_run(write, chain, fmus):
    seen = []
    run(write(chain), fmus=fmus, progress=lambda done, total: seen.append((done, total)))
    assert seen[-1] == (10, 10)
    assert seen == sorted(seen)
