"""Scenarios with native FMUs of FMI 3.0 give the bits of those of FMI 2.0, also when they are gone on with."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from native3 import ROOT, built, placed  # noqa: F401

from gapsense.cosim import Checkpoint, Master, ScenarioError, prepare
from gapsense.cosim.run.apart import Listeners, Plan, record_apart
from gapsense.cosim.run.checkpoint import keeper
from gapsense.cosim.run.recording import Subject
from gapsense.cosim.scenario.records import ports

SCENARIOS = ROOT / "scenarios"
CASES = [
    ("semera_valve", None),
    *(
        pytest.param(*case, marks=pytest.mark.slow)
        for case in (
            *(("pot_magnet", None), ("profiles", None), ("bounded_ukf", None), ("soft_landing", None)),
            ("estimators", "other_physics"),
        )
    ),
]
COUNT, EVERY = 500, 251


def recorded(folder: str, variant: str | None, fmus: Path, count: int = COUNT) -> tuple[dict[str, bytes], list[str]]:
    """Bytes of the signals in the first base steps, and the messages; what only FMI 3.0 has is left out."""
    scenario, descriptions = prepare(SCENARIOS / folder, variant, fmus)
    scenario = replace(scenario, experiment=replace(scenario.experiment, count=count))
    take = Subject(scenario, descriptions).make_take()
    with Master(scenario, descriptions) as master:
        done = master.run(take.columns, take.seeds, values=take.values)
    assert not done.error and np.isfinite(done.data[: done.rows]).all()
    names = [str(port) for place, port in enumerate(ports(descriptions)) if place in take.columns]
    both = {name: k for k, name in enumerate(names) if not name.endswith((".smoothed_motion.count", "]"))}
    return {name: done.data[: done.rows, k].tobytes() for name, k in both.items()}, done.messages


@pytest.mark.parametrize(("folder", "variant"), CASES)
def test_scenario_has_the_bits_of_fmi_2(folder: str, variant: str | None) -> None:
    assert recorded(folder, variant, built() / "fmi3") == recorded(folder, variant, built())


def test_scenario_has_the_bits_of_the_python_fmus(fmus: Path) -> None:
    assert recorded("semera_valve", None, built() / "fmi3") == recorded("semera_valve", None, fmus)


def test_resumed_run_has_the_same_bits(tmp_path: Path) -> None:
    scenario, descriptions = prepare(SCENARIOS / "estimators", "other_physics", built() / "fmi3")
    scenario = replace(scenario, experiment=replace(scenario.experiment, count=COUNT))
    take = Subject(scenario, descriptions).make_take()
    file, base = tmp_path / "run.checkpoint", scenario.experiment.base_step
    with Master(scenario, descriptions) as master:
        kept = keeper(Checkpoint(file, EVERY * base), scenario, descriptions, take)
        whole = master.run(take.columns, take.seeds, values=take.values, keeper=kept)
    kept = keeper(Checkpoint(file, resume=True), scenario, descriptions, take)
    rows: list[int] = []
    resumed = record_apart(Plan(scenario, descriptions, take, kept), Listeners(lambda done, _: rows.append(done)))
    assert not whole.error and not resumed.error and whole.rows == resumed.rows
    assert whole.data[: whole.rows].tobytes() == resumed.data[: resumed.rows].tobytes()
    assert all(done == 0 or done >= EVERY for done in rows)


def test_wrong_parameters_are_told_before_the_run(tmp_path: Path) -> None:
    text = (
        "[experiment]\nduration = 1e-3\nbase_step = 1e-4\n\n[components.drive]\nfmu = 'DriveVoltage'\n"
        "set = { waveform = 'squre', 'pwm.low' = 40.0 }\n\n[inputs]\n'drive.enable' = 1.0\n'drive.reference' = 0.0\n"
    )
    (tmp_path / "scenario.toml").write_text(text)
    with pytest.raises(ScenarioError) as caught:
        prepare(tmp_path, None, built() / "fmi3")
    assert "`square`" in str(caught.value)
    (tmp_path / "scenario.toml").write_text(text.replace("squre", "square"))
    with pytest.raises(ScenarioError, match=r"less than `pwm\.high`"):
        prepare(tmp_path, None, built() / "fmi3")
