"""What inputs get that no output drives: constants, and signals of the scenario."""

from __future__ import annotations

from array import array
from collections.abc import Mapping

from gapsense.cosim.fmu.descriptions import Descriptions
from gapsense.cosim.run.part import Layout
from gapsense.cosim.scenario.elements import Port
from gapsense.cosim.scenario.records import Scenario
from gapsense.tables import Value


def constants(scenario: Scenario, descriptions: Descriptions, swept: Mapping[Port, Value]) -> dict[Port, Value]:
    """Values of inputs at the start: those of `[inputs]`, and those that the `set` of a component or a sweep gives."""
    given = {Port(name, n): v for name, component in scenario.components.items() for n, v in component.values.items()}
    known = {Port(name, v.name): v for name, description in descriptions.items() for v in description.of("input")}
    values = {**given, **swept, **scenario.inputs}
    return {port: known[port].number(value) for port, value in values.items() if port in known}


def place(port: Port, value: Value, places: Layout, buffer: array[float], texts: dict[Port, str]) -> None:
    """Put the value of an input where the part of its component takes it."""
    if port in places.index:
        buffer[places.inlets[port]] = float(value)
    else:
        texts[port] = str(value)
