"""The experiment in our runner, and as bare kernels called from Python."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from pathlib import Path
from time import perf_counter
from typing import Any

from c_loop import replay
from experiment import COUNT, ROOT, STEP, WATCHED, Experiment, common, component_steps, real_rates

from gapsense.cosim.run.master import Master
from gapsense.cosim.run.run import run_once
from gapsense.cosim.scenario.records import Port
from gapsense.fmi.components import kernel_parameters
from gapsense.fmi.ports import Component
from gapsense.kernels.kernel import Kernel

Outcome = tuple[float, int, dict[str, float]]
Step = Callable[[Any, Any, Any], Any]


def gapsense(fmus: Path) -> Outcome:
    """Our runner, Gauss-Seidel."""
    return _gapsense(common(fmus))


def gapsense_jacobi(fmus: Path) -> Outcome:
    """Our runner, Jacobi."""
    return _gapsense(common(fmus, "jacobi"))


def gapsense_real_rates(fmus: Path) -> Outcome:
    """Our runner, the scenario as it is."""
    return _gapsense(real_rates(fmus))


def _gapsense(experiment: Experiment) -> Outcome:
    """All of the master's loop, with what the scenario records; without loading and initialising, as for the others."""
    with Master(*experiment) as master:
        loop, seconds = master.loop, 0.0

        def timed(*arguments: Any) -> None:
            """The loop, with its time taken."""
            nonlocal seconds
            begin = perf_counter()
            loop(*arguments)
            seconds = perf_counter() - begin

        master.loop = timed  # type: ignore[method-assign]
        run_once(master)
        last = {str(port): master.buffer[master.places.index[port]] for port in WATCHED}
    return seconds, component_steps(experiment), last


# --- without FMI ---


class Direct:
    """A kernel with the parameters of a component of the scenario, as plain Python functions on flat tuples."""

    def __init__(self, experiment: Experiment, name: str, components: Mapping[str, tuple[Component, Path]]) -> None:
        scenario, descriptions = experiment
        self.component, self.folder = components[descriptions[name].name]
        self.kernel = Kernel(importlib.import_module(self.component.kernel))
        seed = {"seed": scenario.seeds[name]} if name in scenario.seeds else {}
        self.advance: Step = self.kernel.scalar["advance"]
        self.par = tuple(kernel_parameters(self.folder, {**scenario.components[name].values, **seed}))
        self.constants = self.kernel.scalar["constants"](self.par)
        self.inputs = [Port(name, port.name) for port in self.component.of("input")]
        self.outputs = [Port(name, port.name) for port in self.component.of("output")]
        self.clock = sum(field in self.kernel.module.Inputs._fields for field in ("time", "dt"))

    def given(self, inputs: list[float], time: float, dt: float) -> list[float]:
        """What the kernel takes: the inputs, before them time and step if it asks for them."""
        return [time, dt, *inputs] if self.clock == 2 else [time, *inputs] if self.clock else inputs


def directs(experiment: Experiment, order: list[str]) -> list[Direct]:
    """The kernels of all components."""
    from gapsense.fmi.components import find_components, load_component

    loaded = [(load_component(folder), folder) for folder in find_components(ROOT / "fmus")]
    components = {component.name: (component, folder) for component, folder in loaded}
    return [Direct(experiment, name, components) for name in order]


def kernels(fmus: Path) -> Outcome:
    """The kernels' scalar Python, Gauss-Seidel, no FMI, nothing checked."""
    experiment = common(fmus)
    with Master(*experiment) as master:
        order, places = list(master.order.names), master.places
        source = {c.target: c.source for c in experiment[0].connections}
    values = [0.0] * len(places.variables)
    for port, value in experiment[0].inputs.items():
        values[places.index[port]] = value
    plan = []
    for direct in directs(experiment, order):
        inputs = [places.index[source.get(port, port)] for port in direct.inputs]
        first = places.index[direct.outputs[0]]
        place = slice(first, first + len(direct.outputs))
        given = direct.given([values[i] for i in inputs], 0.0, 0.0)
        state, values[place] = direct.kernel.scalar["initial"](given, direct.par)
        plan.append([direct.advance, state, inputs, direct.clock, direct.constants, place])
    rows = []
    watched = [places.index[port] for port in WATCHED]
    begin = perf_counter()
    for k in range(1, COUNT + 1):
        for part in plan:
            advance, state, inputs, clock, constants, place = part
            given = [values[i] for i in inputs]
            if clock:
                end = (k - 1) * STEP + STEP
                given = [end, STEP, *given] if clock == 2 else [end, *given]
            part[1], values[place] = advance(state, given, constants)
        rows.append([values[i] for i in watched])
    return perf_counter() - begin, component_steps(experiment), dict(zip(map(str, WATCHED), rows[-1]))


# --- each component alone ---


def alone(fmus: Path) -> dict[str, list[float]]:
    """Microseconds per step by component: set, do_step, get of the FMU, and the kernel, on the inputs of the run."""
    experiment = common(fmus)
    with Master(*experiment) as master:
        names, index = list(master.order.names), master.places.index
        recording = master.run(list(range(len(index))), experiment[0].seeds)
    rows = recording.data[1 : recording.rows]
    replayed = replay(experiment, rows)
    found = {}
    for name, direct in zip(names, directs(experiment, names)):
        given = rows[:, [index[port] for port in direct.inputs]].tolist()
        found[name] = [1e6 * s / len(rows) for s in replayed[name].total] + [kernel_time(direct, given)]
    return found


def kernel_time(direct: Direct, rows: list[list[float]]) -> float:
    """Microseconds per step on recorded inputs."""
    given = [direct.given(row, k * STEP + STEP, STEP) for k, row in enumerate(rows)]
    advance, constants = direct.advance, direct.constants
    state, _ = direct.kernel.scalar["initial"](direct.given(rows[0], 0.0, 0.0), direct.par)
    begin = perf_counter()
    for inputs in given:
        state, _ = advance(state, inputs, constants)
    return 1e6 * (perf_counter() - begin) / len(given)
