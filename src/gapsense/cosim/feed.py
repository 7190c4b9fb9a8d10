"""One FMU on recorded signals: at every sample its inputs are set, it steps, its outputs are read."""

from __future__ import annotations

import shutil
from array import array
from collections.abc import Mapping
from contextlib import ExitStack

import numpy as np
import numpy.typing as npt

from gapsense.cosim.check_values import value_problem
from gapsense.cosim.descriptions import Description
from gapsense.cosim.instance import Instance, temporary_folder
from gapsense.cosim.part import Layout, Part
from gapsense.cosim.scenario import Component
from gapsense.cosim.signals import ports
from gapsense.problems import ScenarioError
from gapsense.tables import Value

Vector = npt.NDArray[np.float64]


def feed(
    description: Description, values: Mapping[str, Value], start: float, step: float, inputs: Mapping[str, Vector]
) -> dict[str, Vector]:
    """Real outputs at each sample, by name; the first are those at the end of the initialisation.

    Parameters
    ----------
    description : Description
        Of the FMU.
    values : mapping
        Parameters.
    start, step : float
        Time of the first sample, and sampling period [s].
    inputs : mapping
        Samples of all Real inputs, (n,) arrays; each holds during the step that ends at the sample.

    Raises
    ------
    ScenarioError
        If the FMU does not take these parameters.
    FmuError
        If it fails.
    """
    name = description.path.stem
    problems = [f"{name}: {p}" for n, v in values.items() if (p := value_problem(n, v, description))]
    if problems:
        raise ScenarioError(problems)
    layout = Layout(ports({name: description}))
    samples = np.column_stack([inputs[port.variable] for port in layout.of(name, "input")])
    with ExitStack() as stack:
        folder = temporary_folder()
        stack.callback(shutil.rmtree, folder, ignore_errors=True)
        shutil.unpack_archive(description.path, folder, "zip")
        instance = Instance(name, description, folder)
        stack.callback(instance.close)
        instance.initialize(values, start, start + (len(samples) - 1) * step)
        part = Part(Component(name, name), instance, array("d", [0.0]) * len(layout.variables), layout)
        rows = run(part, samples, start, step)
        instance.call("fmi2Terminate")
    return {port.variable: rows[:, j].copy() for j, port in enumerate(part.outputs)}


def run(part: Part, samples: Vector, start: float, step: float) -> Vector:
    """Outputs at each sample; the buffer has the inputs first."""
    take, advance, inputs = part.taker(), part.stepper(step, takes_inputs=False), np.frombuffer(part.buffer)
    rows = np.empty((len(samples), len(part.outputs)))

    def begin(_: float) -> str:
        part.instance.call("fmi2ExitInitializationMode")
        return part.read_outputs()

    for k, sample in enumerate(samples):
        inputs[: sample.size] = sample
        time = start + (k - 1) * step
        failed = take() or (advance if k else begin)(time)
        if failed:
            raise part.failure(failed, time, k)
        rows[k] = part.values()
    return rows
