"""What a step of the reluctance actuator and of the model-based estimators costs in their FMUs, at rest and in motion.

Each FMU by itself in a loop in C, on the inputs of a run of its scenario; the median over the steps of a kind.
The micro-step of the plant is the difference between steps of one and of eleven micro-steps.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from c_loop import Rows as Floats
from c_loop import replay
from experiment import ROOT, Experiment

from gapsense.cosim.check import prepare
from gapsense.cosim.run.master import Master
from gapsense.cosim.scenario.records import Port, ports

MANY = 11  # micro-steps in a step
Costs = dict[str, list[float]]


class Run(NamedTuple):
    """A recorded run of all components."""

    experiment: Experiment
    rows: Floats
    kinds: tuple[Any, Any]  # whether a step begins and ends at rest, or in motion

    def cost(self, name: str, **values: Any) -> Floats:
        """Microseconds of `do_step` of one component, with other parameters if given, at rest and in motion."""
        seconds = alone(self.experiment, self.rows[1:], name, values)
        return np.array([1e6 * np.median(seconds[kind]) for kind in self.kinds])

    def worst(self, name: str, times: int = 7) -> Floats:
        """Microseconds of the median and of the worst `do_step`, of each step the shortest of some runs."""
        seconds = np.min([alone(self.experiment, self.rows[1:], name, {}) for _ in range(times)], axis=0)
        return np.array([1e6 * np.median(seconds), 1e6 * np.max(seconds)])


def actuator_steps(fmus: Path) -> Costs:
    """Microseconds at rest and in motion, by what is measured."""
    actuator = recorded(ROOT / "benchmarks" / "actuator", fmus, Port("plant", "mode"), (2.0,))
    magnet = recorded(ROOT / "scenarios" / "pot_magnet", fmus, Port("magnet", "mode"), (1.0, 4.0), "off")
    valve = recorded(ROOT / "scenarios" / "bounded_ukf", fmus, Port("valve", "mode"), (2.0,))
    table = {"gap.law": "table"}

    def micro_step(**values: Any) -> Floats:
        """Seconds that one micro-step more costs."""
        length = actuator.experiment[0].experiment.base_step
        one, many = (actuator.cost("plant", micro_step=length / n, **values) for n in (1, MANY))
        return (many - one) / (MANY - 1)

    found = {
        "Ekf": actuator.cost("ekf"),
        "Ekf, gap table": actuator.cost("ekf", **table),
        "Ertss": actuator.cost("ertss"),
        "Mhe": actuator.cost("mhe"),
        "  median and worst of all its steps": actuator.worst("mhe"),
        "HybridEkf": magnet.cost("robust"),
        "BoundedUkf": valve.cost("ukf"),
        "ReluctanceActuator, two micro-steps": actuator.cost("plant"),
        "  one more micro-step": micro_step(),
        "  one more micro-step, gap table": micro_step(**table),
    }
    return {title: costs.tolist() for title, costs in found.items()}


def recorded(scenario: Path, fmus: Path, mode: Port, moving: tuple[float, ...], variant: str | None = None) -> Run:
    """A run of a scenario in which the mover moves where the signal `mode` is one of `moving`."""
    read, *others = prepare(scenario, variant, fmus)
    experiment: Any = (replace(read, record=replace(read.record, decimation=1)), *others)  # every step is played again
    with Master(*experiment) as master:
        place = master.places.index[mode]
        rows = master.run(list(range(len(master.buffer))), experiment[0].seeds).data
    moves = np.isin(rows[:, place], moving)
    return Run(experiment, rows, (~moves[1:] & ~moves[:-1], moves[1:] & moves[:-1]))


def alone(experiment: Experiment, rows: Floats, name: str, values: Mapping[str, Any]) -> Floats:
    """Seconds of each `do_step` of one component with some other parameters, on a recorded run of all."""
    scenario, descriptions = experiment
    every, own = (list(ports(d)) for d in (descriptions, {name: descriptions[name]}))
    component = scenario.components[name]
    component = replace(component, values={**component.values, **values})
    one = replace(scenario, components={name: component}, connections=(), inputs={})
    return replay((one, {name: descriptions[name]}), rows[:, [every.index(port) for port in own]])[name].steps
