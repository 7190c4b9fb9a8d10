"""FMUs of FMI 3.0 for the tests, and a plain host of them: fmpy's functions, all messages kept."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import fmpy
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.fmi3 import FMU3Slave

from gapsense.fmi.components import find_components, load_component
from gapsense.fmi.ports import Component

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = find_components(ROOT / "fmus")
ERROR = 3


PLACE: list[Path] = []


@pytest.fixture(scope="session", autouse=True)
def placed(natives: Path) -> None:
    """Lets the functions below find the FMUs; to be imported by every module that uses them."""
    PLACE[:] = [natives]


def built() -> Path:
    """Folder with the native FMUs of all components for this machine; those of FMI 3.0 are in `fmi3`."""
    return PLACE[0]


class Reference(NamedTuple):
    """The run in a component's reference.csv."""

    step: float
    inputs: list[list[float]]
    outputs: list[list[float]]


def reference(folder: Path) -> Reference:
    with (folder / "reference.csv").open(newline="", encoding="utf-8") as file:
        _, *rows = csv.reader(file)
    table, cut = [[float(cell) for cell in row] for row in rows], 1 + len(load_component(folder).of("input"))
    return Reference(table[1][0], [row[1:cut] for row in table], [row[cut:] for row in table])


class Fmu:
    """An extracted FMU."""

    def __init__(self, folder: Path, place: Path | None = None) -> None:
        self.component: Component = load_component(folder)
        self.path = (place or built()) / "fmi3" / f"{self.component.name}.fmu"
        self.folder = Path(fmpy.extract(str(self.path)))
        self.description = fmpy.read_model_description(str(self.folder))
        self.variables = {v.name: v for v in self.description.modelVariables}

    def references(self, causality: str) -> list[int]:
        """Value references of the ports of a causality."""
        return [self.variables[port.name].valueReference for port in self.component.of(causality)]

    def __getitem__(self, name: str) -> int:
        return int(self.variables[name].valueReference)


@cache
def fmu(folder: Path) -> Fmu:
    return Fmu(folder)


class Instance:
    """One instance, with the messages that it gave."""

    def __init__(self, fmu: Fmu, name: str = "one", logging: bool = True) -> None:
        self.fmu, self.log = fmu, []  # type: ignore[var-annotated]
        self.slave = FMU3Slave(
            guid=fmu.description.guid,
            unzipDirectory=str(fmu.folder),
            modelIdentifier=fmu.description.coSimulation.modelIdentifier,
            instanceName=name,
        )
        self.slave.instantiate(loggingOn=logging, logMessage=self._keep)
        self.inputs, self.outputs = fmu.references("input"), fmu.references("output")

    def _keep(self, _: Any, status: int, category: bytes, text: bytes) -> None:
        self.log.append((status, category.decode(), text.decode()))

    def set(self, values: Mapping[str, Any]) -> None:
        """Set variables by name: numbers, texts, truth values, or lists for arrays."""
        for name, value in values.items():
            kind = self.fmu.variables[name].type.replace("Enumeration", "Int64")
            getattr(self.slave, f"set{kind}")([self.fmu[name]], value if isinstance(value, list) else [value])

    def get(self, name: str, count: int = 1) -> Any:
        """Value of a variable, or the list of values of an array."""
        kind = self.fmu.variables[name].type.replace("Enumeration", "Int64")
        values = getattr(self.slave, f"get{kind}")([self.fmu[name]], count)
        return values[0] if count == 1 else values

    def start(self, inputs: Sequence[float] = (), time: float = 0.0) -> list[float]:
        """Initialise; the outputs."""
        self.slave.enterInitializationMode(startTime=time)
        if inputs:
            self.slave.setFloat64(self.inputs, inputs)
        self.slave.exitInitializationMode()
        return list(self.slave.getFloat64(self.outputs))

    def step(self, inputs: Sequence[float], time: float, step: float) -> list[float]:
        """One step from `time` on; the outputs."""
        self.slave.setFloat64(self.inputs, inputs)
        self.slave.doStep(time, step)
        return list(self.slave.getFloat64(self.outputs))

    def run(self, run: Reference) -> list[list[float]]:
        """Outputs at the start and after each step."""
        return [self.start(run.inputs[0]), *self.go_on(run, 1)]

    def go_on(self, run: Reference, first: int) -> list[list[float]]:
        """Outputs after step `first` and all later ones."""
        return [self.step(run.inputs[k], (k - 1) * run.step, run.step) for k in range(first, len(run.inputs))]

    def refused(self, function: str, *arguments: Any) -> str:
        """The one message with which a call is refused."""
        before = len(self.log)
        with pytest.raises(FMICallException) as caught:
            getattr(self.slave, function)(*arguments)
        assert caught.value.status == ERROR
        ((status, category, text),) = self.log[before:]
        assert (status, category) == (ERROR, "logStatusError")
        return str(text)


def bits(rows: list[list[float]]) -> list[list[str]]:
    return [[value.hex() for value in row] for row in rows]
