"""Where events act on the values that go to inputs: places behind those of the ports in the common buffer.

The value for an input with n events goes through n stages, in the order of the file. A stage has the place from which
it takes the value, a place for a value that it holds instead, and the place of the next stage or of the input.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

from gapsense.cosim.events.event import Event

if TYPE_CHECKING:
    from gapsense.cosim.scenario.elements import Port


class Slot(NamedTuple):
    """Places of a stage."""

    before: int
    held: int
    after: int


def slots(events: Mapping[str, Event], index: Mapping[Port, int]) -> dict[str, Slot]:
    """Places of the stages of all events on inputs; `index` has those of the ports."""
    found: dict[str, Slot] = {}
    ends, free = dict(index), len(index)
    for name, event in reversed([*events.items()]):  # the last one is next to the input
        if event.target in index:
            found[name] = Slot(free, free + 1, ends[event.target])
            ends[event.target] = free
            free += 2
    return {name: found[name] for name in events if name in found}


def inlets(events: Mapping[str, Event], index: Mapping[Port, int], places: Mapping[str, Slot]) -> dict[Port, int]:
    """Where the value for each port goes: to its first stage, or where the port itself is."""
    first = {events[name].target: slot.before for name, slot in reversed([*places.items()])}
    return {**index, **first}
