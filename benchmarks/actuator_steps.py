"""What a step of the reluctance actuator and of its estimators costs in their FMUs, at rest and in motion.

Each FMU by itself in a loop in C, on the inputs of a run of benchmarks/actuator; the median over the steps of a kind.
The micro-step of the plant is the difference between steps of one and of eleven micro-steps.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from c_loop import Rows as Floats
from c_loop import replay
from experiment import Experiment

from gapsense.cosim.master import Master
from gapsense.cosim.run import prepare
from gapsense.cosim.scenario import Port
from gapsense.cosim.signals import ports

SCENARIO = Path(__file__).resolve().parent / "actuator"
MANY = 11  # micro-steps in a step
Costs = dict[str, list[float]]


def actuator_steps(fmus: Path) -> Costs:
    """Microseconds at rest and in motion, by what is measured."""
    experiment = prepare(SCENARIO, None, fmus)
    with Master(*experiment) as master:
        mode = master.places.index[Port("plant", "mode")]
        rows = master.run(list(range(len(master.buffer))), {}).data
    moves = rows[:, mode] == 2.0
    kinds = ~moves[1:] & ~moves[:-1], moves[1:] & moves[:-1]

    def cost(name: str, **values: Any) -> Floats:
        seconds = alone(experiment, rows[1:], name, values)
        return np.array([1e6 * np.median(seconds[kind]) for kind in kinds])

    def micro_step(**values: Any) -> Floats:
        length = experiment[0].experiment.base_step
        one, many = (cost("plant", micro_step=length / n, **values) for n in (1, MANY))
        return (many - one) / (MANY - 1)

    table = {"gap.law": "table"}
    found = {
        "Ekf": cost("ekf"),
        "Ekf, gap table": cost("ekf", **table),
        "Ertss": cost("ertss"),
        "ReluctanceActuator, two micro-steps": cost("plant"),
        "  one more micro-step": micro_step(),
        "  one more micro-step, gap table": micro_step(**table),
    }
    return {title: costs.tolist() for title, costs in found.items()}


def alone(experiment: Experiment, rows: Floats, name: str, values: Mapping[str, Any]) -> Floats:
    """Seconds of each `do_step` of one component with other parameters, on a recorded run of all."""
    scenario, descriptions = experiment
    every, own = (list(ports(d)) for d in (descriptions, {name: descriptions[name]}))
    component = replace(scenario.components[name], values=values)
    one = replace(scenario, components={name: component}, connections=(), inputs={})
    return replay((one, {name: descriptions[name]}), rows[:, [every.index(port) for port in own]])[name].steps
