"""Our components in loops that are iterated: the same bits of every kind of FMU, and no loop changes nothing."""

import platform
import re
import shutil
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gapsense.cosim import Checkpoint, Master, prepare, run, run_once
from gapsense.cosim.run.recording import Subject
from gapsense.page.page import refuse_unfit
from gapsense.problems import ScenarioError
from gapsense.vectors.engine import obstacle

ROOT = Path(__file__).resolve().parents[2]
VALVE = """
title = "A valve on a circuit"
[experiment]
stop = 1e-3
base_step = 20e-6
method = "iterative"
[components.circuit]
fmu = "Circuit.fmu"
[components.cable]
fmu = "Node.fmu"
set = { gain = 1.0, share = -30.0 }
[components.valve]
fmu = "SolenoidValve"
ISOLATION
[connect]
"cable.u" = "circuit.voltage_mean"
"valve.voltage" = "cable.y"
"circuit.current" = "valve.current"
[[connections]]
from = "valve.current"
to = "cable.v"
factor = 1.0
unit = "V"
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Folder with the FMUs of circuit and cable."""
    if shutil.which("gcc") is None or (sys.platform, platform.machine()) != ("linux", "x86_64"):
        pytest.skip("gcc on Linux on x86-64 compiles the FMUs")
    sys.path.insert(0, str(ROOT / "tests" / "cosim"))
    from coupled import coupled_fmus

    made = tmp_path_factory.mktemp("valve")
    coupled_fmus.build_one("Circuit", made)
    coupled_fmus.build_one("Node", made)
    return made


def test_valve_in_a_loop_gives_the_same_bits_as_every_kind_of_fmu(folder, fmus, natives):
    """Its voltage depends on its current at once, by the resistance of a cable, and over a capacitor."""
    results = []
    for kind in (fmus, natives):
        for isolation in ("", 'isolation = "process"'):
            (folder / "scenario.toml").write_text(VALVE.replace("ISOLATION", isolation))
            results.append(run(folder, fmus=kind))
    first = results[0]
    assert first["valve.current"].max() > 0.1 and first.run.loops["circuit, cable, valve"].most <= 6
    voltage = first["circuit.voltage_mean"] - 30.0 * first["valve.current"]
    assert abs(first["valve.voltage"] - voltage).max() < 1e-6
    for other in results[1:]:
        assert all(first[name].tobytes() == other[name].tobytes() for name in first.signals)
        assert first.run.loops == other.run.loops


def test_steps_are_controlled_where_edges_divide_them(tmp_path, natives):
    """With the edge recorded, which has no error; apart and resumed in the middle with the same bits."""
    path = shutil.copytree(ROOT / "scenarios" / "power_stage", tmp_path / "stage") / "scenario.toml"
    text = path.read_text().replace("stop = 20e-3", "stop = 2.4e-3").replace("[record]", "[record]\ndecimation = 20")
    text = re.sub(r"(?ms)^\[(baseline|metrics|variants).*?(?=^\[|\Z)", "", text).replace(
        '"stage.gate",', '"stage.edge",'
    )
    path.write_text(text)
    fixed = run(path, fmus=natives)
    path.write_text(text.replace("base_step", "step_control = 1e-3\nbase_step"))
    here, there = run(path, fmus=natives), run(path, fmus=natives, isolation="process")
    assert np.abs(here["valve.current"] - fixed["valve.current"]).max() < 2e-5
    assert here.run.steps.done < 60 and here.run.steps.beyond == 0 and here.run.steps.of != "stage.edge"
    checkpoint, halted = Checkpoint(tmp_path / "saved", 0.4e-3), []

    def halt(done, count):
        if done >= 70 and not halted:
            halted.append(done)
            raise KeyboardInterrupt

    assert run(path, fmus=natives, progress=halt, checkpoint=checkpoint).interrupted
    resumed = run(path, fmus=natives, checkpoint=replace(checkpoint, resume=True))
    for other in (there, resumed):
        assert all(here[name].tobytes() == other[name].tobytes() for name in here.signals)
        assert (here.run.steps, here.run.loops) == (other.run.steps, other.run.loops)


def test_delayed_connection_without_a_loop_gives_the_bits_of_gauss_seidel(fmus):
    scenario, descriptions = prepare(ROOT / "scenarios" / "run_to_run", "model", fmus)
    results = []
    for method in ("gauss-seidel", "iterative"):
        experiment = replace(scenario.experiment, count=500, method=method)
        with Master(replace(scenario, experiment=experiment, metrics=()), descriptions) as master:
            results.append(run_once(master))
    explicit, iterated = results
    assert explicit.run.delayed == iterated.run.delayed != () and not iterated.run.loops
    assert all(explicit[name].tobytes() == iterated[name].tobytes() for name in explicit.signals)


def test_what_cannot_iterate_says_so(fmus):
    scenario, descriptions = prepare(ROOT / "scenarios" / "semera_valve", None, fmus)
    subject = Subject(replace(scenario, experiment=replace(scenario.experiment, method="iterative")), descriptions)
    assert obstacle(subject) == "Its loops are iterated (`method`)."
    with pytest.raises(ScenarioError, match="its loops are iterated"):
        refuse_unfit(subject)
