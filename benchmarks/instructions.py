"""Instructions of a step in native FMUs, counted by Valgrind: a number that a busy machine does not change.

python benchmarks/instructions.py [NAME ...]    after `python build_fmus.py --native`; NAME is a row's component

Each FMU by itself in `tests/native/host.c`, with the parameters of a scenario and the inputs that it had in that: mean
over all of its steps, `fmi2DoStep` alone.  Nothing without Valgrind.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

from actuator_steps import recorded
from experiment import ROOT
from native import HOST

from gapsense.cosim.scenario.records import Port, ports
from gapsense.fmi.components import load_component, own
from gapsense.fmi.native.package import build
from gapsense.fmi.native.platforms import here
from gapsense.fmi.shim.build import headers

NATIVE = ROOT / "build" / "native"
CALLGRIND = ("valgrind", "--tool=callgrind", "--callgrind-out-file=/dev/null", "--toggle-collect=fmi2DoStep")
COLLECTED = re.compile(r"Collected : (\d+)")


class Row(NamedTuple):
    """A component of a scenario."""

    component: str
    fmu: str
    folder: Path
    mode: Port
    variant: str | None = None


LOOP, CHAIN = ROOT / "scenarios" / "run_to_run", ROOT / "benchmarks" / "actuator"
OF_LOOP, OF_CHAIN = Port("actuator", "mode"), Port("plant", "mode")
ROWS = {
    "RunToRun, contact": Row("controller", "RunToRun", LOOP, OF_LOOP),
    "RunToRun, model": Row("controller", "RunToRun", LOOP, OF_LOOP, "model"),
    "Mhe in that loop": Row("mhe", "Mhe", LOOP, OF_LOOP, "model"),
    "Ekf": Row("ekf", "Ekf", CHAIN, OF_CHAIN),
    "Ertss": Row("ertss", "Ertss", CHAIN, OF_CHAIN),
    "ReluctanceActuator": Row("plant", "ReluctanceActuator", CHAIN, OF_CHAIN),
    "Semera": Row("semera", "Semera", ROOT / "scenarios" / "semera_valve", Port("valve", "mode")),
}


def main(names: list[str]) -> int:
    """Print the table."""
    if not shutil.which("valgrind"):
        print("valgrind not found: nothing was counted. Install it.")
        return 0
    print(f"{'instructions of a step':24}{'mean':>10}")
    for title, row in ROWS.items():
        if not names or row.fmu in names:
            with tempfile.TemporaryDirectory() as work:
                print(f"{title:24}{counted(row, Path(work)):10,.0f}", flush=True)
    return 0


def counted(row: Row, work: Path) -> float:
    """Instructions of a step, on the inputs of a run."""
    run = recorded(row.folder, NATIVE, row.mode, (2.0,), row.variant)
    scenario, descriptions = run.experiment
    component, folder = scenario.components[row.component], own(row.fmu)
    inputs, outputs = (load_component(folder).of(causality) for causality in ("input", "output"))
    every = [*ports(descriptions)]
    rows = run.rows[:: component.step, [every.index(Port(row.component, port.name)) for port in inputs]]
    step = scenario.experiment.base_step * component.step
    lines = [",".join(map(repr, (k * step, *values))) for k, values in enumerate(rows.tolist())]
    (work / "table.csv").write_text("\n".join(["time", *lines, ""]), encoding="utf-8")
    for _ in build([folder], work, [here()], {folder: component.values}):
        pass
    with zipfile.ZipFile(work / f"{row.fmu}.fmu") as archive:
        archive.extractall(work)
    flags = ["-std=c99", "-O2", f"-I{headers()}"]
    subprocess.run(["cc", *flags, str(HOST), "-o", str(work / "host"), "-ldl"], check=True)
    guid = ElementTree.parse(work / "modelDescription.xml").getroot().attrib["guid"]
    library = next((work / "binaries").rglob(f"{row.fmu}.*"))
    counts = (str(len(inputs)), str(len(outputs)))
    words = [work / "host", library, guid, (work / "resources").as_uri(), work / "table.csv", *counts, "1"]
    done = subprocess.run([*CALLGRIND, *map(str, words)], capture_output=True, text=True, check=True, cwd=work)
    return int(COLLECTED.findall(done.stderr)[0]) / (len(rows) - 1)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
