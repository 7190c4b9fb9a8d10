"""What a scenario says of an event, as records, and what actions there are."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from gapsense.tables import Value

if TYPE_CHECKING:
    from gapsense.cosim.fmu.descriptions import Descriptions
    from gapsense.cosim.scenario.elements import Connection, Port

Buffer = npt.NDArray[np.float64]
TIMES = ("at", "until", "duration", "over", "when.for", "when.after")  # keys in seconds
NEEDED, MAY_BE = "needed", "may be given"
SECTION = "events"  # of the file; in a sweep it stands where others have a component


class Action(NamedTuple):
    """What an event does to its target, and what it needs for that."""

    what: str
    value: str = ""  # what `value` is, empty where there is none
    over: str = ""  # NEEDED, MAY_BE, or empty where it takes no time
    on_parameter: bool = True
    only_real: bool = True
    remembers: bool = False  # needs the value that there was just before


ACTIONS: Mapping[str, Action] = {
    "set": Action("has the value", "the value", only_real=False),
    "ramp": Action(
        "goes in a straight line from its old value to the new one", "its last value", NEEDED, remembers=True
    ),
    "bias": Action("is shifted by the value", "what is added", MAY_BE),
    "scale": Action("is multiplied by the value", "the factor", MAY_BE),
    "stuck": Action("keeps its last value", on_parameter=False, only_real=False, remembers=True),
    "dropout": Action("is NaN: the sample was lost", on_parameter=False),
    "noise": Action("has normal noise added", "its standard deviation"),
}


@dataclass(frozen=True)
class When:
    """A condition: the signal is above (or below) a level, for some time [s], counted from a time [s] on."""

    signal: Port
    level: float
    is_above: bool
    lasting: float = 0.0
    after: float | None = None
    again: bool = False  # it counts again after the event, once it has not held


@dataclass(frozen=True)
class Event:
    """One action on an input, an output or a tunable parameter from `at` [s], or from where a condition holds.

    It lasts until `until` [s], or for `duration` [s], or to the end of the run. `given` is its table in the file.
    """

    name: str
    target: Port
    action: str
    value: Value | None = None
    over: float | None = None  # [s]
    at: float | None = None
    until: float | None = None
    duration: float | None = None
    when: When | None = None
    seed: int = 0
    enabled: bool = True
    description: str = ""
    given: Mapping[str, Any] = field(default_factory=dict)

    @property
    def is_random(self) -> bool:
        """True if each sample has a random number of its own."""
        return self.action == "noise"

    @property
    def seed_name(self) -> str:
        """Its name among the seeds of a run."""
        return f"{SECTION}.{self.name}"


def resolved(events: Mapping[str, Event], connections: Iterable[Connection]) -> dict[str, Event]:
    """Events with one input or parameter each: one on an output is one on each input that this drives."""
    driven: dict[Port, list[Port]] = {}
    for connection in connections:
        driven.setdefault(connection.source, []).append(connection.target)
    found: dict[str, Event] = {}
    for name, event in events.items():
        targets = driven.get(event.target)
        more = {f"{name} {target}": replace(event, target=target) for target in targets or ()}
        found.update(more or {name: event})
    return found


class Span(NamedTuple):
    """When an event was on: begin and end [s]; None for one that was still on at the end of the run."""

    name: str
    target: str
    action: str
    begin: float
    end: float | None


def unit_of_key(key: str, event: Event, descriptions: Descriptions) -> str:
    """Unit of a key of an event, empty where it has none."""
    if key in TIMES:
        return "s"
    if key == "value":
        port = None if event.action == "scale" else event.target
    else:
        port = event.when.signal if event.when and key in ("when.above", "when.below") else None
    if port is None:
        return ""
    return descriptions[port.component].variables[port.variable].unit or ""


# Conditions on signals, which the loop over base steps looks at: it comes back when one begins or ends to hold.


@dataclass
class Watch:
    """Whether the value in a place of the buffer is above (or below) a level, as it was known last."""

    place: int
    level: float
    is_above: bool
    is_on: bool = False  # somebody wants to know
    holds: bool = False

    def look(self, buffer: Buffer) -> bool:
        """True if the condition holds now; NaN is neither above nor below."""
        value = buffer[self.place]
        return bool(value > self.level if self.is_above else value < self.level)


def reporter(watches: Sequence[Watch], buffer: Buffer) -> Callable[[], bool]:
    """Function that says if there is news of some conditions."""
    return lambda: any(watch.is_on and watch.look(buffer) != watch.holds for watch in watches)
