"""One FMU on recorded signals: at every sample its inputs are set, it steps, its outputs are read."""

from __future__ import annotations

from array import array
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path

import numpy as np

from gapsense.cosim.check import value_problem
from gapsense.cosim.fmu.descriptions import describe
from gapsense.cosim.fmu.instance import instance_of, unpack_fmu
from gapsense.cosim.run.loop.compiled import advancer
from gapsense.cosim.run.part import Layout, Part, Player, Work
from gapsense.cosim.run.recording import Recording, new_marks
from gapsense.cosim.scenario.records import Component, Experiment, Port, Vector, ports
from gapsense.problems import ScenarioError
from gapsense.tables import Value


def feed(
    fmu: Path, name: str, values: Mapping[str, Value], start: float, step: float, inputs: Mapping[str, Vector]
) -> dict[str, Vector]:
    """Real outputs at each sample, by name; the first are those at the end of the initialisation.

    `name` is that of the instance in messages, `values` are parameters, `step` is the sampling period [s]. A sample of
    an input holds during the step that ends at it. Raises ScenarioError if the FMU has not these parameters or inputs,
    FmuError if it fails.
    """
    if not fmu.is_file():
        raise ScenarioError([f"{fmu}: there is no such FMU. Build it with `gapsense build`."])
    try:
        description = describe(fmu)
    except ValueError as error:
        raise ScenarioError([f"{fmu}: {error}"]) from error
    known = [v.name for v in description.of("input")]
    problems = [f"{name}: {p}" for n, v in values.items() if (p := value_problem(n, v, description))]
    problems += [f"{name}: no input `{n}`; it has {', '.join(known)}." for n in inputs if n not in known]
    if problems:
        raise ScenarioError(problems)
    layout = Layout(ports({name: description}))
    samples = np.column_stack(list(inputs.values()))
    with ExitStack() as stack:
        instance = instance_of(name, description, unpack_fmu(description))
        stack.callback(instance.close)
        instance.initialize(values, start, start + (len(samples) - 1) * step)
        buffer = array("d", [float(variable.start or 0.0) for variable in layout.variables.values()])
        part = Part(component=Component(name, fmu.stem), instance=instance, buffer=buffer, places=layout, texts={})
        rows = run(part, [layout.index[Port(name, n)] for n in inputs], samples, start, step)
        instance.call("fmi2Terminate")
    return {port.variable: rows[:, j].copy() for j, port in enumerate(part.outputs)}


def run(part: Part, places: list[int], samples: Vector, start: float, step: float) -> Vector:
    """Outputs at each sample, whose values go to these places in the buffer."""
    player, buffer = Player(places, lambda k: samples[k:]), np.frombuffer(part.buffer)
    player.into(buffer)(0)
    failed = part.taker()()
    if not failed:
        part.instance.call("fmi2ExitInitializationMode")
        failed = part.read_outputs()
    if failed:
        raise part.failure(failed, start, 0)
    part.is_played = True
    rows = np.empty((len(samples), len(part.outputs)))
    columns = np.array([part.places.index[port] for port in part.outputs], dtype=np.int64)
    count = len(samples) - 1
    experiment = Experiment(start, start + count * step, step, count)
    recording = Recording(rows).start(1)
    advance = advancer(
        Work(
            parts=[part],
            experiment=experiment,
            player=player,
            columns=columns,
            decimation=1,
            buffer=buffer,
            recording=recording,
            marks=new_marks(),
            begin=0,
        )
    )
    while advance(count) < count:
        pass
    return rows
