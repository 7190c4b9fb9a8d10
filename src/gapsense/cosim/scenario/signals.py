"""Signals of a scenario, inputs and outputs of its components, and the patterns that select them."""

from __future__ import annotations

import re
from collections.abc import Iterable
from fnmatch import translate

from gapsense.cosim.fmu.descriptions import Description, Descriptions, Variable
from gapsense.cosim.scenario.elements import Port
from gapsense.cosim.scenario.records import Scenario


def ports(descriptions: Descriptions) -> dict[Port, Variable]:
    """Every input and output that is a number, in the order of the buffer.

    For each component these are its Real inputs, its Real outputs, its other outputs and its other inputs, so that
    what one call moves lies side by side.
    """
    return {
        Port(name, variable.name): variable
        for name, description in descriptions.items()
        for variable in side_by_side(description)
    }


def side_by_side(description: Description) -> list[Variable]:
    """Numeric inputs and outputs of an FMU in the order of the buffer."""
    inputs, outputs = ([v for v in description.of(c) if v.type != "String"] for c in ("input", "output"))
    real, other = ([v for v in inputs if (v.type == "Real") == is_real] for is_real in (True, False))
    return [*real, *sorted(outputs, key=lambda v: v.type != "Real"), *other]


def texts(descriptions: Descriptions) -> dict[Port, Variable]:
    """Every input and output that is a text."""
    return {
        Port(name, variable.name): variable
        for name, description in descriptions.items()
        for variable in (*description.of("input"), *description.of("output"))
        if variable.type == "String"
    }


def signals(descriptions: Descriptions) -> dict[str, Variable]:
    """Every signal that can be recorded, in the order of the buffer, by `component.variable`."""
    return {str(port): variable for port, variable in ports(descriptions).items()}


def matching(patterns: Iterable[str], names: Iterable[str]) -> list[str]:
    """Names that are or match one of the patterns, in the order of the names."""
    exact = frozenset(patterns := tuple(patterns))
    matches = re.compile("|".join(map(translate, patterns)) or "(?!)").match
    return [name for name in names if name in exact or matches(name)]


def recorded_signals(scenario: Scenario, descriptions: Descriptions) -> dict[str, Variable]:
    """Signals that a run of this scenario records."""
    known = signals(descriptions)
    return {name: known[name] for name in matching(scenario.record.signals, known)}
