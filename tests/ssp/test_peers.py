"""Other tools run the packages, with results that agree with ours for the same coupling."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Collection
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import peers
import pytest
from packages import SCENARIO

from gapsense.cosim import Result, run
from gapsense.cosim.scenario.read import Document, read_document
from gapsense.shipped import SCENARIOS
from gapsense.ssp.export import export


def in_step(name: str, variant: str | None, steps: int, kept: Collection[str] = ()) -> Document:
    """A scenario for so many base steps with jacobi, in which all components step together but for what is kept."""
    file = SCENARIOS / name / "scenario.toml"
    data = dict(read_document(file, []).with_variant(variant, []).data)
    for key in ("variants", "baseline", "metrics", "record", "sweep"):
        data.pop(key, None)
    given = data["experiment"]
    stop = given.get("start", 0.0) + steps * given["base_step"]
    components = {
        part: {key: value for key, value in own.items() if key not in {"step", "offset"} - set(kept)}
        for part, own in data["components"].items()
    }
    return Document(file, {**data, "experiment": {**given, "stop": stop, "method": "jacobi"}, "components": components})


def both(document: Document, fmus: Path, package: Path) -> Result:
    """Our result; the package is written too."""
    export(document, package, None, fmus)
    return run(document, None, fmus)


def outputs(result: Result) -> list[str]:
    return [name for name, signal in result.about.items() if signal.causality == "output"]


def differences(result: Result, other: dict) -> dict[str, float]:
    """Greatest difference of each output in terms of its range, after the first step."""
    names = [name for name in outputs(result) if name in other]
    spans = {name: max(float(np.ptp(result[name])), 1e-9) for name in names}
    return {name: float(np.abs(other[name] - result[name][1:])[1:].max()) / spans[name] for name in names}


def libcosim(package: Path, names: list[str], steps: int) -> dict:
    if find_spec("libcosimpy") is None:
        pytest.skip("libcosimpy is not installed")
    out = package.with_suffix(".json")
    command = [sys.executable, peers.__file__, str(package), json.dumps(names), str(steps), str(out)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert out.is_file(), done.stderr[-2000:]
    return {name: np.array(values) for name, values in json.loads(out.read_text()).items()}


def test_fmpy_runs_a_chain_and_differs_only_by_its_first_inputs(stock, tmp_path):
    folder = tmp_path / "chain"
    folder.mkdir()
    (folder / "scenario.toml").write_text(SCENARIO)
    result = both(folder, stock, tmp_path / "a.ssp")
    found = peers.in_fmpy(tmp_path / "a.ssp", 0.0, 10, 0.1)
    assert len(found["time"]) == 10
    assert np.allclose(found["source.y"], result["source.y"][1:], rtol=1e-15)
    lag = [0.0]  # its inputs are 0 in the first step, and later the outputs of the step before
    for u in [0.0, *found["source.y"][:-1]]:
        lag.append(lag[-1] + 0.1 / 0.5 * (u - lag[-1]))
    assert np.allclose(found["lag.y"], lag[1:], rtol=1e-14)
    started = [result["lag.y"][0]]
    for u in result["source.y"][:-1]:
        started.append(started[-1] + 0.1 / 0.5 * (u - started[-1]))
    assert np.allclose(result["lag.y"], started, rtol=1e-14)


@pytest.mark.slow
def test_fmpy_runs_the_valve_with_the_same_bits_after_the_first_samples(fmus, tmp_path):
    result = both(in_step("semera_valve", None, 1600), fmus, tmp_path / "a.ssp")
    found = peers.in_fmpy(tmp_path / "a.ssp", -1.05e-3, 1600, 25e-6)
    names = [name for name in outputs(result) if not name.endswith("published_time")]  # which is a sum of times
    assert len(names) > 40
    assert [name for name in names if not np.array_equal(found[name][3:], result[name][4:])] == []
    differing = {name for name in names if not np.array_equal(found[name][:3], result[name][1:4])}
    assert {name.partition(".")[0] for name in differing} == {"semera", "sensor"}  # the first inputs are 0


@pytest.mark.slow
def test_fmpy_runs_what_it_cannot_set_with_the_lines_of_the_page(fmus, tmp_path):
    result = both(in_step("pot_magnet", None, 1000), fmus, tmp_path / "a.ssp")
    found = peers.in_fmpy(tmp_path / "a.ssp", result.run.start, 1000, result.base_step, repaired=True)
    shares = differences(result, found)
    assert {name: share for name, share in shares.items() if name.startswith(("drive.", "magnet.")) and share} == {}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "steps", "kept"),
    [("semera_valve", 1600, ()), ("semera_valve", 1600, ("step",)), ("pot_magnet", 2000, ()), ("run_to_run", 500, ())],
)
def test_libcosim_runs_it_up_to_the_rounding_of_its_time(fmus, tmp_path, name, steps, kept):
    result = both(in_step(name, None, steps, kept), fmus, tmp_path / "a.ssp")
    found = differences(result, libcosim(tmp_path / "a.ssp", outputs(result), steps))
    assert len(found) > 40 and max(found.values()) < 1e-10, sorted(found.items(), key=lambda item: -item[1])[:5]
