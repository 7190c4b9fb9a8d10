"""Read `[events]`, from a file or with the values that a sweep or `--set` lays over it."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from gapsense.cosim.check.values import is_whole, limits, misfit, within
from gapsense.cosim.events import keys
from gapsense.cosim.events.event import ACTIONS, NEEDED, SECTION, Event, When, resolved
from gapsense.cosim.fmu.descriptions import Description, Descriptions, Variable, broken_rules
from gapsense.cosim.scenario.elements import Experiment, Port, index_of, is_on_grid, neighbours
from gapsense.cosim.scenario.read_sections import split
from gapsense.cosim.scenario.records import MOST_STEPS, NAME, Scenario
from gapsense.problems import listing, suggest
from gapsense.tables import Table, Value, flattened, is_number

Events = Mapping[str, Event]


def read_events(table: Table, changes: Mapping[str, Any]) -> dict[str, Event]:
    """Events in the order of the file; `changes` are values of their keys by `event.key`."""
    events = table.table(SECTION)
    good = [name for name in events.data if re.fullmatch(NAME, name)]
    for name in [name for name in events.data if name not in good]:
        events.note(name, "an event's name is letters, digits and `_`, not starting with a digit. Rename it.")
    read = {name: read_event(events.table(name), name, own(changes, name)) for name in good}
    for name in [name for name in changes if name.partition(".")[0] not in good]:
        events.note(name, unknown(name, good))
    return {name: event for name, event in read.items() if event}


def unknown(name: str, known: Iterable[str]) -> str:
    """Sentence for the key of an event that there is not."""
    return f"there is no event `{name.partition('.')[0]}`. {suggest(name.partition('.')[0], known)}"


def own(values: Mapping[str, Any], name: str) -> dict[str, Any]:
    """Values for one event, by key."""
    head = f"{name}."
    return {key.removeprefix(head): value for key, value in values.items() if key.startswith(head)}


def read_event(table: Table, name: str, changes: Mapping[str, Any]) -> Event | None:
    """One event, or None after noting why there is none."""
    table = table.child(laid_over(table.data, changes), "") if changes else table
    before, given = len(table.problems), table.read(keys.EVENT)
    when = read_when(table.table("when")) if "when" in table.data else None
    target = None if given["target"] is None else split(table, "target", given["target"])
    note_actions(table, given)
    note_times(table, given)
    if target is None or given["action"] is None or len(table.problems) > before:
        return None
    times = {key: as_float(given[key]) for key in ("over", "at", "until", "duration")}
    return Event(name=name, **{**given, **times, "target": target, "when": when, "given": dict(table.data)})


def laid_over(data: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """A table of an event with other values of its keys, `when.above` too."""
    flat = {**dict(flattened(data)), **changes}
    when = {key.removeprefix("when."): value for key, value in flat.items() if key.startswith("when.")}
    return {**{key: value for key, value in flat.items() if "." not in key}, **({"when": when} if when else {})}


def as_float(value: Any) -> float | None:
    """A number as a float."""
    return None if value is None else float(value)


def read_when(table: Table) -> When | None:
    """A condition, or None after noting why there is none."""
    given = table.read(keys.WHEN)
    signal = None if given["signal"] is None else split(table, "signal", given["signal"])
    sides = [key for key in ("above", "below") if key in table.data]
    if len(sides) != 1:
        found = "neither found" if not sides else "both found"
        table.note("", f"{found}, either `above` or `below` expected. Give one of them.")
        return None
    level = given[sides[0]]
    if signal is None or level is None:
        return None
    return When(
        signal=signal,
        level=float(level),
        is_above=sides[0] == "above",
        lasting=given["for"] or 0.0,
        after=given["after"],
        again=given["again"],
    )


def note_actions(table: Table, given: Mapping[str, Any]) -> None:
    """Note a value, a time or a seed that the action needs or does not use."""
    name = given["action"]
    if name is None:
        return
    action = ACTIONS[name]
    if action.value and "value" not in table.data:
        table.note("value", f"missing; `{name}` needs {action.value}. Add it.")
    if not action.value and "value" in table.data:
        table.note("value", f"`{name}` has no value. Remove it.")
    elif name != "set" and isinstance(given["value"], (str, bool)):
        table.note("value", f"{given['value']!r} found, `{name}` needs a number. Correct it.")
    elif name == "noise" and (given["value"] or 0.0) < 0.0:
        table.note("value", f"{given['value']} found, a standard deviation cannot be negative. Correct it.")
    if action.over == NEEDED and "over" not in table.data:
        table.note("over", f"missing; `{name}` needs its duration [s]. Add it.")
    if not action.over and "over" in table.data:
        table.note("over", f"`{name}` begins at once. Remove it, or use `ramp`.")
    if name != "noise" and "seed" in table.data:
        table.note("seed", f"`{name}` is not random. Remove it.")


def note_times(table: Table, given: Mapping[str, Any]) -> None:
    """Note times that are missing or contradict each other."""
    at, until = given["at"], given["until"]
    starts = [key for key in ("at", "when") if key in table.data]
    if len(starts) != 1:
        found = "neither found" if not starts else "both found"
        table.note("", f"{found}, either `at` or `when` expected. Give one of them.")
    if "until" in table.data and "duration" in table.data:
        table.note("duration", "`until` gives the end too. Keep one.")
    if "until" in table.data and "when" in table.data:
        table.note("until", "an event with `when` lasts for a `duration`, or to the end of the run. Use that.")
    if at is not None and until is not None and at >= until:
        table.note("until", f"`at` is {at:.9g} s and `until` is {until:.9g} s. `at` must be the smaller one.")
    again = isinstance(table.data.get("when"), dict) and table.data["when"].get("again") is True
    if again and "duration" not in table.data:
        table.note("when.again", "an event that lasts to the end of the run happens once. Add `duration`.")


def varied(events: Events, values: Mapping[Port, Value], problems: list[str]) -> Events:
    """The events with the values that a sweep gives their keys; what is wrong with these is noted."""
    changes = {port.variable: value for port, value in values.items() if port.component == SECTION}
    if not changes:
        return events
    table = Table({SECTION: {name: event.given for name, event in events.items()}}, "sweep", "", problems)
    return read_events(table, changes)


# Events of a scenario against its FMUs and its time grid.


def check_events(
    scenario: Scenario, descriptions: Descriptions, events: Mapping[str, Event], place: str, knows_times: bool
) -> Iterator[str]:
    """Problems of events with the FMUs and, where the time grid is known, with that."""
    if events and SECTION in scenario.components:
        yield f"components.{SECTION}: in a scenario with events, no component may have this name. Rename it."
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
        return f"target: `{port}` is fixed and cannot change during a run; {others}. Choose another target."
    if variable.type == "String":
        return f"target: `{port}` is a text, which events cannot change. Choose another target."
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
            yield f"{key}: {time:.9g} s is not a base step; the nearest are {between}. Choose one of them."
    last = {**dict.fromkeys(begins, experiment.count), "until": MOST_STEPS}
    for key, time in {**begins, "until": event.until}.items():
        if time is not None and not 0 <= index_of(time, experiment) <= last[key]:
            span = f"{experiment.start:.9g} s to {experiment.stop:.9g} s"
            yield f"{key}: {time:.9g} s is outside the run from {span}. Correct the time."
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
        yield f"at: at the start there is no earlier value for `{event.action}` to begin with. {remedy}"
