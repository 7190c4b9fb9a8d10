"""Parameters, parameter sets, seeds and step sizes of components against their model descriptions.

A parameter set describes a device: each component that is given one takes the parameters that it has.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

from gapsense._os.files import state
from gapsense.cosim.fmu.archive import UnusableError, read_description
from gapsense.cosim.fmu.descriptions import NUMERIC, Description, Descriptions, Variable, mended
from gapsense.cosim.scenario.elements import Component, Experiment
from gapsense.cosim.scenario.records import RowsColumn, Scenario
from gapsense.problems import listing, suggest
from gapsense.tables import Value, found, is_integer, is_number


def taken(scenario: Scenario, descriptions: Descriptions) -> Scenario:
    """The scenario without what the parameter sets of a component have for others; its own `set` stays as it is."""

    def own(component: Component) -> Component:
        names = {v.name for v in descriptions[component.name].of("parameter")}
        files = {path.name for path in component.sets}
        values = {n: v for n, v in component.values.items() if n in names or component.origin[n] not in files}
        return replace(component, values=values)

    return replace(scenario, components={n: own(c) if n in descriptions else c for n, c in scenario.components.items()})


def check_sets(components: Mapping[str, Component], descriptions: Descriptions) -> Iterator[str]:
    """Names in a parameter set that nobody has as a parameter, if all components that are given it are known.

    What none of these has may be for another component: an FMU in the same folder.
    """
    for file in dict.fromkeys(file for component in components.values() for file in component.sets):
        users = [name for name, component in components.items() if file in component.sets]
        if set(users) <= set(descriptions):
            known = [v for user in users for v in descriptions[user].variables.values()]
            variables = {v.name: v for v in sorted(known, key=lambda v: v.is_parameter)}  # the last of a name counts
            names = list(components[users[0]].sets[file])
            if not set(names) <= set(variables):
                others = parameters_beside(description.path for description in descriptions.values())
                names = [name for name in names if name in variables or name not in others]
            problems = [name_problem(name, variables) for name in names]
            yield from (f"{file.name} (given to {listing(users)}): {problem}" for problem in problems if problem)


def check_values(component: Component, description: Description) -> Iterator[str]:
    """Problems with the parameter values of a component, wherever they were given."""
    for name, value in component.values.items():
        problem = value_problem(name, value, description)
        if problem:
            yield f"components.{component.name} (from {component.origin[name]}): {problem}"
    touched = {description.variables[name].array for name in component.values if name in description.variables}
    for array in sorted(touched - {""}):
        if missing := [v.name for v in description.arrays[array] if v.start is None and v.name not in component.values]:
            yield f"components.{component.name}: `{missing[0]}` is missing. Give all elements of `{array}`, or none."


def value_problem(name: str, value: Value, description: Description) -> str | None:
    """What is wrong with setting a variable to a value before the run, or None."""
    problem = name_problem(name, description.variables, True)
    if problem:
        return problem
    return misfit(value, description.variables[name], f"`{name}` is {{}}")


def misfit(value: Value, variable: Variable, said: str = "{} found") -> str | None:
    """Why a variable does not take a value, or None; `said` is the beginning of the sentence."""
    if isinstance(value, str) and variable.items and value not in variable.items:
        return f"{said.format(found(value))}, an item of the enumeration is expected. {suggest(value, variable.items)}"
    number = variable.number(value)
    if not has_type(number, variable.type):
        return f"{said.format(found(value))}, a value of type {variable.type} is expected. Correct the value."
    if variable.type in NUMERIC and not within(float(number), variable):
        return f"{said.format(number)}, {limits(variable)} expected. Correct the value."
    return None


def name_problem(name: str, variables: Mapping[str, Variable], takes_starts: bool = False) -> str | None:
    """Why a name is that of no parameter among some variables, or None; some callers take start values too."""
    variable = variables.get(name)
    if variable is None:
        return f"unknown parameter `{name}`. {suggest(name, [v.name for v in variables.values() if v.is_parameter])}"
    if not (variable.is_settable if takes_starts else variable.is_parameter):
        remedy = "Give its value in `[inputs]`." if variable.causality == "input" else "Remove it."
        return f"`{name}` is not a parameter but has the causality `{variable.causality}`. {remedy}"
    return None


def has_type(value: Value, kind: str) -> bool:
    """True if a TOML value may be given to a variable of this FMI type; a Real takes whole numbers too."""
    if kind == "Real":
        return is_number(value)
    if kind == "String":
        return isinstance(value, str)
    return isinstance(value, bool) if kind == "Boolean" else is_integer(value)


def check_seeds(component: Component, description: Description, seed: int) -> Iterator[str]:
    """Problems with the seed of a component."""
    place = f"seeds.{component.name}"
    variable = description.variables.get("seed")
    if variable is None or variable.type != "Integer" or not variable.is_parameter:
        yield f"{place}: the FMU `{description.name}` has no Integer parameter `seed`. Remove the entry."
    elif "seed" in component.values:
        yield f"{place}: `seed` is also given in {component.origin['seed']}. Keep one."
    elif not within(float(seed), variable):
        yield f"{place}: {seed} found, {limits(variable)} expected. Correct the value."


def check_grid(component: Component, description: Description, experiment: Experiment) -> Iterator[str]:
    """Problems of a component's step with the experiment and with the sample time of its FMU."""
    place = f"components.{component.name}"
    if component.offset + component.step > experiment.count:
        yield (
            f"{place}: its first step ends after {component.offset + component.step} base steps, "
            f"the run has {experiment.count}. Reduce `step` or `offset`, or run longer."
        )
    variable = description.variables.get("sample_time")
    value = component.values.get("sample_time", None if variable is None else variable.start)
    if variable is None or not is_number(value):
        return
    step, sample = component.step * experiment.base_step, float(value or 0.0)
    if sample > 0.0 and not (is_whole(step / sample) or is_whole(sample / step)):
        yield (
            f"{place}: its step is {step:.9g} s and `sample_time` is {sample:.9g} s; one must be a whole multiple of "
            "the other. Change `step`, `base_step` or `sample_time`."
        )


def check_swept(
    component: Component,
    description: Description,
    name: str,
    values: Sequence[Value],
    experiment: Experiment,
    column: RowsColumn | None = None,
) -> Iterator[str]:
    """Problems with the values that a sweep gives a parameter of a component, in a list or in a column of its rows."""
    place = f"sweep.{component.name}.{name}"
    if problem := name_problem(name, description.variables, True):
        yield f"{place}: {problem}"
        return
    if description.variables[name].is_structural:
        yield f"{place}: it decides the sizes of arrays. Set it in `components.{component.name}.set`, or in variants."
        return
    unit = description.variables[name].unit or ""
    if column and column.unit not in ("", unit):
        yield (
            f"{place} ({column.file}, line 1, column {column.number}): it is in `{column.unit}`, `{unit or '1'}` is "
            "expected, and nothing is converted. Convert the column."
        )
    for row, value in enumerate(values):
        problem = value_problem(name, value, description)
        if problem:
            yield f"{place}{f' ({column.place(row)})' if column else ''}: {problem}"
        elif name == "sample_time":
            yield from check_grid(replace(component, values={name: value}), description, experiment)


def is_whole(ratio: float) -> bool:
    """True for a whole number of at least 1, within 1e-9."""
    return math.isfinite(ratio) and round(ratio) >= 1 and abs(ratio - round(ratio)) <= 1e-9 * round(ratio)


def within(value: float, variable: Variable) -> bool:
    """True if a value lies within the limits of a variable and of its type."""
    low, high = ends(variable)
    return (low is None or value >= low) and (high is None or value <= high)


def ends(variable: Variable) -> tuple[float | None, float | None]:
    """Smallest and largest value of a variable, None where there is no limit."""
    low, high = variable.range or (None, None)
    return low if variable.min is None else variable.min, high if variable.max is None else variable.max


def limits(variable: Variable) -> str:
    """Limits of a variable as messages name them."""
    low, high = ends(variable)
    unit = f" {variable.unit}" if variable.unit else ""
    return f"{'-inf' if low is None else f'{low:.10g}'} to {'inf' if high is None else f'{high:.10g}'}{unit}"


# Parameters of the FMUs that lie beside those of a scenario: what a parameter set may have for other components.


def parameters_beside(fmus: Iterable[Path]) -> frozenset[str]:
    """Names of the parameters of all FMUs in the folders of some; one that cannot be read has none."""
    files = {file for folder in {fmu.parent for fmu in fmus} for file in folder.glob("*.fmu")}
    return frozenset().union(*(_parameters(file.resolve(), *state(file)) for file in files))


@lru_cache(maxsize=256)
def _parameters(file: Path, *_: int) -> frozenset[str]:
    """Those of a file in some state."""
    try:
        root, _text = mended(read_description(file)[0])
    except (UnusableError, SyntaxError):  # of the XML; whoever uses the FMU is told
        return frozenset()
    return frozenset(v.get("name", "") for v in root.iter() if v.get("causality") == "parameter")
