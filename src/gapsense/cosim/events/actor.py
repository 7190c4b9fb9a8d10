"""One event in a run: when it is on, and what it makes of a value. Everything is counted in base steps."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import lru_cache
from hashlib import sha256
from struct import unpack
from typing import Any

from gapsense.cosim.events.event import Buffer, Event, Watch
from gapsense.cosim.scenario.elements import Component, Experiment, index_of, steps_of
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


@dataclass(frozen=True)
class Effect:
    """`factor * value + bias`, or without a factor `bias` whatever the value is."""

    factor: float | None
    bias: Value

    def of(self, value: Value) -> Value:
        """What becomes of a value."""
        return self.bias if self.factor is None else self.factor * float(value) + float(self.bias)


class Actor:
    """An event on a target that takes values at the base steps `offset + j * step`, j >= `first`.

    After base step k the moment `k + lead` is prepared: an input takes its value in the next base step, a parameter
    holds for the step that begins now.
    """

    def __init__(
        self, event: Event, experiment: Experiment, component: Component, lead: int, watch: Watch | None, seed: int
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


# Random numbers of events: each belongs to an event, a seed and a base step, whoever asks for it, and how often.


@lru_cache(maxsize=64)
def noise(name: str, seed: int, k: int) -> float:
    """Number of standard normal distribution for an event at a base step; the same bits everywhere."""
    from gapsense.kernels.random import M1, M2, normal  # here, so that what has no noise starts fast

    words = unpack("<6I", sha256(f"{name} {seed} {k}".encode()).digest()[:24])
    state = [float(word % int(m)) for word, m in zip(words, (M1, M1, M1, M2, M2, M2))]
    return float(normal(state)[1])
