"""A run with other values on the command line leaves the plain result alone, and says what it is."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from gapsense.cli import app
from gapsense.cosim import read_result


def gapsense(*arguments: object):
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


@pytest.fixture
def run(write, chain, fmus, tmp_path, monkeypatch):
    """Runs the scenario `demo` with some words more."""
    monkeypatch.chdir(tmp_path)
    path = write(chain)

    def run(*words: object, command: str = "run"):
        return gapsense(command, path, "--fmus", fmus, *words)

    return run


@pytest.mark.parametrize(
    ("settings", "name"),
    [
        (["source.slope=3"], "demo_source.slope=3"),
        (["source.slope = 3", "gain.gain=2.5"], "demo_source.slope=3_gain.gain=2.5"),
        (['source.shape="../x y"'], "demo_set-*"),
        (["source.slope=-1e-3", *(f"lag.time.constant={1}" for _ in range(1))], "demo_source.slope=-1e-3_lag*"),
    ],
)
def test_changed_run_has_a_name_of_its_own(run, settings, name):
    assert run().exit_code == 0
    before = {file: file.read_bytes() for file in Path("results").iterdir()}
    words = [word for setting in settings for word in ("--set", setting)]
    done = run(*words)
    assert done.exit_code == 0, done.output
    (file,) = (f for f in Path("results").glob(f"{name}.csv") if f not in before)
    result = read_result(file)
    assert str(file) in done.output
    assert result.run.settings and all(key in result.run.title for key in result.run.settings)
    assert run(*words, command="figure").exit_code == 0
    assert file.with_suffix(".png").is_file() and not Path("results/demo.png").exists()
    assert {f: f.read_bytes() for f in before} == before
    assert run(*words).exit_code == 0


def test_out_may_be_the_file_itself(run):
    assert run("--out", "x.csv").exit_code == 0
    assert Path("x.csv").is_file() and read_result("x.csv").times.size == 11
    assert run("--out", "x.csv", "--set", "source.slope=3").exit_code == 0
    Path("precious.csv").write_text("mine")
    assert run("--out", "precious.csv").exit_code == 2
    assert Path("precious.csv").read_text() == "mine"


@pytest.mark.parametrize("name", ["x.png", "x.json", "x.html", "x.PNG"])
def test_out_that_is_no_folder_is_refused(run, name):
    done = run("--out", name)
    assert done.exit_code == 2 and "a folder" in " ".join(done.output.split()) and not Path(name).exists()


def test_folders_with_dots_are_folders(run):
    assert run("--out", "results.v2").exit_code == 0
    assert Path("results.v2/demo.csv").is_file()
    Path("old.csv").mkdir()
    assert run("--out", "old.csv").exit_code == 0
    assert Path("old.csv/demo.csv").is_file()
