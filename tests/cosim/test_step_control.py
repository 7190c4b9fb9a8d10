"""Communication steps by an error estimate, `step_control`, and inputs that go on in a straight line."""

import numpy as np
import pytest
from test_every_number import CONTROL, FEW
from test_iterate import exact, masses, same

from gapsense import converge
from gapsense.cosim import Checkpoint, FmuError, ScenarioError, check, read_result, run
from gapsense.report import runs

STIFF, STOP = 1e3, 0.5


def controlled(tolerance, method="gauss-seidel", own="", more="", every=64, stop=STOP, plain=False):
    """Two masses on a fine grid, with a row after so many base steps; `plain` has no mean values."""
    more = f"step_control = {tolerance!r}\n{more}"
    text = masses(STIFF, method, own, stop, more).replace("base_step = 0.001", f"base_step = {0.016 / 64!r}")
    if plain:
        text = text.replace("spring.force_mean", "spring.force").replace("mean = true", "factor = 1.0")
    return text + f'[record]\nsignals = ["*.x", "*.x2", "*.force", "*.speed"]\ndecimation = {every}\n'


def off(result):
    return np.abs(result["mass.x"] - exact(STIFF, result.times)).max() / 0.01


PUSH = '[events.push]\ntarget = "mass.force"\naction = "bias"\nvalue = 5.0\n'


@pytest.mark.parametrize(
    ("method", "tolerances"),
    [("gauss-seidel", (0.3, 0.03, 1e-7)), ("jacobi", (0.3, 0.03, 1e-7)), ("iterative", (1e-3, 3e-5, 1e-8))],
)
def test_error_falls_with_the_tolerance_as_far_as_the_grid_goes(write, coupled_2, method, tolerances):
    found = [run(write(controlled(tolerance, method, stop=0.256)), fmus=coupled_2) for tolerance in tolerances]
    coarse, fine, too_fine = (result.run.steps for result in found)
    assert off(found[0]) > off(found[1]) and off(found[1]) < 0.03
    assert coarse.done < 0.8 * fine.done and fine.done < 0.8 * too_fine.done
    assert coarse.beyond == fine.beyond == 0 < too_fine.beyond
    assert coarse.worst <= tolerances[0] and fine.worst <= tolerances[1]
    assert "experiment.step_control" in found[2].run.remarks[-1]
    assert not any("step_control" in remark for remark in found[1].run.remarks)
    assert all(result.times.size == 17 and result.times[1] == 0.016 for result in found)


@pytest.mark.parametrize("method", ["gauss-seidel", "jacobi", "iterative"])
def test_apart_and_resumed_and_twice_the_bits_are_the_same(write, coupled, tmp_path, method):
    """With steps that are too long, since something happens at 18 ms; the checkpoint is written after that."""
    tail = PUSH + '[events.push.when]\nsignal = "mass.x"\nbelow = 0.0099\n'
    texts = (
        controlled(1e-3, method, own, 'inputs = "linear"', plain=True, stop=0.048) + tail
        for own in ("", 'isolation = "process"')
    )
    here, there = (run(write(text), fmus=coupled) for text in texts)
    same(here, there)
    assert here.run.steps == there.run.steps and here.run.steps.rejected > 0 < here.events[0].begin < 0.03
    path = write(controlled(1e-3, method, "", 'inputs = "linear"', plain=True, stop=0.048) + tail)
    file, halted = tmp_path / "saved", []

    def halt(done, count):
        if done >= 130 and not halted:
            halted.append(done)
            raise KeyboardInterrupt

    assert run(path, fmus=coupled, progress=halt, checkpoint=Checkpoint(file, 0.007)).interrupted
    resumed = run(path, fmus=coupled, checkpoint=Checkpoint(file, 0.007, resume=True))
    same(here, resumed)
    assert here.run.steps == resumed.run.steps and here.events == resumed.events


def test_steps_are_saved_and_shown(write, coupled_2, tmp_path):
    result = run(write(controlled(1e-3)), fmus=coupled_2, isolation="process")
    again = read_result(result.save(tmp_path / "result.csv"))
    assert again.run == result.run and again.run.steps.done > 0
    shown = runs.steps(again)[0]
    assert [str(c.header) for c in shown.columns][:4] == ["steps", "shortest", "longest", "too long"]


def test_steps_keep_to_their_limits(write, coupled_2):
    result = run(write(controlled(1e-2, more="shortest_step = 4\nlongest_step = 8")), fmus=coupled_2)
    assert result.run.steps.shortest == 4 * 0.00025 and result.run.steps.longest == 8 * 0.00025


def test_halving_the_base_step_tells_nothing_of_steps_that_are_controlled(write, coupled_2):
    with pytest.raises(ScenarioError, match="Compare with a run in which it is smaller"):
        converge(write(controlled(1e-2)), fmus=coupled_2)


def test_event_by_a_condition_is_where_it_is_with_steps_that_are_all_short(write, coupled_2):
    """Long steps would step over it: they are done again, down to a base step."""
    text = controlled(1e-3, "iterative", stop=0.064) + PUSH + '[events.push.when]\nsignal = "mass.x"\nbelow = 0.0095\n'
    found = run(write(text), fmus=coupled_2)
    fixed = run(write(text.replace("step_control = 0.001", "")), fmus=coupled_2)
    assert found.events == fixed.events != () and found.run.steps.rejected > 3 and found.run.steps.done < 150
    assert np.abs(found["mass.x"] - fixed["mass.x"]).max() < 1e-3 * 0.01


def test_component_of_its_own_step_keeps_its_instants(write, coupled_2):
    text = controlled(1e-3, every=64).replace('fmu = "Spring"', 'fmu = "Spring"\nstep = 20\noffset = 3')
    result = run(write(text), fmus=coupled_2)
    assert result.run.steps.longest <= 10 * 0.00025 and result.run.steps.shortest == 0.00025
    assert result.timing["spring"].calls > (2000 - 3) // 20 > 90


def test_steps_that_a_component_fails_of_are_shorter(write, coupled_2):
    """The node refuses inputs below 0; where that comes, a step fails that could not be shorter."""
    text = controlled(1e-3, "iterative").replace(
        "[connect]", '[components.n]\nfmu = "Node"\nset = { least = 0.0 }\n[connect]'
    )
    text = text.replace(
        "[record]",
        '[inputs]\n"n.v" = 0\n[[connections]]\nfrom = "mass.x"\nto = "n.u"\nfactor = 1.0\nunit = "V"\n[record]',
    )
    with pytest.raises(FmuError) as caught:
        run(write(text), fmus=coupled_2)
    error, after = caught.value, exact(STIFF, np.arange(2001) * 0.00025)
    assert error.instance == "n" and error.step == pytest.approx(np.flatnonzero(after < 0.0)[0], abs=3)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("decimation = 64", "decimation = 1", "have to fit between rows, and `decimation` in `[record]` is 1"),
        ("shortest_step = 1\nlongest_step = 9", "shortest_step = 33", "= 33 have to fit between rows"),
        ("shortest_step = 1", "shortest_step = 10", "9 found, at least `shortest_step` = 10"),
        ("step_control = 0.001", "", "longest_step: it is for steps that are controlled"),
        ("step_control = 0.001", "step_control = 0.0", "experiment.step_control: "),
        ("OWN", "step = 2", "no component takes steps of any length"),
    ],
)
def test_what_cannot_be_controlled_is_refused(write, coupled_2, old, new, words):
    text = controlled(0.001, own="OWN", more="shortest_step = 1\nlongest_step = 9")
    assert words in "\n".join(check(write(text.replace(old, new).replace("OWN", "")), fmus=coupled_2))


def test_component_that_cannot_go_back_is_refused_by_name(write, chain, fmus):
    text = chain.replace("stop = 1.0", "stop = 1.0\nstep_control = 1e-3") + "[record]\ndecimation = 5\n"
    found = "\n".join(check(write(text), fmus=fmus))
    assert "components.gain: `Gain.fmu` cannot save its state" in found


@pytest.mark.parametrize("key", sorted(CONTROL))
def test_any_number_is_run_or_refused(write, coupled_2, key):
    text = controlled(0.1, "iterative", more="shortest_step = 1\nlongest_step = 9", stop=0.032)
    lines = text.splitlines()
    place = next(k for k, one in enumerate(lines) if one.startswith(key))
    for value in FEW:
        lines[place] = f"{key} = {value!r}"
        path = write("\n".join(lines))
        problems = check(path, fmus=coupled_2)
        assert all(key in problem and len(problem) < 600 for problem in problems)
        assert problems or run(path, fmus=coupled_2).times.size == 3


# Explicit methods with inputs that go on ------------------------------------------------------------------------------


@pytest.mark.parametrize("method", ["gauss-seidel", "jacobi"])
def test_inputs_in_a_straight_line_make_explicit_methods_of_second_order(write, coupled_2, method):
    errors = {}
    for inputs in ("hold", "linear"):
        for step in (2e-3, 1e-3):
            text = masses(STIFF, method, stop=STOP, more=f'inputs = "{inputs}"').replace(
                "base_step = 0.001", f"base_step = {step!r}"
            )
            text = text.replace("spring.force_mean", "spring.force").replace("mean = true", "factor = 1.0")
            errors[inputs, step] = off(run(write(text), fmus=coupled_2))
    assert errors["linear", 1e-3] < 0.05 * errors["hold", 1e-3]
    assert errors["linear", 2e-3] > 3.0 * errors["linear", 1e-3]
    assert errors["hold", 2e-3] < 3.0 * errors["hold", 1e-3]


def test_event_on_an_input_is_not_taken_for_a_slope(write, coupled_2):
    """An input that an event changes holds, so that what it adds is no ramp that would go on."""
    text = masses(STIFF, "jacobi", stop=0.05, more='inputs = "linear"')
    text = text.replace("spring.force_mean", "spring.force").replace("mean = true", "factor = 1.0")
    event = '[events.push]\ntarget = "mass.force"\naction = "bias"\nvalue = VALUE\nat = 0.02\n'
    pushed, zero = (run(write(text + event.replace("VALUE", value)), fmus=coupled_2) for value in ("0.1", "0.0"))
    change = (pushed["mass.speed"] - zero["mass.speed"])[20:23] / 1e-4
    assert change[0] == 0.0 and change[1] == pytest.approx(1.0, rel=0.01)
