"""A run that is gone on with, in another process, has the bits of one that was never interrupted, for all our FMUs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scenarios_of_ours
from scenarios_of_ours import read

from gapsense.cosim import Checkpoint, Master, prepare, run
from gapsense.cosim.run.apart import Listeners, Plan, record_apart
from gapsense.cosim.run.checkpoint import keeper
from gapsense.cosim.run.recording import Subject

SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"
CASES = [
    ("semera_valve", None, "gauss-seidel"),
    ("semera_valve", None, "jacobi"),
    ("pot_magnet", None, "gauss-seidel"),
    ("profiles", None, "jacobi"),
    ("estimators", "other_physics", "gauss-seidel"),
    ("run_to_run", "model", "gauss-seidel"),
    ("condition", None, "gauss-seidel"),
    ("lifting_magnet", None, "jacobi"),
    ("power_stage", None, "iterative"),
]
COUNT, EVERY = 500, 251  # base steps: components of other steps and offsets are in the midst of theirs


def test_cases_have_all_fmus_of_the_scenarios():
    drafts = [read(*each) for each in scenarios_of_ours.EVERY]
    chosen = [read(SCENARIOS / folder / "scenario.toml", variant) for folder, variant, _ in CASES]
    assert fmus_of(chosen) == fmus_of(drafts)


def fmus_of(scenarios):
    return {component.fmu for scenario in scenarios for component in scenario.components.values()}


@pytest.mark.parametrize(("folder", "variant", "method"), CASES)
def test_resumed_run_has_the_same_bits(fmus, tmp_path, folder, variant, method):
    scenario, descriptions = prepare(SCENARIOS / folder, variant, fmus)
    scenario = replace(scenario, experiment=replace(scenario.experiment, count=COUNT, method=method))
    take = Subject(scenario, descriptions).make_take()
    file, base = tmp_path / "run.checkpoint", scenario.experiment.base_step
    with Master(scenario, descriptions) as master:
        kept = keeper(Checkpoint(file, EVERY * base), scenario, descriptions, take)
        whole = master.run(take.columns, take.seeds, values=take.values, keeper=kept)
    kept = keeper(Checkpoint(file, resume=True), scenario, descriptions, take)
    rows = []
    resumed = record_apart(Plan(scenario, descriptions, take, kept), Listeners(lambda done, _: rows.append(done)))
    assert not whole.error and not resumed.error and whole.rows == resumed.rows
    assert whole.data[: whole.rows].tobytes() == resumed.data[: resumed.rows].tobytes()
    assert np.isfinite(whole.data[: whole.rows]).all()
    assert (whole.parameters, whole.calls, whole.messages) == (resumed.parameters, resumed.calls, resumed.messages)
    assert all(done == 0 or done >= EVERY for done in rows)


def test_checkpoint_of_a_relative_path_stays_where_it_was_asked_for(fmus, tmp_path, monkeypatch):
    (tmp_path / "away").mkdir()
    monkeypatch.chdir(tmp_path)

    def wander(*_):
        monkeypatch.chdir(tmp_path / "away")

    run(SCENARIOS / "semera_valve", fmus=fmus, progress=wander, checkpoint=Checkpoint(Path("a.checkpoint"), 0.02))
    assert (tmp_path / "a.checkpoint").is_file() and not list((tmp_path / "away").iterdir())
    assert Path.cwd() == tmp_path
