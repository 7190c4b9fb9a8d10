"""Components on emulated boards: the bits of the FMUs on every processor, and a valve that lands softly."""

from __future__ import annotations

import re
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from board import missing_tools
from host import ROOT
from loop import exported, written
from loop import missing as missing_here

from gapsense.cosim import FmuError, Master, Result, prepare, run, run_once
from gapsense.cosim.fmu import line

MISSING = [*missing_tools(), *missing_here()]
pytestmark = [pytest.mark.slow, pytest.mark.skipif(bool(MISSING), reason=f"{', '.join(MISSING)} not installed")]
PARTS = ("mhe", "controller")
MACHINES = {"cortex-m3": "mps2-an385", "cortex-m4": "mps2-an386", "cortex-m7": "mps2-an500"}
FINAL = "actuator.impact_speed"


def cycles(count: int, natives: Path, firmware: Path | None = None) -> Master:
    """So many cycles of the valve that nobody knows, by the model; Mhe and RunToRun with a firmware on one board."""
    scenario, descriptions = prepare(ROOT / "scenarios" / "run_to_run", "model", natives)
    base = scenario.experiment.base_step
    scenario = replace(
        scenario,
        metrics=(),
        experiment=replace(scenario.experiment, stop=20e-3 * count, count=round(20e-3 * count / base)),
    )
    if firmware:
        on = {"board": "qemu:mps2-an386", "firmware": firmware, "clock": 168e6}
        components = {n: replace(c, **on) if n in PARTS else c for n, c in scenario.components.items()}
        scenario = replace(scenario, components=components)
    return Master(scenario, descriptions)


def ran(*arguments: object) -> Result:
    with cycles(*arguments) as master:  # type: ignore[arg-type]
        return run_once(master)


@pytest.fixture(scope="module")
def firmware(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    return {real: exported(tmp_path_factory.mktemp(real), ["mhe", "run_to_run"], real) for real in ("double", "float")}


@pytest.mark.parametrize("cpu", MACHINES)
def test_all_processors_have_the_bits_of_the_fmus(cpu: str, natives: Path, tmp_path: Path) -> None:
    program = target(exported(tmp_path / "board", ["sensor", "semera"]), cpu)
    place = f'qemu:{MACHINES[cpu]}"\nfirmware = "{program}'
    there, here = run(written(tmp_path, place), fmus=natives), run(written(tmp_path), fmus=natives)
    assert all(there[name].tobytes() == here[name].tobytes() for name in here.signals)
    told = there.run.boards["semera"]
    mean, quantile, most = told["counts"]
    assert told["unit"] == "instructions" and 200.0 < mean < quantile <= most < 100_000.0
    assert 200 < told["stack"] < 10_000 and 5_000 < told["flash"] < 100_000 and told["memory"] < told["ram"] < 20_000


def target(folder: Path, cpu: str) -> Path:
    """The program for a processor."""
    file = folder / f"{cpu}.elf"
    done = subprocess.run(["make", "-C", str(folder), f"CPU={cpu}"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    return file


def test_a_part_without_room_for_a_stack_is_told_by_make(tmp_path: Path) -> None:
    folder = exported(tmp_path, ["semera"], "float")
    for size, words in (("8K", "no room for 4096 bytes of stack"), ("16K", "")):
        link = folder / "cortex_m" / "link.ld"
        link.write_text(re.sub(r"(RAM .*LENGTH =) \w+", rf"\1 {size}", link.read_text()))
        done = subprocess.run(["make", "-C", str(folder)], capture_output=True, text=True, check=False)
        assert (done.returncode != 0) == bool(words) and words in done.stderr


def test_a_valve_lands_softly_with_both_on_one_board(firmware: dict[str, Path], natives: Path) -> None:
    """20 cycles in float within 0.02 m/s of the FMUs; six in double, which is emulated, with their bits."""
    here = ran(20, natives)
    double = ran(6, natives, target(firmware["double"], "cortex-m4"))
    single = ran(20, natives, target(firmware["float"], "cortex-m4"))
    rows = double.times.size
    assert rows > 0.3 * here.times.size - 2 and double[FINAL].tobytes() == here[FINAL][:rows].tobytes()
    assert all(double[name].tobytes() == here[name][:rows].tobytes() for name in here.signals)
    last = {name: (r[FINAL][r.times < 0.38975][-1], r[FINAL][-1]) for name, r in (("here", here), ("float", single))}
    assert max(last["here"]) < 0.15  # 0.9 m/s in the first cycle
    assert np.abs(np.subtract(last["float"], last["here"])).max() < 0.02
    assert single.run.boards["mhe"]["difference"]["position"][0] < 1e-6


def test_qemu_that_ends_ends_the_run_with_all_rows(
    firmware: dict[str, Path], natives: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    started: list[subprocess.Popen[bytes]] = []

    def popen(*arguments: object, **more: object) -> subprocess.Popen[bytes]:
        started.append(subprocess.Popen(*arguments, **more))  # type: ignore[call-overload]
        return started[-1]

    monkeypatch.setattr(line, "subprocess", SubprocessWith(popen))
    master = cycles(1, natives, target(firmware["float"], "cortex-m4"))
    with master, pytest.raises(FmuError, match="is gone: QEMU ended with") as caught:
        run_once(master, progress=lambda done, _: started[0].kill() if done >= 500 else None)
    assert caught.value.instance in PARTS and caught.value.time is not None
    assert caught.value.result.times[-1] > 500 * 20e-6 - 1e-4


class SubprocessWith:
    """The module `subprocess` with another Popen."""

    def __init__(self, popen: object) -> None:
        self.Popen, self.DEVNULL = popen, subprocess.DEVNULL


def test_a_program_that_is_none_is_told_with_the_words_of_qemu(natives: Path, tmp_path: Path) -> None:
    (tmp_path / "no.elf").write_text("no program")
    with pytest.raises(FmuError, match=r"mhe: the board `qemu:mps2-an386` "):
        cycles(1, natives, tmp_path / "no.elf")
