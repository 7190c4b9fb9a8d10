"""A component that goes to another working folder: relative paths of scenarios, FMUs and results mean what they did."""

import sys
from pathlib import Path

import faulty
import pytest

from gapsense import campaign
from gapsense.cosim import run, sweep, test_scenarios

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="goes to /")
BOUNDED = '[metrics.end]\nkind = "final"\nsignal = "coil.y"\nbounds = [0.9, 1.1]\n'
SWEPT = '[sweep]\n"coil.at" = [0.3, 0.5]\n'
STUDY = 'title = "Wandering"\nscenario = "demo"\n[trajectories]\nsignals = ["coil.y"]\n'


@pytest.fixture(params=["chdir_at_start", "chdir", "chdir_at_end"])
def here(request, write, fmus, tmp_path, monkeypatch):
    """The working folder, with a scenario, a study and the FMUs in it."""
    write(faulty.FAULTY.replace("FAULT", request.param) + BOUNDED + SWEPT)
    (tmp_path / "study.toml").write_text(STUDY, encoding="utf-8")
    (tmp_path / "fmus").symlink_to(fmus)
    monkeypatch.chdir(tmp_path)
    yield tmp_path
    assert Path.cwd() == tmp_path


@pytest.mark.parametrize("isolation", ["none", "process"])
def test_run_and_its_result(here, isolation):
    run("demo", fmus="fmus", isolation=isolation).save(Path("out/demo.csv"))
    assert (here / "out" / "demo.csv").is_file()


def test_sweep_with_signals(here):
    swept = sweep("demo", workers=1, out="out", fmus="fmus", keep=True)
    assert not swept.errors and all((here / file).is_file() for file in (swept.file, *swept.kept))


@pytest.mark.parametrize("isolation", ["none", "process"])
def test_scenarios_are_tested(here, isolation):
    outcomes = test_scenarios("demo", "fmus", isolation=isolation)
    assert [outcome.passed for outcome in outcomes] == [True], outcomes


def test_campaign(here):
    result = campaign("study.toml", 1, "out", "fmus")
    assert (result.rows, result.failed) == (2, 0) and (here / "out" / "campaign.sqlite").is_file()
