"""Events of a scenario against its FMUs and its time grid."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from gapsense.cosim.check.values import is_whole, limits, misfit, within
from gapsense.cosim.events.event import ACTIONS, SECTION, Event, resolved
from gapsense.cosim.events.grid import index_of, is_on_grid, neighbours
from gapsense.cosim.fmu.descriptions import Description, Descriptions, Variable
from gapsense.cosim.fmu.rules import broken_rules
from gapsense.cosim.scenario.elements import Experiment, Port
from gapsense.cosim.scenario.records import MOST_STEPS, Scenario
from gapsense.problems import listing, suggest
from gapsense.tables import Value, is_number


def check_events(
    scenario: Scenario, descriptions: Descriptions, events: Mapping[str, Event], place: str, knows_times: bool
) -> Iterator[str]:
    """Problems of events with the FMUs and, where the time grid is known, with that."""
    if events and SECTION in scenario.components:
        yield f"components.{SECTION}: in a scenario with events no component has this name. Rename it."
    for event in events.values():
        at = f"{place}.{event.name}"
        yield from (f"{at}.{problem}" for problem in target_problems(event, scenario, descriptions))
        yield from (f"{at}.when.signal: {problem}" for problem in signal_problems(event, scenario, descriptions))
        if knows_times:
            yield from (f"{at}.{problem}" for problem in time_problems(event, scenario.experiment))
            yield from (f"{at}.{problem}" for problem in start_problem(event, scenario, descriptions))


def target_problems(event: Event, scenario: Scenario, descriptions: Descriptions) -> Iterator[str]:
    """Problems with the target of an event, and with what is done to it."""
    name = event.target.component
    if name not in scenario.components:
        yield f"target: there is no component `{name}`. {suggest(name, scenario.components)}"
        return
    for one in resolved({"": event}, scenario.connections).values():
        description = descriptions.get(one.target.component)
        if description is None:
            continue
        variable = description.variables.get(one.target.variable)
        problem = refusal(one, variable, description)
        if problem:
            yield problem
        elif variable is not None:
            yield from value_problems(one, variable, scenario, description)


def refusal(event: Event, variable: Variable | None, description: Description) -> str:
    """Why an event cannot act on a variable at all, or nothing."""
    port, action = event.target, ACTIONS[event.action]
    tunable = [v.name for v in description.variables.values() if v.is_tunable]
    if variable is None:
        known = [*(v.name for c in ("input", "output") for v in description.of(c)), *tunable]
        return f"target: unknown variable `{port.variable}` in `{port.component}`. {suggest(port.variable, known)}"
    if variable.causality == "output":
        return f"target: the output `{port}` drives no input. Connect it, or choose another target."
    if variable.causality != "input" and not variable.is_tunable:
        others = f"tunable ones are {listing(tunable)}" if tunable else "it has none that is tunable"
        return f"target: `{port}` is fixed: FMI lets nobody change it during a run; {others}. Choose another target."
    if variable.type == "String":
        return f"target: `{port}` is a text, which no event changes. Choose another target."
    if action.only_real and variable.type != "Real":
        return f"action: `{event.action}` needs a target of type Real, `{port}` is {variable.type}. Use `set`."
    if variable.is_tunable and not action.on_parameter:
        return f"action: `{event.action}` is for inputs, `{port}` is a parameter. Choose another action."
    return ""


def value_problems(event: Event, variable: Variable, scenario: Scenario, description: Description) -> Iterator[str]:
    """Values that the target does not take, as far as they are known before the run."""
    result = event.value if event.action in ("set", "ramp") else None
    if result is not None and (problem := misfit(result, variable)):
        yield f"value: {problem}"
    elif variable.is_tunable:
        values: dict[str, Value] = {v.name: v.start for v in description.of("parameter") if v.start is not None}
        values.update(scenario.components[event.target.component].values)
        result = changed(event, values.get(variable.name)) if result is None else result
        problems = [] if result is None else tuned_problems(variable, result, values, description)
        yield from (f"value: `{event.target}` becomes {result}: {problem} Correct the value." for problem in problems)


def tuned_problems(
    variable: Variable, result: Value, values: Mapping[str, Value], description: Description
) -> list[str]:
    """Why a component does not take a new value of a parameter beside those of the others."""
    if is_number(result) and not within(float(result), variable):
        return [f"{limits(variable)} expected."]
    if description.rules is None:
        return []
    before = broken_rules(description.rules, values)
    now = broken_rules(description.rules, {**values, variable.name: result})
    return [f"{problem.rstrip('.')}." for problem in now if problem not in before]


def changed(event: Event, nominal: Value | None) -> float | None:
    """What a shift or a factor makes of a parameter, or None where that is not known."""
    if not (is_number(nominal) and is_number(event.value)) or event.action not in ("bias", "scale"):
        return None
    own, other = float(nominal or 0.0), float(event.value or 0.0)
    return own + other if event.action == "bias" else own * other


def signal_problems(event: Event, scenario: Scenario, descriptions: Descriptions) -> Iterator[str]:
    """Problems with the signal of a condition."""
    if event.when is None:
        return
    port: Port = event.when.signal
    if port.component not in scenario.components:
        yield f"there is no component `{port.component}`. {suggest(port.component, scenario.components)}"
    elif port.component in descriptions:
        variables = descriptions[port.component].variables
        known = [v.name for v in variables.values() if v.causality in ("input", "output") and v.type != "String"]
        if port.variable not in known:
            found = "no input or output that is a number" if port.variable in variables else "unknown"
            yield f"`{port}`: {found}. {suggest(port.variable, known)}"


def time_problems(event: Event, experiment: Experiment) -> Iterator[str]:
    """Times that are not on base steps or outside of the run, durations that are no whole number of base steps."""
    after, lasting = (event.when.after, event.when.lasting or None) if event.when else (None, None)
    begins = {"at": event.at, "when.after": after}
    for key, time in {**begins, "until": event.until}.items():
        is_near = time is not None and abs(index_of(time, experiment)) <= MOST_STEPS
        if time is not None and is_near and not is_on_grid(time, experiment):
            between = " and ".join(f"{t:.9g} s" for t in neighbours(time, experiment))
            yield f"{key}: {time:.9g} s is no base step but between {between}. Choose one of them."
    last = {**dict.fromkeys(begins, experiment.count), "until": MOST_STEPS}
    for key, time in {**begins, "until": event.until}.items():
        if time is not None and not 0 <= index_of(time, experiment) <= last[key]:
            span = f"{experiment.start:.9g} s to {experiment.stop:.9g} s"
            yield f"{key}: {time:.9g} s is outside of the run from {span}. Correct the time."
    lengths = {"over": event.over, "duration": event.duration, "when.for": lasting}
    for key, length in lengths.items():
        if length is not None and not is_whole(length / experiment.base_step):
            found = f"{length:.9g} s is {length / experiment.base_step:.9g} base steps of {experiment.base_step:.9g} s"
            yield f"{key}: {found}, a whole number of at least 1 expected. Correct the time."


def start_problem(event: Event, scenario: Scenario, descriptions: Descriptions) -> Iterator[str]:
    """Problem of an event on an input at the start that needs what was before."""
    description = descriptions.get(event.target.component)
    variable = description.variables.get(event.target.variable) if description else None
    at_start = event.at is not None and index_of(event.at, scenario.experiment) == 0
    if variable is not None and not variable.is_parameter and at_start and ACTIONS[event.action].remembers:
        remedy = "Begin later, or use `set`."
        yield f"at: at the start there is no value before, with which `{event.action}` could begin. {remedy}"
