"""Parameter sets describe a device: each component that is given one takes the parameters that it has."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

from gapsense.cosim.check_values import name_problem
from gapsense.cosim.descriptions import Descriptions
from gapsense.cosim.scenario import Component, Scenario
from gapsense.problems import listing


def taken(scenario: Scenario, descriptions: Descriptions) -> Scenario:
    """The scenario without what the parameter sets of a component have for others; its own `set` stays as it is."""

    def own(component: Component) -> Component:
        names = {v.name for v in descriptions[component.name].of("parameter")}
        files = {path.name for path in component.sets}
        values = {n: v for n, v in component.values.items() if n in names or component.origin[n] not in files}
        return replace(component, values=values)

    return replace(scenario, components={n: own(c) if n in descriptions else c for n, c in scenario.components.items()})


def check_sets(components: Mapping[str, Component], descriptions: Descriptions) -> Iterator[str]:
    """Names in a parameter set that none of the components given it has as a parameter, if all of these are known."""
    for file in dict.fromkeys(file for component in components.values() for file in component.sets):
        users = [name for name, component in components.items() if file in component.sets]
        if set(users) <= set(descriptions):
            known = [v for user in users for v in descriptions[user].variables.values()]
            variables = {v.name: v for v in sorted(known, key=lambda v: v.is_parameter)}  # the last of a name counts
            problems = [name_problem(name, variables) for name in components[users[0]].sets[file]]
            yield from (f"{file.name} (given to {listing(users)}): {problem}" for problem in problems if problem)
