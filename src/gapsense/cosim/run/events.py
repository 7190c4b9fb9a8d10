"""Events of a run: when each is on and what it makes of a value, prepared between two base steps.

The loop over base steps does as many at once as there are between two changes; what is on meanwhile is part of its
copies from outputs to inputs. Everything is counted in base steps.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import lru_cache, partial
from hashlib import sha256
from struct import unpack
from typing import Any

import numpy as np
import numpy.typing as npt

from gapsense._os.processes import Marks
from gapsense.cosim.run.part import Effect, Layout, Part, Stage
from gapsense.cosim.run.recording import COMPONENT, MASTER
from gapsense.cosim.scenario.records import (
    Buffer,
    Component,
    Event,
    Experiment,
    Threshold,
    index_of,
    reporter,
    steps_of,
)
from gapsense.problems import FmuError, listing
from gapsense.tables import Value

NEVER = sys.maxsize


@dataclass
class Track:
    """Where an event stands: all that it remembers. Begin and end are known of one that is due or on."""

    begin: int | None = None
    end: int | None = None
    is_on: bool = False
    is_armed: bool = True  # the condition may count: it has not held since the last time
    since: int | None = None  # it holds
    is_watched: bool = False  # it is looked at
    held: Value = 0.0  # what the target was just before


class Actor:
    """An event on a target that takes values at the base steps `offset + j * step`, j >= `first`.

    After base step k the moment `k + lead` is prepared: an input takes its value in the next base step, a parameter
    holds for the step that begins now.
    """

    def __init__(
        self, event: Event, experiment: Experiment, component: Component, lead: int, watch: Threshold | None, seed: int
    ) -> None:
        self.watch = watch
        self.event, self.lead, self.step, self.offset = event, lead, component.step, component.offset
        self.first = 1 if lead and experiment.method == "gauss-seidel" else 0
        self.over, self.duration = steps_of(event.over, experiment), steps_of(event.duration, experiment)
        when = event.when
        self.lasting = steps_of(when.lasting, experiment) if when else 0
        self.after = index_of(when.after, experiment) if when and when.after is not None else 0  # nothing is before 0
        self.track, self.seed = Track(), seed
        if event.at is not None and event.enabled:
            self.track.begin = index_of(event.at, experiment)
            self.track.end = self.ending(self.track.begin)
            if event.until is not None:
                self.track.end = index_of(event.until, experiment)

    @property
    def is_waiting(self) -> bool:
        """True if the condition is looked at."""
        return self.event.enabled and self.event.when is not None and self.track.begin is None

    def ending(self, begin: int) -> int | None:
        """The base step at which it is over, by its duration."""
        return begin + self.duration if self.duration else None

    def turn(self, k: int, buffer: Buffer, before: Callable[[], Value]) -> int:
        """Prepare the next moment after base step k; 1 where the event begins, -1 where it ends, 0 else."""
        track, m = self.track, k + self.lead
        track.is_watched = self.is_waiting and k >= self.after
        if self.watch and track.is_watched and self.fires(k, self.watch.look(buffer)):
            track.begin, track.end = m, self.ending(m)
        is_on = track.begin is not None and track.begin <= m and (track.end is None or m < track.end)
        change, track.is_on = is_on - track.is_on, is_on
        if change > 0:
            track.held = before()
        if change < 0 and self.event.when is not None and self.event.when.again:
            track.begin = track.end = None
        self.tell()
        return change

    def fires(self, k: int, holds: bool) -> bool:
        """True if the condition has held for long enough, the first time since it did not hold."""
        track = self.track
        if not holds:
            track.since, track.is_armed = None, True
            return False
        track.since = k if track.since is None else track.since
        fires = track.is_armed and k - track.since >= self.lasting
        track.is_armed = track.is_armed and not fires
        return fires

    def tell(self) -> None:
        """Let the loop look at the condition, or not."""
        if self.watch:
            self.watch.is_on, self.watch.holds = self.is_waiting and self.track.is_watched, self.track.since is not None

    def takes(self, m: int) -> bool:
        """True if the target takes a value at a base step; all do at the initialization."""
        j, rest = divmod(m - self.offset, self.step)
        return m == 0 or (not rest and j >= self.first)

    def share(self, m: int) -> float:
        """How much of the event is there, from 0 to 1."""
        since = m - (self.track.begin or 0)
        return 1.0 if since >= self.over else since / self.over

    def effect(self, m: int) -> Effect | None:
        """What it does to a value, or None while it is off."""
        if not self.track.is_on:
            return None
        size = noise(self.event.name, self.seed, m) if self.event.is_random else self.share(m)
        return effect(self.event, size, self.track)

    def due(self, k: int) -> int:
        """The next base step after which `turn` is needed."""
        track, m = self.track, k + self.lead
        if self.is_waiting:
            return self.news(k)
        if track.begin is None or (track.end is not None and m >= track.end):
            return NEVER
        if m < track.begin:
            return track.begin - self.lead
        end = NEVER if track.end is None else track.end - self.lead
        return min(end, self.following(k)) if self.event.is_random or m - track.begin < self.over else end

    def news(self, k: int) -> int:
        """The next base step at which the condition, as it now is, may count: the loop tells when it changes."""
        if not self.track.is_watched:
            return max(k + 1, self.after)
        is_counting = self.track.is_armed and self.track.since is not None
        return (self.track.since or 0) + self.lasting if is_counting else NEVER

    def following(self, k: int) -> int:
        """The next base step after which a value that the target takes is to be prepared."""
        m = max(k + self.lead + 1, self.offset + self.first * self.step)
        return m + (self.offset - m) % self.step - self.lead

    def state(self) -> dict[str, Any]:
        """All that it remembers, of JSON."""
        return asdict(self.track)

    def restore(self, saved: dict[str, Any]) -> None:
        """Go on from there."""
        self.track = Track(**saved)
        self.tell()


def effect(event: Event, share: float, track: Track) -> Effect:
    """What an action does to a value; `share` is how much of it is there, of noise a number of deviation 1."""
    if event.action in ("stuck", "dropout"):
        return Effect(None, track.held if event.action == "stuck" else math.nan)
    value = event.value if event.value is not None else 0.0
    if event.action == "set" or (event.action == "ramp" and share >= 1.0):
        return Effect(None, value)
    number = float(value)
    if event.action == "ramp":
        return Effect(None, float(track.held) + share * (number - float(track.held)))
    if event.action == "scale":
        return Effect(number if share >= 1.0 else 1.0 + share * (number - 1.0), 0.0)
    return Effect(1.0, number * share)


# Random numbers of events: each belongs to an event, a seed and a base step, however often it is asked for.


@lru_cache(maxsize=64)
def noise(name: str, seed: int, k: int) -> float:
    """Number of standard normal distribution for an event at a base step; the same bits everywhere."""
    from gapsense.kernels.random import M1, M2, normal  # here, so that runs without noise start fast

    words = unpack("<6I", sha256(f"{name} {seed} {k}".encode()).digest()[:24])
    state = [float(word % int(m)) for word, m in zip(words, (M1, M1, M1, M2, M2, M2))]
    return float(normal(state)[1])


# All events of a run: between two base steps they are prepared for the next one, and what happened is noted.


Happened = list[list[Any]]  # event, base steps of its begin and its end, None while it is on


def actors(
    events: Mapping[str, Event],
    experiment: Experiment,
    components: Mapping[str, Component],
    places: Layout,
    seeds: Mapping[str, int],
) -> dict[str, Actor]:
    """What each of the events of `Subject.resolved` does."""
    return {
        name: Actor(
            event=event,
            experiment=experiment,
            component=components[event.target.component],
            lead=int(name in places.slots),
            watch=Threshold(places.index[when.signal], when.level, when.is_above) if (when := event.when) else None,
            seed=seeds.get(event.seed_name, event.seed),
        )
        for name, event in events.items()
    }


def tellers(events: Mapping[str, Event]) -> dict[str, str]:
    """An event becomes one for each target: the one of these that reports it."""
    return {event.name: key for key, event in reversed([*events.items()])}


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
        components = {name: part.component for name, part in by_name.items()}
        self.actors = actors(events, experiment, components, places, seeds)
        self.stages: dict[str, Stage] = {}
        self.tuned: dict[str, Tuned] = {}
        for name, event in events.items():
            part, actor = by_name[event.target.component], self.actors[name]
            if actor.lead:
                self.stages[name] = part.stages[name]
            else:
                number = parts.index(part) + 1
                own = Tuned(part=part, name=event.target.variable, experiment=experiment, marks=marks, number=number)
                self.tuned.setdefault(str(event.target), own).actors.append(actor)
        self.watches = [actor.watch for actor in self.actors.values() if actor.watch]
        self.has_news = reporter(self.watches, buffer)
        self.first = tellers(events)
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

    def explain(self, error: FmuError) -> FmuError:
        """Add to the error of a component the events that give it NaN just then."""
        on = [a.event for a in self.actors.values() if a.event.action == "dropout" and a.track.is_on]
        names = [event.name for event in on if event.target.component == error.instance]
        told = f"Event {listing(names)} gives it NaN. If it does not accept NaN, use `stuck`."
        return error.adding(told) if names else error

    def begin(self, parameters: Mapping[str, Value]) -> None:
        """Take the values that parameters have at the start."""
        for name, tuned in self.tuned.items():
            tuned.nominal = tuned.last = parameters[name]

    def state(self) -> dict[str, Any]:
        """Everything that is needed to go on, as JSON; values in the buffer are saved with the buffer."""
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
