"""Where components drive each other with a delay, and whether somebody has measured how large the error is."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from gapsense._os.files import fingerprint, is_sealed, read_json
from gapsense.cosim.fmu.descriptions import Description, Descriptions
from gapsense.cosim.scenario.fingerprint import deciding
from gapsense.cosim.scenario.records import Component, Scenario, execution_order, reached
from gapsense.tables import is_number


def sample_time(component: Component, description: Description) -> float:
    """The sample time of a component [s]; 0 for one that has none."""
    variable = description.variables.get("sample_time")
    given = component.values.get("sample_time", variable.start if variable else None)
    return float(given or 0.0) if is_number(given) else 0.0


def is_sampled(component: Component, description: Description) -> bool:
    """True for a component with instants of its own: what lies between them is no error of a step."""
    return sample_time(component, description) > 0.0


def is_free(component: Component, description: Description) -> bool:
    """True for a component whose steps may be controlled: it takes any, and has no instants of its own."""
    return component.step == 1 and description.can_vary and not is_sampled(component, description)


def both_ways(scenario: Scenario, descriptions: Descriptions) -> Iterator[str]:
    """Sentence on the first two components that drive each other with a delay, unless the error was measured.

    A sampled component on the way has its delay on purpose, so that it is none of the coupling.
    """
    free = {n for n, c in scenario.components.items() if n in descriptions and not is_sampled(c, descriptions[n])}
    wires = [c for c in scenario.connections if {c.source.component, c.target.component} <= free]
    wires = [c for c in wires if c.source.component != c.target.component]
    loops = [c for c in wires if c.source.component in reached(c.target.component, wires)]
    if scenario.experiment.step_control is not None:
        return  # which sees to that error
    if loops and scenario.experiment.method != "jacobi":  # in which every connection is delayed
        is_explicit = scenario.experiment.method == "gauss-seidel"
        order = execution_order([*scenario.components], scenario.connections, descriptions) if is_explicit else None
        loops = [c for c in loops if (c in order.delayed if order else c.delayed)]
    if loops and not is_measured(scenario, descriptions):
        first = loops[0]
        yield (
            f"connections: `{first.source.component}` and `{first.target.component}` drive each other, `{first}` one "
            f"step late: `gapsense converge {scenario.called} --write` tells the error."
        )


# What was measured stands in a file beside the scenario, as a baseline does.


def measured_file(scenario: Scenario) -> Path:
    """File with the measured errors of a scenario or of its variant."""
    name = f"converged.{scenario.variant}.json" if scenario.variant else "converged.json"
    return scenario.path.parent / name


def is_measured(scenario: Scenario, descriptions: Descriptions) -> bool:
    """True if the error was measured of this scenario as it is, with these FMUs."""
    file = measured_file(scenario)
    if not os.path.lexists(file):
        return False
    with suppress(OSError, ValueError):
        content = read_json(file)
        return (
            isinstance(content, Mapping) and is_sealed(content) and content.get("of") == subject(scenario, descriptions)
        )
    return False


def subject(scenario: Scenario, descriptions: Descriptions) -> Any:
    """Hash of what decides the error: the scenario but for its words, and the FMUs by the GUIDs of their variables."""
    return fingerprint([deciding(scenario), {name: d.guid for name, d in descriptions.items()}])
