"""The commands that compare: what they print, their exit codes, their pictures."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from typer.testing import CliRunner

from gapsense import Scenario
from gapsense.cli import app
from gapsense.cosim import test_scenarios, update_baseline

PNG = b"\x89PNG"


def gapsense(*arguments: object):
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


@pytest.fixture(scope="module")
def three(tmp_path_factory, fmus) -> Path:
    """Results of three runs: `a.csv`, the same again, and one with another slope."""
    folder = tmp_path_factory.mktemp("three")
    with Scenario("chain", folder, fmus, stop=1.0, base_step=0.1) as s:
        s.add("source", "Source").add("lag", "Lag").add("gain", "Gain")
        s.connect("source.y", "lag.u").connect("lag.y", "gain.u")
        for name, slope in {"a": 2.0, "same": 2.0, "steep": 2.01}.items():
            s.set("source.slope", slope).run().save(folder / f"{name}.csv")
    return folder


@pytest.fixture
def results(three, tmp_path, monkeypatch) -> Path:
    """Their copies, in the working folder."""
    monkeypatch.chdir(tmp_path)
    shutil.copytree(three, tmp_path, dirs_exist_ok=True)
    return tmp_path


def test_equal_results_are_told_in_a_line(results):
    done = gapsense("compare", "same.csv", "a.csv")
    assert (done.exit_code, done.output.strip()) == (0, "7 of 7 signals within their tolerance, 7 of them equal.")


def test_what_differs_comes_first_in_three_lines_each(results):
    done = gapsense("compare", "steep.csv", "a.csv", "--figure", "d.png")
    lines = done.output.splitlines()
    assert done.exit_code == 1
    heads = [k for k, line in enumerate(lines) if "rows differ from a.csv" in line]
    assert heads == [0, 3, 6, 9, 12]
    assert all(lines[k + 1].startswith("  first t = ") and lines[k + 2].startswith("  worst by ") for k in heads)
    assert "2 of 7 signals within their tolerance, 2 of them equal." in done.output
    assert (results / "d.png").read_bytes().startswith(PNG)


@pytest.mark.parametrize(
    ("options", "code"),
    [
        (["--rtol", "2e-2"], 0),
        (["--atol", "0.1"], 0),
        (["--tolerance", "*=2e-2"], 0),
        (["--tolerance", "*.y=2e-2", "--tolerance", "*.u=0,0.1"], 0),
        (["--tolerance", "source.y=1e-2"], 1),
        (["--signal", "gain.mode"], 0),
        (["--before", "0.0"], 0),
        (["--after", "0.5"], 1),
    ],
)
def test_tolerances_signals_and_times_are_chosen(results, options, code):
    assert gapsense("compare", "steep.csv", "a.csv", *options).exit_code == code


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["a.csv", "nothing.csv"], "nothing.csv"),
        (["a.csv", "a.csv", "--tolerance", "1e-3"], "`PATTERN=RTOL`"),
        (["a.csv", "a.csv", "--tolerance", "x=-1"], "`PATTERN=RTOL`"),
        (["a.csv", "a.csv", "--tolerance", "x=1,2,3"], "`PATTERN=RTOL`"),
        (["a.csv", "a.csv", "--rtol", "nan", "--atol", "-1"], "--atol: -1.0 found"),
        (["a.csv", "a.csv", "--signal", "gain.yy"], "Did you mean `gain.y`?"),
        (["a.csv", "a.csv", "--figure", "d.txt"], "written as .png"),
        ([".", "a.csv"], "is a folder"),
    ],
)
def test_wrong_input_ends_with_2_and_a_sentence(results, arguments, words):
    done = gapsense("compare", *arguments)
    assert done.exit_code == 2 and words in done.output.replace("\n", " ")


@pytest.mark.slow
def test_folders_are_compared_result_by_result(results):
    for folder, steep in (("old", "a"), ("new", "steep")):
        (results / folder).mkdir()
        for name, source in (("x", "a"), ("y", steep)):
            for ending in ("csv", "json"):
                content = (results / f"{source}.{ending}").read_bytes()
                (results / folder / f"{name}.{ending}").write_bytes(content)
    done = gapsense("compare", "new", "old", "--figure", "d.png")
    assert done.exit_code == 1 and done.output.strip().endswith("1 results as before, 1 differ")
    assert {file.name for file in results.glob("*.png")} == {"d_x.png", "d_y.png"}


def test_files_without_a_common_signal_differ_and_are_drawn_empty(results):
    for name in ("x", "y"):
        (results / f"{name}.csv").write_text(f"time [s],{name}\n0,1\n1,2\n")
    done = gapsense("compare", "x.csv", "y.csv", "--figure", "d.svg")
    assert done.exit_code == 1 and "only in x.csv: `x`" in done.output and (results / "d.svg").is_file()


def test_a_baseline_is_compared_without_a_side_car(results, write, chain, fmus):
    path = write(chain + "[baseline]\ndecimation = 2\n", "held")
    update_baseline(path, fmus=fmus, write=True)
    assert gapsense("compare", "a.csv", path.parent / "baseline.csv").exit_code == 0
    assert gapsense("compare", "steep.csv", path.parent / "baseline.csv").exit_code == 1


@pytest.mark.slow
def test_a_failing_baseline_is_drawn(results, write, chain, fmus):
    path = write(chain + "[baseline]\n", "held")
    update_baseline(path, fmus=fmus, write=True)
    path.write_text(path.read_text().replace("slope = 2.0", "slope = 2.1"))
    done = gapsense("test", path.parent, "--fmus", fmus)
    assert done.exit_code == 1 and "rows differ from the baseline" in done.output
    assert (results / "results" / "failed" / "held.png").read_bytes().startswith(PNG)
    (results / "no_folder").write_text("")
    done = gapsense("test", path.parent, "--fmus", fmus, "--figures", "no_folder")
    assert done.exit_code == 2 and "no_folder" in done.output and "passed" not in done.output  # before it runs


STEP = """
title = "A step"
[experiment]
stop = 1.0
base_step = 0.1
[components.lag]
fmu = "Lag"
[inputs]
"lag.u" = { times = [0.0, 0.45, 1.0], values = [0.0, 1.0, 1.0], interpolation = "hold" }
[baseline]
signals = ["lag.u"]
"""


@pytest.mark.parametrize(("steps", "passes"), [(None, False), (0, False), (1, False), (2, True), (3, True)])
def test_edges_of_a_baseline_may_move_by_as_many_steps_as_it_says(write, fmus, steps, passes):
    path = write(STEP)
    update_baseline(path, fmus=fmus, write=True)
    late = STEP.replace("0.45", "0.65") + (f"edge_steps = {steps}\n" if steps is not None else "")
    path.write_text(late)
    assert test_scenarios(path, fmus)[0].passed is passes
    path.write_text(late + '[baseline.tolerances."lag.*"]\nedge_steps = 2\n')
    assert test_scenarios(path, fmus)[0].passed


def test_a_wrong_number_of_steps_is_refused(write, fmus):
    path = write(STEP + "edge_steps = -1\n")
    assert "edge_steps: `-1` found, a whole number of at least 0" in test_scenarios(path, fmus)[0].failures[0].failure
