"""Native FMUs of FMI 3.0 give the bits of the Python FMUs, in every host at hand."""

from __future__ import annotations

import subprocess
from pathlib import Path
from xml.etree import ElementTree

import fmpy
import numpy as np
import pytest
from native3 import FOLDERS, Instance, bits, built, fmu, placed, reference  # noqa: F401
from parts import Part
from unpacked_native import STRICT, compiled_host, expected, outputs, unpack


@pytest.fixture(params=FOLDERS, ids=lambda folder: folder.name)
def folder(request: pytest.FixtureRequest) -> Path:
    return Path(request.param)


def test_reproduces_its_reference_bit_for_bit(folder: Path) -> None:
    run = reference(folder)
    assert bits(Instance(fmu(folder)).run(run)) == bits(run.outputs)


def test_runs_again_after_a_reset_and_from_a_saved_state(folder: Path) -> None:
    run, one, two = reference(folder), Instance(fmu(folder)), Instance(fmu(folder), "two")
    one.run(run._replace(inputs=run.inputs[::-1]))
    one.slave.reset()
    half = len(run.inputs) // 2
    one.run(run._replace(inputs=run.inputs[:half]))
    state = one.slave.getFMUState()
    data = one.slave.serializeFMUState(state)
    straight = one.go_on(run, half)
    one.slave.setFMUState(state)
    two.slave.setFMUState(two.slave.deserializeFMUState(data))
    assert bits(straight) == bits(run.outputs[half:]) == bits(one.go_on(run, half)) == bits(two.go_on(run, half))
    one.slave.freeFMUState(state)
    one.slave.terminate()
    for instance in (one, two):
        instance.slave.freeInstance()


def test_simulation_by_fmpy_gives_what_it_gives_with_fmi_2(folder: Path) -> None:
    """Fmpy's steps are differences of times, so that rounding makes them a little other than in the reference."""
    run, component = reference(folder), fmu(folder).component
    names = [port.name for port in component.of("input")]
    rows = [(k * run.step, *row) for k, row in enumerate(run.inputs[1:])]
    given = {"input": np.array(rows, dtype=[(name, float) for name in ("time", *names)])}
    times = {"start_time": 0.0, "stop_time": run.step * len(rows), "output_interval": run.step}
    paths = (built() / "fmi3" / f"{component.name}.fmu", built() / f"{component.name}.fmu")
    three, two = (fmpy.simulate_fmu(str(path), **times, **given) for path in paths)
    for k, port in enumerate(component.of("output")):
        assert three[port.name].tobytes() == two[port.name].tobytes()
        expected = [row[k] for row in run.outputs]
        assert three[port.name] == pytest.approx(expected, rel=1e-9, abs=1e-9 * port.nominal)


@pytest.fixture(scope="module")
def host(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The host of host3.c."""
    return compiled_host(("cc",), tmp_path_factory.mktemp("host") / "host3", source="host3.c")


@pytest.mark.slow
def test_sources_compile_as_a_stranger_compiles_them(host: Path, tmp_path: Path) -> None:
    folder = next(folder for folder in FOLDERS if folder.name == "drive_voltage")
    part = Part(folder, fmu(folder).component, fmu(folder).path)
    unpacked = unpack(part.path, tmp_path)
    root = ElementTree.parse(unpacked.folder / "sources" / "buildDescription.xml").getroot()
    files = [file.attrib["name"] for file in root.iter("SourceFile")]
    command = ["cc", *STRICT, "-O1", "-shared", "-fPIC", *files, "-o", str(unpacked.library()), "-lm"]
    done = subprocess.run(command, cwd=unpacked.folder / "sources", capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert bits(outputs([host], unpacked, part)) == bits(expected(part))


def test_host_in_c_reads_the_reference(folder: Path, host: Path, tmp_path: Path) -> None:
    part = Part(folder, fmu(folder).component, fmu(folder).path)
    assert bits(outputs([host], unpack(part.path, tmp_path), part)) == bits(expected(part))
