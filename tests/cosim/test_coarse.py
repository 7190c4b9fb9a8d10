"""A time grid that is too coarse for what happens on it is told: by `check`, `run` and `test`, and in the report."""

import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

import gapsense.cli.new as minimal
from gapsense.cli import app
from gapsense.cosim import check, read_result, remarks, run

SHIPPED = Path(__file__).parents[2] / "scenarios"
WORDS = "Is `base_step` as it should be?"


def gapsense(*arguments: object):
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def said(path, fmus=None) -> str:
    assert check(path, fmus=fmus) == []
    return "\n".join(remarks(path, fmus=fmus))


@pytest.fixture
def valve(tmp_path, monkeypatch):
    """Writer of the minimal scenario with another time grid."""
    monkeypatch.chdir(tmp_path)

    def write(**numbers: str) -> Path:
        text = minimal.MINIMAL.read_text(encoding="utf-8")
        for name, value in numbers.items():
            text, count = re.subn(rf"(?m)^({name}) = \S+", rf"\1 = {value}", text)
            assert count
        path = tmp_path / "my_valve" / "scenario.toml"
        path.parent.mkdir(exist_ok=True)
        path.write_text(text, encoding="utf-8")
        return path

    return write


@pytest.mark.parametrize("name", sorted(path.parent.name for path in SHIPPED.glob("*/scenario.toml")))
def test_scenarios_of_ours_have_steps_that_fit(name):
    assert remarks(SHIPPED / name) == []


def test_minimal_scenario_has_steps_that_fit(valve):
    assert remarks(valve()) == []
    assert remarks(valve(base_step="40e-6")) == []


@pytest.mark.parametrize(
    "step", ["20e-3", *(pytest.param(step, marks=pytest.mark.slow) for step in ("200e-6", "2e-3", "4e-3", "40e-3"))]
)
def test_coarse_step_is_told_wherever_it_is_run(valve, step):
    path = valve(base_step=step)
    assert re.search(r"components\.sensor: its step is \S+ s, \d+ times `sample_time`, 2e-05 s", said(path))
    done = gapsense("check", path)
    assert done.exit_code == 0 and WORDS in done.output and "no problems" not in done.output
    assert WORDS in gapsense("run", path).output
    assert read_result("results/my_valve.csv").run.remarks
    assert WORDS in gapsense("test", path).output
    assert gapsense("report", "results/my_valve.csv").exit_code == 0
    assert "<code>sample_time</code>, 2e-05 s" in Path("results/my_valve.html").read_text(encoding="utf-8")


def test_sample_times_that_are_coarse_too_leave_the_period_and_the_default_experiment(valve):
    told = said(valve(base_step="20e-3", sample_time="20e-3"))
    assert "`square.period` is 0.02 s" in told and "default experiment" in told and "has 2 base steps" in told


def test_foreign_fmus_state_their_step_in_the_default_experiment(write, chain, fmus):
    assert "default experiment" not in said(write(chain), fmus)


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ("[inputs.gain.u]\ntimes = [0.0, 0.31, 0.32, 0.33, 2.0]\nvalues = [0.0, 0.0, 5.0, 0.0, 0.0]\n", "1 samples"),
        ("[inputs.gain.u]\ntimes = [0.0, 0.3, 0.4, 0.5, 2.0]\nvalues = [0.0, 0.0, 5.0, 0.0, 0.0]\n", ""),
        (
            '[inputs.gain.u]\ntimes = [0.0, 0.31, 0.33, 2.0]\nvalues = [0.0, 5.0, 0.0, 0.0]\ninterpolation = "hold"\n',
            "inputs.gain.u: 1 samples, the first at 0.31 s",
        ),
        ('[inputs]\n"gain.u" = 1\n[record]\ndecimation = 9\n', "2 rows are recorded"),
        (
            '[inputs]\n"gain.u" = 1\n[record]\ndecimation = 2\n[events.e]\ntarget = "lag.u"\naction = "bias"\n'
            "value = 1.0\nat = 0.3\nduration = 0.1\n",
            "events.e: it lasts 0.1 s",
        ),
    ],
)
def test_what_falls_between_steps_or_rows_is_told(write, chain, fmus, more, words):
    path = write(chain[: chain.rindex("[[connections]]")] + more)
    told = said(path, fmus)
    assert words in told if words else told == ""
    assert run(path, fmus=fmus).run.remarks == tuple(told.splitlines())


def test_pulses_of_a_table_are_told(valve):
    path = valve(base_step="1e-3", sample_time="1e-3")
    text = path.read_text(encoding="utf-8")
    (path.parent / "pulse.csv").write_text(
        "time [s],voltage [V]\n0,0\n5.1e-3,0\n5.2e-3,30\n5.4e-3,30\n5.5e-3,0\n40e-3,0\n"
    )
    path.write_text(text.replace('waveform = "square"', 'waveform = "table"\n"table.file" = "pulse.csv"'))
    assert "components.drive.table.file: 2 samples, the first at 0.0052 s, lie in pulses" in said(path)


def test_run_of_a_handful_of_steps_is_told(write, chain, fmus):
    assert "the run has 4 base steps" in said(write(chain.replace("stop = 1.0", "stop = 0.4")), fmus)
