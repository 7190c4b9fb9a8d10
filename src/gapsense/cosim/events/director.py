"""All events of a run: between two base steps they are prepared for the next one, and what happened is noted.

The loop over base steps does as many at once as there are between two changes; what is on meanwhile is part of its
copies from outputs to inputs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from gapsense._os.processes import Marks
from gapsense.cosim.events.actor import NEVER, Actor, Effect
from gapsense.cosim.events.event import Event, Watch, reporter
from gapsense.cosim.run.failure import FmuError
from gapsense.cosim.run.part import Layout, Part, Stage
from gapsense.cosim.run.recording import COMPONENT, MASTER
from gapsense.cosim.scenario.elements import Experiment
from gapsense.problems import listing
from gapsense.tables import Value

Happened = list[list[Any]]  # event, base steps of its begin and its end, None while it is on


class Director:
    """The events of a run, with one target each; `limit` is the base step after which `turn` is to be called next."""

    def __init__(
        self,
        events: Mapping[str, Event],
        experiment: Experiment,
        parts: Sequence[Part],
        places: Layout,
        buffer: npt.NDArray[np.float64],
        seeds: Mapping[str, int],
        marks: Marks,
    ) -> None:
        by_name = {part.component.name: part for part in parts}
        self.places, self.buffer, self.happened = places, buffer, Happened()
        self.actors: dict[str, Actor] = {}
        self.stages: dict[str, Stage] = {}
        self.tuned: dict[str, Tuned] = {}
        for name, event in events.items():
            part, lead = by_name[event.target.component], int(name in places.slots)
            seed = seeds.get(event.seed_name, event.seed)
            numbered = replace(event, value=part.number(event.target.variable, event.value))
            actor = Actor(numbered, experiment, part.component, lead, watch(event, places), seed)
            self.actors[name] = actor
            if lead:
                self.stages[name] = part.stages[name]
            else:
                number = parts.index(part) + 1
                own = Tuned(part, event.target.variable, experiment, marks, number)
                self.tuned.setdefault(str(event.target), own).actors.append(actor)
        self.watches = [actor.watch for actor in self.actors.values() if actor.watch]
        self.has_news = reporter(self.watches, buffer)
        self.first = {event.name: key for key, event in reversed([*events.items()])}  # of each event, tells of it
        self.limit = self.turn(-1)

    def turn(self, k: int) -> int:
        """Prepare what comes after base step k (-1: the initialization); the next one after which to do so again."""
        for name, actor in self.actors.items():
            change = actor.turn(k, self.buffer, partial(self.before, name, k))
            if change and self.first[actor.event.name] == name:
                self.note(actor.event.name, k + actor.lead, change)
            if name in self.stages:
                self.stages[name].apply(actor.effect(k + actor.lead), self.buffer)
        late = [tuned.turn(k) for tuned in self.tuned.values()]
        self.limit = min([NEVER, *(actor.due(k) for actor in self.actors.values()), *late])
        return self.limit

    def before(self, name: str, k: int) -> Value:
        """What the target of an event has, but for this event and those after it in the file."""
        if name in self.stages:
            return float(self.buffer[self.stages[name].slot.before])
        tuned = self.tuned[str(self.actors[name].event.target)]
        return tuned.value(k, self.actors[name])

    def note(self, name: str, m: int, change: int) -> None:
        """Keep that an event has begun or ended."""
        if change > 0:
            self.happened.append([name, m, None])
        else:
            next(span for span in reversed(self.happened) if span[0] == name)[2] = m

    def losing(self, component: str) -> list[str]:
        """Events that are on and give a component NaN."""
        actors = [a for a in self.actors.values() if a.event.action == "dropout" and a.track.is_on]
        return [actor.event.name for actor in actors if actor.event.target.component == component]

    def begin(self, parameters: Mapping[str, Value]) -> None:
        """Take the values that parameters have at the start."""
        for name, tuned in self.tuned.items():
            tuned.nominal = tuned.last = parameters[name]

    def state(self) -> dict[str, Any]:
        """All that it takes to go on, of JSON; values in the buffer are kept with that."""
        return {
            "actors": {name: actor.state() for name, actor in self.actors.items()},
            "stages": {name: stage.state() for name, stage in self.stages.items()},
            "last": {name: tuned.last for name, tuned in self.tuned.items()},
            "happened": self.happened,
            "limit": self.limit,
        }

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Go on from there."""
        for name, actor in self.actors.items():
            actor.restore(saved["actors"][name])
        for name, stage in self.stages.items():
            stage.restore(saved["stages"][name])
        for name, tuned in self.tuned.items():
            tuned.last = saved["last"][name]
        self.happened[:], self.limit = saved["happened"], saved["limit"]


def explained(error: FmuError, events: Sequence[str]) -> FmuError:
    """The error of a component, with the events that gave it NaN just then."""
    if not events:
        return error
    cause = f"{error.cause} Event {listing(events)} gives it NaN. If it does not accept NaN, use `stuck`."
    return FmuError(error.instance, cause, time=error.time, step=error.step, log=error.log)


def watch(event: Event, places: Layout) -> Watch | None:
    """What the loop is to look at for an event."""
    when = event.when
    return None if when is None else Watch(places.index[when.signal], when.level, when.is_above)


class Tuned:
    """A parameter that events change, and these in the order of the file."""

    def __init__(self, part: Part, name: str, experiment: Experiment, marks: Marks, number: int) -> None:
        self.part, self.name, self.experiment, self.marks, self.number = part, name, experiment, marks, number
        self.actors: list[Actor] = []
        self.nominal: Value = 0.0
        self.last: Value = 0.0  # that was set

    def value(self, k: int, until: Actor | None = None) -> Value:
        """Its value for the step that begins at a base step, with all events or with those before one of them."""
        value = self.nominal
        for actor in self.actors:
            if actor is until:
                break
            effect: Effect | None = actor.effect(k)
            value = value if effect is None else effect.of(value)
        return value

    def turn(self, k: int) -> int:
        """Set it where a step of the component begins; the base step at which to do so, if not now."""
        value = self.value(k) if k >= 0 else self.last
        if value == self.last:
            return NEVER
        if not self.actors[0].takes(k):
            return self.actors[0].following(k)
        self.marks[COMPONENT] = self.number
        try:
            self.part.instance.change(self.name, value)
        except FmuError as error:
            names = " and ".join(f"`{actor.event.name}`" for actor in self.actors)
            cause = f"{error.cause.rstrip('.')}; event {names} sets `{self.name}` to {value}."
            raise FmuError(error.instance, cause, time=self.experiment.time(k), step=k, log=error.log) from error
        self.marks[COMPONENT] = MASTER
        self.last = value
        return NEVER
