"""One FMU on recorded signals: at every sample its inputs are set, it steps, its outputs are read."""

from __future__ import annotations

import ctypes
import shutil
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import numpy.typing as npt

from gapsense.cosim.check_values import value_problem
from gapsense.cosim.descriptions import describe
from gapsense.cosim.instance import WARNING, Instance, temporary_folder
from gapsense.problems import ScenarioError
from gapsense.tables import Value

Vector = npt.NDArray[np.float64]


def feed(
    fmu: Path, name: str, values: Mapping[str, Value], start: float, step: float, inputs: Mapping[str, Vector]
) -> dict[str, Vector]:
    """Real outputs at each sample, by name; the first are those at the end of the initialisation.

    Parameters
    ----------
    fmu : Path
        FMU file.
    name : str
        Name of the instance, for messages.
    values : mapping
        Parameters.
    start, step : float
        Time of the first sample, and sampling period [s].
    inputs : mapping
        Samples of the Real inputs, (n,) arrays; each holds during the step that ends at the sample.

    Raises
    ------
    ScenarioError
        If the FMU has not these parameters or inputs.
    FmuError
        If it fails.
    """
    try:
        description = describe(fmu)
    except ValueError as error:
        raise ScenarioError([f"{fmu}: {error}. Build it with `gapsense build`."]) from error
    known = [v.name for v in description.inputs]
    problems = [f"{name}: {p}" for n, v in values.items() if (p := value_problem(n, v, description))]
    problems += [f"{name}: no input `{n}`; it has {', '.join(known)}." for n in inputs if n not in known]
    if problems:
        raise ScenarioError(problems)
    folder = temporary_folder()
    try:
        shutil.unpack_archive(fmu, folder, "zip")
        instance = Instance(name, description, folder)
        try:
            return _run(instance, values, start, step, inputs)
        finally:
            instance.close()
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _run(
    instance: Instance, values: Mapping[str, Value], start: float, step: float, inputs: Mapping[str, Vector]
) -> dict[str, Vector]:
    variables, outputs = instance.description.variables, [v for v in instance.description.outputs if v.type == "Real"]
    given = _references([variables[n].reference for n in inputs])
    got = _references([v.reference for v in outputs])
    samples = np.ascontiguousarray(np.column_stack(list(inputs.values())), dtype=float)
    read = np.empty((len(samples), len(outputs)))
    instance.initialize(values, start, start + (len(samples) - 1) * step)
    for k in range(len(samples)):
        _checked(instance, "fmi2SetReal", k, start + k * step, *given, _pointer(samples[k]))
        if k:
            times = ctypes.c_double(start + (k - 1) * step), ctypes.c_double(step)
            _checked(instance, "fmi2DoStep", k, times[0].value, *times, ctypes.c_int(1))
        else:
            instance.call("fmi2ExitInitializationMode")
        _checked(instance, "fmi2GetReal", k, start + k * step, *got, _pointer(read[k]))
    instance.call("fmi2Terminate")
    return {v.name: read[:, j].copy() for j, v in enumerate(outputs)}


def _references(numbers: list[int]) -> tuple[object, object]:
    return (ctypes.c_uint * len(numbers))(*numbers), ctypes.c_size_t(len(numbers))


def _pointer(row: Vector) -> object:
    return row.ctypes.data_as(ctypes.POINTER(ctypes.c_double))


def _checked(instance: Instance, function: str, index: int, time: float, *arguments: object) -> None:
    status = instance.function(function)(instance.pointer, *arguments)
    if status > WARNING:
        raise instance.failure(function, status, time, index)
