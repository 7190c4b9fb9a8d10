"""The experiment that all rows of the benchmark run: semera_valve with all components at one step, from time 0."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from gapsense.cosim.check import prepare
from gapsense.cosim.fmu.descriptions import Description
from gapsense.cosim.scenario.records import Port, Scenario

ROOT = Path(__file__).resolve().parents[1]
SCENARIO = ROOT / "scenarios" / "semera_valve"
STEP, COUNT = 50e-6, 8100  # s, steps
FIRST_EDGE = 1.025e-3  # s, half-way between two communication points: rounded times of a peer do not move an edge
WATCHED = tuple(
    Port(*name.split(".", 1))
    for name in ("valve.current", "valve.position", "semera.resistance", "semera.inductance", "integral.flux_linkage")
)
Experiment = tuple[Scenario, Mapping[str, Description]]


def common(fmus: Path, method: str = "gauss-seidel") -> Experiment:
    """What every peer can run: no offsets, one step, start at 0."""
    scenario, descriptions = prepare(SCENARIO, None, fmus)
    components = {name: replace(c, step=1, offset=0) for name, c in scenario.components.items()}
    drive = components["drive"]
    components["drive"] = replace(drive, values={**drive.values, "square.delay": FIRST_EDGE})
    grid = replace(
        scenario.experiment, start=0.0, stop=COUNT * STEP, base_step=STEP, count=COUNT, method=method, pace=None
    )
    return replace(scenario, components=components, experiment=grid), descriptions


def real_rates(fmus: Path) -> Experiment:
    """The scenario as it is, over the same time."""
    scenario, descriptions = prepare(SCENARIO, None, fmus)
    grid = scenario.experiment
    count = round(COUNT * STEP / grid.base_step)
    return replace(scenario, experiment=replace(grid, stop=grid.time(count), count=count)), descriptions


def start_values(experiment: Experiment) -> Iterator[tuple[str, Any, Any]]:
    """Component, variable and value of all that is set before a run, and is not the start value anyway."""
    scenario, descriptions = experiment
    for name, component in scenario.components.items():
        seed = {"seed": scenario.seeds[name]} if name in scenario.seeds else {}
        for variable_name, value in {**component.values, **seed}.items():
            variable = descriptions[name].variables[variable_name]
            if value != variable.start:
                yield name, variable, value


def reference(experiment: Experiment, port: Port) -> int:
    """Value reference of a port."""
    return experiment[1][port.component].variables[port.variable].reference


def component_steps(experiment: Experiment) -> int:
    """How many steps all components make together."""
    scenario = experiment[0]
    count = scenario.experiment.count
    return sum(max(0, count - c.offset) // c.step for c in scenario.components.values())
