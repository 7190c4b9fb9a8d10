"""One FMU on recorded signals: at every sample its inputs are set, it steps, its outputs are read."""

from __future__ import annotations

import shutil
from array import array
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import numpy.typing as npt

from gapsense.cosim.check_values import value_problem
from gapsense.cosim.descriptions import describe
from gapsense.cosim.instance import Instance, temporary_folder
from gapsense.cosim.part import Layout, Part
from gapsense.cosim.scenario import Component, Port
from gapsense.cosim.signals import ports
from gapsense.files import naming
from gapsense.problems import ScenarioError
from gapsense.tables import Value

Vector = npt.NDArray[np.float64]


def feed(
    fmu: Path, name: str, values: Mapping[str, Value], start: float, step: float, inputs: Mapping[str, Vector]
) -> dict[str, Vector]:
    """Real outputs at each sample, by name; the first are those at the end of the initialisation.

    `name` is that of the instance in messages, `values` are parameters, `step` is the sampling period [s]. A sample of
    an input holds during the step that ends at it. Raises ScenarioError if the FMU has not these parameters or inputs,
    FmuError if it fails.
    """
    try:
        description = describe(fmu)
    except ValueError as error:
        raise ScenarioError([f"{fmu}: {error}. Build it with `gapsense build`."]) from error
    known = [v.name for v in description.of("input")]
    problems = [f"{name}: {p}" for n, v in values.items() if (p := value_problem(n, v, description))]
    problems += [f"{name}: no input `{n}`; it has {', '.join(known)}." for n in inputs if n not in known]
    if problems:
        raise ScenarioError(problems)
    layout = Layout(ports({name: description}))
    samples = np.column_stack(list(inputs.values()))
    with ExitStack() as stack:
        folder = temporary_folder()
        stack.callback(shutil.rmtree, folder, ignore_errors=True)
        with naming(folder):
            shutil.unpack_archive(fmu, folder, "zip")
        instance = Instance(name, description, folder)
        stack.callback(instance.close)
        instance.initialize(values, start, start + (len(samples) - 1) * step)
        buffer = array("d", [float(variable.start or 0.0) for variable in layout.variables.values()])
        part = Part(Component(name, fmu.stem), instance, buffer, layout)
        rows = run(part, [layout.index[Port(name, n)] for n in inputs], samples, start, step)
        instance.call("fmi2Terminate")
    return {port.variable: rows[:, j].copy() for j, port in enumerate(part.outputs)}


def run(part: Part, places: list[int], samples: Vector, start: float, step: float) -> Vector:
    """Outputs at each sample, whose values go to these places in the buffer."""
    take, advance, buffer = part.taker(), part.stepper(step, takes_inputs=False), np.frombuffer(part.buffer)
    rows = np.empty((len(samples), len(part.outputs)))

    def begin(_: float) -> str:
        part.instance.call("fmi2ExitInitializationMode")
        return part.read_outputs()

    for k, sample in enumerate(samples):
        buffer[places] = sample
        time = start + max(0, k - 1) * step
        failed = take() or (advance if k else begin)(time)
        if failed:
            raise part.failure(failed, time, k)
        rows[k] = part.values()
    return rows
