"""A scenario to start from: accepted by every command at once, complete or absent."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from gapsense import cosim, shipped


@pytest.mark.parametrize("command", ["check", "run", "figure", "test", pytest.param("sweep", marks=pytest.mark.slow)])
def test_new_scenario_is_accepted(gapsense, fmus, command):
    assert gapsense("new", "my_valve").exit_code == 0
    done = gapsense(command, "my_valve", "--fmus", fmus)
    assert (done.exit_code, done.stderr) == (0, ""), done.output


def test_new_scenario_says_of_each_metric_and_variant_what_it_is(gapsense, fmus):
    gapsense("new", "a/my valve")
    read = cosim.load(Path("a", "my valve"))
    assert read.title == "my valve" and len(read.metrics) == 1 and read.metrics[0].bounds and read.seeds
    assert [p.name for p in Path("a").iterdir()] == ["my valve"]
    warm, plain = (cosim.run(Path("a", "my valve"), v, fmus).metrics["position_error"] for v in ("warm", None))
    assert plain.bounds[1] < warm.value < warm.bounds[1] < 10 * plain.value  # the bounds are no wider than they need


def test_title_of_any_name_can_be_read(gapsense):
    name = 'it\'s "my" \\valve'
    assert gapsense("new", name).exit_code == 0
    assert cosim.load(Path(name)).title == name


def test_folder_that_exists_is_refused_and_kept(gapsense):
    Path("mine").mkdir()
    Path("mine", "notes.txt").write_text("kept")
    done = gapsense("new", "mine")
    assert done.exit_code == 2 and "`mine` exists already" in done.stderr
    assert [p.name for p in Path("mine").iterdir()] == ["notes.txt"]


def test_failure_leaves_nothing(gapsense, monkeypatch):
    monkeypatch.setattr(Path, "write_text", lambda *_, **__: (_ for _ in ()).throw(OSError(28, "No space left", "x")))
    assert gapsense("new", "mine").exit_code == 2
    assert list(Path().iterdir()) == []


@pytest.mark.parametrize("name", shipped.examples())
def test_copy_of_an_example_needs_nothing_of_the_others(gapsense, fmus, name):
    assert gapsense("new", "mine", "--like", name).exit_code == 0
    assert "../" not in Path("mine", "scenario.toml").read_text("utf-8")
    assert cosim.check("mine", fmus=fmus) == []
    assert not [*Path("mine").rglob("*.py")]  # a study stays with its example
    assert {p.name for p in Path("mine").glob("baseline*")} == {
        p.name for p in (shipped.SCENARIOS / name).glob("baseline*")
    }


def test_unknown_example_is_told_with_the_nearest(gapsense):
    done = gapsense("new", "mine", "--like", "semera_vale")
    assert done.exit_code == 2 and "`semera_valve`" in done.stderr and not Path("mine").exists()


def test_baseline_of_an_example_in_an_installed_package_stays(gapsense, monkeypatch, tmp_path):
    folder = shutil.copytree(shipped.SCENARIOS / "semera_valve", tmp_path / "semera_valve")
    monkeypatch.setattr(shipped, "INSTALLED", tmp_path)
    before = (folder / "baseline.csv").read_bytes()
    done = gapsense("baseline", "semera_valve", "--write")
    assert done.exit_code == 2 and "gapsense new mine --like semera_valve" in done.stderr
    assert (folder / "baseline.csv").read_bytes() == before
