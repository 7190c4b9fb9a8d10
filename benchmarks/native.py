"""What set, step and get take together: native FMU and Python FMU of every component, from C and through FMPy's calls.

python benchmarks/native.py [NAME ...]    after `python build_fmus.py` and `python build_fmus.py --native`

Microseconds per step of the component's own step size, the median of five, every one in a process of its own. Without
names also what a component-step takes in a whole run, on native FMUs: in our runner, which records, and in a loop in C.
"""

from __future__ import annotations

import csv
import json
import subprocess
import sys
import tempfile
import zipfile
from ctypes import byref, c_double, c_int, c_size_t, c_uint, c_void_p, sizeof
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import Any
from xml.etree import ElementTree

from gapsense.fmi.components import COMPONENTS, find_components, load_component
from gapsense.fmi.ports import Component
from gapsense.fmi.shim.build import headers

ROOT = Path(__file__).resolve().parents[1]
MEASURE = ROOT / "benchmarks" / "measure.py"
HOST = ROOT / "tests" / "native" / "host.c"
KINDS = {"native": ROOT / "build" / "native", "Python": ROOT / "build" / "fmus"}
ROUNDS, STEPS = 5, 20_000
ROWS = 41
RUNS = {"gapsense": "our runner, all signals recorded", "own_time": "loop in C, raw calls only"}  # in measure.py


def main(names: list[str]) -> None:
    """Print the table."""
    columns = [f"{kind} from {caller}" for caller in ("C", "FMPy") for kind in KINDS]
    print(f"{'us per step':20}" + "".join(f"{column:>18}" for column in columns))
    for folder in find_components(COMPONENTS, names):
        component = load_component(folder)
        with tempfile.TemporaryDirectory() as work:
            values = [
                measured(caller, kind, component, folder, Path(work)) for caller in (from_c, apart) for kind in KINDS
            ]
        print(f"{component.name:20}" + "".join(f"{value:18.3f}" for value in values), flush=True)


def show_runs() -> None:
    """Print what a component-step takes in the experiment of runner.py."""
    found: dict[str, list[float]] = {run: [] for run in RUNS}
    for _ in range(ROUNDS):
        for run, taken in found.items():  # in turn, as the load of the machine changes
            words = [sys.executable, str(MEASURE), run, str(KINDS["native"])]
            said = subprocess.run(words, capture_output=True, text=True, check=True, cwd=MEASURE.parent).stdout
            taken.append(json.loads(said.splitlines()[-1])["microseconds"])
    print("\nus per component-step of semera_valve on native FMUs (best)")
    for run, taken in found.items():
        print(f"{RUNS[run]:40}{median(taken):8.3f}{f'({min(taken):.3f})':>10}")


def measured(caller: object, kind: str, component: Component, folder: Path, work: Path) -> float:
    """Median of several rounds."""
    unpacked = work / kind
    with zipfile.ZipFile(KINDS[kind] / f"{component.name}.fmu") as archive:
        archive.extractall(unpacked)
    table = write_table(component, folder, work / "table.csv")
    return median(caller(component, unpacked, table) for _ in range(ROUNDS))  # type: ignore[operator]


def write_table(component: Component, folder: Path, to: Path) -> Path:
    """The inputs of the reference run, in steps of the component's own size."""
    count = len(component.of("input"))
    with (folder / "reference.csv").open(newline="", encoding="utf-8") as file:
        rows = [row[1 : 1 + count] for row in list(csv.reader(file))[1 : 1 + ROWS]]
    lines = [",".join([repr(k * component.step_size), *row]) for k, row in enumerate(rows)]
    to.write_text("\n".join(["time", *lines]) + "\n", encoding="utf-8")
    return to


def from_c(component: Component, unpacked: Path, table: Path) -> float:
    """With the plain host."""
    host = table.with_name("host")
    if not host.is_file():
        command = ["cc", "-std=c99", "-O2", f"-I{headers()}", str(HOST), "-o", str(host), "-ldl"]
        subprocess.run(command, check=True)
    library = unpacked / "binaries" / "linux64" / f"{component.name}.so"
    guid = ElementTree.parse(unpacked / "modelDescription.xml").getroot().attrib["guid"]
    counts = [str(len(component.of(causality))) for causality in ("input", "output")]
    words = [str(library), guid, (unpacked / "resources").as_uri(), str(table), *counts, str(STEPS // (ROWS - 1))]
    return float(subprocess.run([str(host), *words], capture_output=True, text=True, check=True).stdout)


def apart(component: Component, unpacked: Path, table: Path) -> float:
    """With FMPy, in another process."""
    words = [sys.executable, __file__, "--through-fmpy", component.name, str(unpacked), str(table)]
    return float(json.loads(subprocess.run(words, capture_output=True, text=True, check=True).stdout))


def through_fmpy(name: str, unpacked: Path, table: Path) -> float:
    """FMPy's raw functions, with all arguments made beforehand."""
    import fmpy
    from fmpy.fmi2 import FMU2Slave

    description = fmpy.read_model_description(str(unpacked), validate=False)
    counts = [sum(v.causality == causality for v in description.modelVariables) for causality in ("input", "output")]
    slave = FMU2Slave(guid=description.guid, unzipDirectory=str(unpacked), modelIdentifier=name, instanceName="one")
    slave.instantiate()
    slave.setupExperiment(startTime=0.0)
    slave.enterInitializationMode()
    slave.exitInitializationMode()
    with table.open(newline="", encoding="utf-8") as file:
        rows = [[float(value) for value in row] for row in list(csv.reader(file))[1:]]
    references = (c_uint * sum(counts))(*range(sum(counts)))
    given, got = byref(references), byref(references, counts[0] * sizeof(c_uint))
    inputs, outputs = [byref((c_double * counts[0])(*row[1:])) for row in rows], byref((c_double * counts[1])())
    many, few = map(c_size_t, counts)
    time, step, width = c_double(), rows[1][0], c_double(rows[1][0])
    set_, go, get = (raw(slave, call) for call in ("fmi2SetReal", "fmi2DoStep", "fmi2GetReal"))
    c = c_void_p(slave.component)
    begin = perf_counter()
    for k in range(STEPS):
        time.value = k * step
        set_(c, given, many, inputs[k % ROWS])
        go(c, time, width, 1)
        get(c, got, few, outputs)
    return 1e6 * (perf_counter() - begin) / STEPS


def raw(slave: Any, call: str) -> Any:
    """A function of the FMU that takes values of C as they are: converting others takes longer than the call."""
    function = getattr(slave.dll, call)
    function.argtypes, function.restype = None, c_int
    return function


if __name__ == "__main__":
    if sys.argv[1:2] == ["--through-fmpy"]:
        print(json.dumps(through_fmpy(sys.argv[2], Path(sys.argv[3]), Path(sys.argv[4]))))
    else:
        main(sys.argv[1:])
        if not sys.argv[1:]:
            show_runs()
