"""A plain host for the contract tests: fmpy's functions, all messages kept.  For fresh processes only (drivers.py)."""

from __future__ import annotations

import random
import sys
import tempfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from ctypes import byref
from pathlib import Path
from typing import Any

import fmpy
from drivers import communication_step
from fmpy.fmi2 import (
    FMU2Slave,
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
)
from fmpy.logging import addLoggerProxy
from fmpy.simulation import FMICallException

NUMPY = sys.modules["numpy"]  # of fmpy; hidden while FMUs run
HELD = 0.8  # probability that an input keeps its value for one more step

LOG: list[tuple[str, int, str, str]] = []  # instance, status, category, text


def _keep(_: Any, instance: bytes, status: int, category: bytes, text: bytes) -> None:
    LOG.append((instance.decode(), status, (category or b"").decode(), text.decode()))


CALLBACKS = fmi2CallbackFunctions()
CALLBACKS.logger = fmi2CallbackLoggerTYPE(_keep)
CALLBACKS.allocateMemory = fmi2CallbackAllocateMemoryTYPE(fmpy.calloc)
CALLBACKS.freeMemory = fmi2CallbackFreeMemoryTYPE(fmpy.free)
addLoggerProxy(byref(CALLBACKS))  # formats the text, as a host in C does


class Fmu:
    """An extracted FMU and what its model description says."""

    def __init__(self, path: str | Path, folder: str | Path | None = None) -> None:
        self.folder = str(folder or tempfile.mkdtemp(prefix="fmu-"))
        fmpy.extract(str(path), self.folder)
        sys.modules["numpy"] = NUMPY
        self.description = fmpy.read_model_description(self.folder, validate=False)
        sys.modules["numpy"] = None  # type: ignore[assignment]  # importing it raises ImportError
        self.variables = {v.name: v for v in self.description.modelVariables}
        experiment = self.description.defaultExperiment
        self.step = communication_step(float(experiment.stepSize), float(experiment.stopTime))

    def of(self, causality: str) -> list[Any]:
        return [v for v in self.description.modelVariables if v.causality == causality]

    def starts(self) -> dict[str, Any]:
        """Start values of the model description."""
        return {name: typed(v, v.start) for name, v in self.variables.items() if v.start is not None}

    def stimulus(self, steps: int, seed: int = 0, held: float = HELD) -> list[list[float]]:
        """Inputs at the start and for each step: random, within their range or plus and minus their nominal value."""
        rng = random.Random(f"{self.description.modelName} {seed}")
        row = [float(v.start) for v in self.of("input")]
        rows = []
        for _ in range(steps + 1):
            row = [old if rng.random() < held else _draw(v, rng) for v, old in zip(self.of("input"), row)]
            rows.append(row)
        return rows


def _draw(variable: Any, rng: random.Random) -> float:
    nominal = float(variable.nominal or 1.0)
    low, high = (float(v) if v else w for v, w in ((variable.min, -nominal), (variable.max, nominal)))
    return rng.uniform(min(low, high), max(low, high))


def typed(variable: Any, text: str) -> Any:
    """Value of an attribute of the model description."""
    convert: dict[str, Callable[[str], Any]] = {"Real": float, "Integer": int, "Boolean": lambda t: t == "true"}
    return convert.get(variable.type, str)(text)


class Instance:
    """One instance; `life` brings it to the end of initialisation."""

    def __init__(self, fmu: Fmu, name: str = "one") -> None:
        self.fmu = fmu
        self.slave = FMU2Slave(
            guid=fmu.description.guid,
            unzipDirectory=fmu.folder,
            modelIdentifier=fmu.description.coSimulation.modelIdentifier,
            instanceName=name,
        )
        self.slave.instantiate(callbacks=CALLBACKS, loggingOn=True)
        self.inputs = [v.valueReference for v in fmu.of("input")]
        self.outputs = [v.valueReference for v in fmu.of("output")]

    def set(self, values: Mapping[str, Any]) -> None:
        """Set variables by name."""
        for name, value in values.items():
            variable = self.fmu.variables[name]
            getattr(self.slave, f"set{variable.type}")([variable.valueReference], [value])

    def get(self, names: Iterable[str]) -> dict[str, Any]:
        """Values of variables by name."""
        return {name: self._get(self.fmu.variables[name]) for name in names}

    def _get(self, variable: Any) -> Any:
        value = getattr(self.slave, f"get{variable.type}")([variable.valueReference])[0]
        return value.decode() if isinstance(value, bytes) else bool(value) if variable.type == "Boolean" else value

    def start(
        self, inputs: Sequence[float] = (), parameters: Mapping[str, Any] | None = None, time: float = 0.0
    ) -> list[float]:
        """Initialise; the outputs."""
        self.set(parameters or {})
        self.slave.setupExperiment(startTime=time)
        self.slave.enterInitializationMode()
        self.slave.setReal(self.inputs[: len(inputs)], inputs)
        self.slave.exitInitializationMode()
        return self.slave.getReal(self.outputs)

    def step(self, inputs: Sequence[float], time: float, step: float) -> list[float]:
        """One communication step from `time` on; the outputs."""
        self.slave.setReal(self.inputs, inputs)
        self.slave.doStep(time, step)
        return self.slave.getReal(self.outputs)

    def run(self, rows: list[list[float]], parameters: Mapping[str, Any] | None = None) -> list[list[float]]:
        """Outputs at the start and after each step."""
        return [self.start(rows[0], parameters), *self.go_on(rows, 1)]

    def go_on(self, rows: list[list[float]], first: int) -> list[list[float]]:
        """Outputs after step `first` and all later ones."""
        h = self.fmu.step
        return [self.step(rows[k], (k - 1) * h, h) for k in range(first, len(rows))]

    def free(self) -> None:
        self.slave.freeInstance()


def attempt(call: Callable[..., Any], *arguments: Any) -> dict[str, Any]:
    """Status of a call, and what was logged during it."""
    LOG.clear()
    try:
        call(*arguments)
        status = 0
    except FMICallException as error:
        status = error.status
    return {"status": status, "log": list(LOG)}
