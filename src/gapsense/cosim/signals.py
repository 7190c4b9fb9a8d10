"""Signals of a scenario, Real inputs and outputs of its components, and the patterns that select them."""

from __future__ import annotations

from collections.abc import Iterable
from fnmatch import fnmatchcase

from gapsense.cosim.descriptions import Descriptions, Variable
from gapsense.cosim.scenario import Port, Scenario


def ports(descriptions: Descriptions) -> dict[Port, Variable]:
    """Every Real input and output, per component first its inputs, then its outputs."""
    return {
        Port(name, variable.name): variable
        for name, description in descriptions.items()
        for variable in (*description.of("input"), *description.of("output"))
        if variable.type == "Real"
    }


def signals(descriptions: Descriptions) -> dict[str, Variable]:
    """The same by `component.variable`."""
    return {str(port): variable for port, variable in ports(descriptions).items()}


def matching(patterns: Iterable[str], names: Iterable[str]) -> list[str]:
    """Names that are or match one of the patterns, in the order of the names."""
    patterns = tuple(patterns)
    return [name for name in names if any(name == pattern or fnmatchcase(name, pattern) for pattern in patterns)]


def recorded_signals(scenario: Scenario, descriptions: Descriptions) -> dict[str, Variable]:
    """Signals that a run of this scenario records."""
    known = signals(descriptions)
    return {name: known[name] for name in matching(scenario.record.signals, known)}
