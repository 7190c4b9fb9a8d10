"""Read `[events]`, from a file or with the values that a sweep or `--set` lays over it."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Any

from gapsense.cosim.events import keys
from gapsense.cosim.events.event import ACTIONS, NEEDED, SECTION, Event, When
from gapsense.cosim.scenario.elements import Port
from gapsense.cosim.scenario.read_sections import split
from gapsense.cosim.scenario.records import NAME
from gapsense.problems import suggest
from gapsense.tables import Table, Value, flattened

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
        table.note("", f"{found}, either `above` or `below` expected. Give one of both.")
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
        table.note("value", f"{given['value']} found, a standard deviation is not below 0. Correct it.")
    if action.over == NEEDED and "over" not in table.data:
        table.note("over", f"missing; `{name}` needs the time that it takes [s]. Add it.")
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
        table.note("", f"{found}, either `at` or `when` expected. Give one of both.")
    if "until" in table.data and "duration" in table.data:
        table.note("duration", "`until` says it too. Keep one.")
    if "until" in table.data and "when" in table.data:
        table.note("until", "an event with `when` lasts for a `duration`, or to the end of the run. Use that.")
    if at is not None and until is not None and at >= until:
        table.note("until", f"`at` is {at:.9g} s and `until` is {until:.9g} s. Let `at` be the smaller one.")
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
