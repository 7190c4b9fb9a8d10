"""How small changes grow in a scenario: a signal in which they grow beyond its tolerance is nothing for a baseline.

Another platform rounds otherwise, and a change of a component may round otherwise; a baseline is not about that.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from random import Random

import numpy as np

from gapsense.cosim.check import prepare, within
from gapsense.cosim.fmu.descriptions import Description, Variable
from gapsense.cosim.result.compare import select_signals, thin_rows, tolerance_of
from gapsense.cosim.result.result import Result
from gapsense.cosim.run.master import Master
from gapsense.cosim.run.run import run_once
from gapsense.cosim.scenario.records import Component, Port, Scenario
from gapsense.tables import Value, is_number

PERTURBATION = 1e-9  # relative change of every parameter and constant input, but of what is `KEPT`
DRAWS = 4  # runs, each with other directions
KEPT = ("s", "Hz", "1")  # units of what may lie on the time grid, as an edge or its share of a period, or be a count


@dataclass(frozen=True)
class Growth:
    """What becomes of a relative change of all parameters and constant inputs in one signal of a baseline."""

    signal: str
    unit: str
    change: float  # the largest
    allowed: float  # by the baseline
    amplification: float  # of the relative change, in nominal values
    since: float  # time [s] from which on a change is beyond what is allowed; infinite if it never is

    @property
    def is_beyond(self) -> bool:
        """True if the baseline cannot hold the signal."""
        return math.isfinite(self.since)

    def __str__(self) -> str:
        unit = f" {self.unit}" if self.unit else ""
        said = f"it changes by {self.change:.3g}{unit}, allowed are {self.allowed:.3g}{unit}"
        return f"{self.signal}: {said}, first at t = {self.since:.6g} s" if self.is_beyond else f"{self.signal}: {said}"


def sensitivity(scenario: str | Path, variant: str | None = None, fmus: str | Path | None = None) -> list[Growth]:
    """Run a scenario as it is and some times with all numbers a little changed, and compare.

    The growth of each signal that the baseline covers is that of the worst draw; the most sensitive ones come first.
    """
    read, descriptions = prepare(scenario, variant, fmus)
    changed = (perturb(read, descriptions, PERTURBATION, draw) for draw in range(DRAWS))
    first, *others = (once(each, descriptions) for each in (read, *changed))
    found = [growth(name, first, others, read) for name in select_signals(first, read.baseline)]
    return sorted(found, key=lambda g: -g.change / g.allowed if g.allowed else -math.inf)


def once(scenario: Scenario, descriptions: Mapping[str, Description]) -> Result:
    """The rows of a run that a baseline holds."""
    with Master(scenario, descriptions) as master:
        result = run_once(master)
    if result.interrupted:
        raise KeyboardInterrupt
    return thin_rows(result, scenario.baseline)


def growth(name: str, first: Result, others: list[Result], scenario: Scenario) -> Growth:
    """Largest difference of a signal between the first run and the others."""
    tolerance, about = tolerance_of(name, scenario.baseline), first.about[name]
    allowed = tolerance.atol + tolerance.rtol * about.nominal
    change = np.max([np.abs(other[name] - first[name]) for other in others], axis=0)
    beyond = first.times[~(change <= allowed)]
    largest = float(np.max(change))
    since = float(beyond[0]) if beyond.size else math.inf
    return Growth(
        signal=name,
        unit=about.unit,
        change=largest,
        allowed=allowed,
        amplification=largest / (PERTURBATION * about.nominal),
        since=since,
    )


def perturb(scenario: Scenario, descriptions: Mapping[str, Description], size: float, draw: int) -> Scenario:
    """Change all parameters and constant inputs of a scenario by this much, up or down."""

    def other(component: Component) -> Component:
        """The component with every numeric parameter changed, also those that it leaves at their start values."""
        description = descriptions[component.name]
        values = {v.name: component.values.get(v.name, v.start) for v in description.of("parameter")}
        numbers = {name: float(value) for name, value in values.items() if value is not None and is_number(value)}
        others = {
            name: perturb_value(value, description.variables[name], size, draw) for name, value in numbers.items()
        }
        more = {name: value for name, value in others.items() if value != numbers[name]}
        return replace(component, values={**component.values, **more})

    def perturb_input(port: Port, value: Value) -> Value:
        if not is_number(value):
            return value
        return perturb_value(float(value), descriptions[port.component].variables[port.variable], size, draw)

    components = {name: other(component) for name, component in scenario.components.items()}
    inputs = {port: perturb_input(port, value) for port, value in scenario.inputs.items()}
    return replace(scenario, components=components, inputs=inputs)


def perturb_value(value: float, variable: Variable, size: float, draw: int) -> float:
    """Change a value up or down, within the limits of its variable; equal values stay equal.

    Only Real values change. Times, values without a dimension, and whole numbers of unknown unit stay as they are.
    """
    if variable.type != "Real" or variable.unit in KEPT or (variable.unit is None and value.is_integer()):
        return value
    step = Random(f"{draw} {abs(value)!r}").choice((size, -size))
    tries = (value * (1.0 + step), value * (1.0 - step))
    return next((other for other in tries if within(other, variable)), value)
