"""A run in a process of its own: whatever a component does to it, the caller has the rows, the place and the cause."""

import dataclasses
import sys

import faulty
import numpy as np
import pytest

from gapsense.cosim import Checkpoint, FmuError, ScenarioError, run, test_scenarios, write_junit

APART = 'base_step = 0.1\nstep_limit = 1.0\nisolation = "process"'
FAULTY = faulty.FAULTY.replace("base_step = 0.1", APART)
ENDINGS = {
    "exit": "its process ended with exit code 0, in its step.",
    "segfault": "its process was ended by signal 11 (SIGSEGV, Segmentation fault), in its step.",
    "kill": "its process was ended by signal 9 (SIGKILL, Killed), in its step.",
    "hang": "no answer within 1 s, the limit, so its process was ended, in its step.",
    "discard": "fmi2DoStep returned fmi2Discard; the component says: step too long.",
    "nan": "output `y` is nan. Look at its inputs and parameters; the component gives no reason.",
}


@pytest.mark.parametrize("fault", ENDINGS)
@pytest.mark.skipif(sys.platform == "win32", reason="speaks of signals")
def test_end_of_the_process_is_told_with_component_time_and_cause_and_the_rows_are_kept(write, fmus, fault):
    with pytest.raises(FmuError) as caught:
        run(write(FAULTY.replace("FAULT", fault)), fmus=fmus)
    error = caught.value
    assert (error.instance, error.time, error.step, error.cause) == ("coil", 0.5, 6, ENDINGS[fault])
    assert error.result.times.tolist() == [k * 0.1 for k in range(6)]
    good = run(write(FAULTY.replace("FAULT", "")), fmus=fmus, isolation="none")
    assert all(np.array_equal(error.result[name], good[name][:6]) for name in good.signals)
    assert error.result.parameters["coil.fault"] == fault
    assert error.result.failure == str(error)


def test_run_apart_has_the_same_result(write, fmus):
    path = write(FAULTY.replace("FAULT", "warn"))
    seen = []
    apart = run(path, fmus=fmus, progress=lambda done, total: seen.append((done, total)))
    here = run(path, fmus=fmus, isolation="none")
    assert all(np.array_equal(apart[name], here[name]) for name in here.signals)
    for name in ("run", "parameters", "metrics", "messages", "about", "interrupted"):
        assert getattr(apart, name) == getattr(here, name)
    assert {n: t.calls for n, t in apart.timing.items()} == {n: t.calls for n, t in here.timing.items()}
    assert seen == sorted(seen) and seen[-1] == (10, 10)
    assert dataclasses.fields(apart) == dataclasses.fields(here)


def test_failure_at_the_start_names_the_component(write, fmus):
    with pytest.raises(FmuError, match="coil: fmi2ExitInitializationMode returned fmi2Fatal"):
        run(write(FAULTY.replace("FAULT", "initialization")), fmus=fmus)


def test_component_that_hangs_at_the_start_is_named(write, fmus):
    with pytest.raises(FmuError, match="coil: no answer within 1 s, the limit, so its process was ended, at its init"):
        run(write(FAULTY.replace("FAULT", "stuck")), fmus=fmus)


def test_what_components_print_is_seen(write, fmus, capsys):
    run(write(FAULTY.replace("FAULT", "print")), fmus=fmus)
    assert "coil says so" in capsys.readouterr().err


def test_nothing_stays_behind(write, fmus, tmp_path, monkeypatch):
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(temporary))
    run(write(FAULTY.replace("FAULT", "")), fmus=fmus)
    with pytest.raises(FmuError):
        run(write(FAULTY.replace("FAULT", "exit")), fmus=fmus)
    assert list(temporary.iterdir()) == []


def test_other_scenarios_are_tested_and_reported_one_by_one(write, fmus, tmp_path):
    for folder, fault in (("a", ""), ("b", "exit"), ("c", "")):
        write(FAULTY.replace("FAULT", fault), folder)
    seen = []

    def report(outcomes, last):
        write_junit(outcomes, tmp_path / "junit.xml")
        seen.append([(tmp_path / "junit.xml").read_text("utf-8").count("not tested"), last and last.passed])

    outcomes = test_scenarios(tmp_path, fmus, report, isolation="process")
    assert [outcome.passed for outcome in outcomes] == [True, False, True]
    assert outcomes[1].failures[0].failure.startswith("coil, t = 0.5 s (base step 6): its process ended with exit code")
    assert seen == [[6, None], [4, True], [2, False], [0, True]]  # each in an attribute and in a text


def test_unknown_isolation_is_refused(write, fmus):
    with pytest.raises(ValueError, match=r"`isolation` is 'proces'\. Did you mean `process`"):
        run(write(FAULTY), fmus=fmus, isolation="proces")


def test_checkpoints_of_fmus_that_cannot_save_their_state_are_refused(write, fmus, tmp_path):
    with pytest.raises(ScenarioError) as caught:
        run(write(FAULTY), fmus=fmus, checkpoint=Checkpoint(tmp_path / "x", 0.5))
    assert caught.value.problems == [
        f"scenario.toml, components.{name}.fmu: `{fmu}.fmu` cannot save its state (canGetAndSetFMUstate and "
        "canSerializeFMUstate), so the run has no checkpoints. Run it without them."
        for name, fmu in (("lag", "Lag"), ("coil", "Faulty"))
    ]
