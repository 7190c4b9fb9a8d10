"""`step_control`: values are exchanged as seldom as an error allows. Steps are done as one, and again as two halves.

A step ends at every row of the record, where a component has an instant of its own, and where an event begins or ends.
In between, the components that take any step do one of 2 h base steps. From saved states they then do two of h. The
difference is the error of the two. If it is small enough they count; else they are done again with a smaller h.
"""

from __future__ import annotations

from collections.abc import Callable
from math import sqrt
from typing import Any

from gapsense.cosim.run.part import Advance, Part, Work
from gapsense.cosim.run.recording import COMPONENT, MASTER, STEP, STOP
from gapsense.cosim.run.turns import Solver, Turns
from gapsense.cosim.scenario.records import JACOBI, reporter
from gapsense.problems import FmuError

HELD = "step"  # what the state is held for
CAUTION, GROWTH, SHORTER = 0.9, 2.0, 0.1  # of what the error allows; at most and at least, of the step before
NEW = {"next": 1, "done": 0, "rejected": 0, "shortest": 0, "longest": 0, "beyond": 0, "worst": 0.0, "at": 0, "of": ""}


def make_controlled(work: Work, record: Callable[[int], None], solver: Solver | None = None) -> Advance:
    """Make the function that does steps until a base step is reached or passed; it returns the last one done."""
    control, done = Control(work, solver), work.begin - 1

    def advance(until: int) -> int:
        nonlocal done
        while done < until:
            done = control.go(done)
            work.marks[COMPONENT] = MASTER
            record(done)
            work.recording.warnings[:] = [part.warnings for part in work.parts]
            work.marks[STOP] = work.marks[STOP] or int(control.has_ended())
            if work.marks[STOP] or control.has_news():
                break
        return done

    return advance


class Control:
    """How far the next step goes, and whether it was too long."""

    def __init__(self, work: Work, solver: Solver | None = None) -> None:
        from gapsense.cosim.check import is_free  # here, so that other runs start fast

        self.work, self.parts, self.experiment = work, work.parts, work.experiment
        about = [(part.component, part.instance.description) for part in work.parts]
        self.free = frozenset(i for i, one in enumerate(about) if is_free(*one))
        self.turns, self.play = Turns(work, self.free, solver), work.player.into(work.buffer)
        self.turns.stops = False  # a step may be done again
        self.has_news = reporter(work.watches, work.buffer)
        self.told = work.recording.steps
        self.told.update({**NEW, "next": self.experiment.shortest_step, **self.told})
        for i in self.free:
            self.turns.gone[i] = self.told.get("gone", {}).get(self.parts[i].component.name, 0)
        own = [self.parts[i] for i in sorted(self.free) if not self.parts[i].instance.description.is_random]
        wires = [(part, wire) for part in work.parts for wire in part.wires]
        seen = {*work.columns.tolist(), *(wire.source for _, wire in wires)}
        means = {w.source for part, w in wires if w.target in {part.places.inlets[port] for port in part.means}}
        ports = [(part.places, port) for part in own for port in part.outputs if is_smooth(part, port)]
        self.judged = {places.index[p]: p for places, p in ports if places.index[p] in seen}
        self.nominals = [places.variables[p].nominal for places, p in ports if places.index[p] in seen]
        self.means = [place in means for place in self.judged]

    def has_ended(self) -> bool:
        """True if a component has ended the run."""
        return any(part.ended for part in self.parts)

    def go(self, k: int) -> int:
        """Do what comes after base step k, -1 before the first; the base step that is reached."""
        if k < 0:
            self.reach(0)
            return 0
        room, least = self.room(k), self.experiment.shortest_step
        if room < 2 * least:
            self.reach(k + room)
            return self.done(k, k + room)
        for part in self.parts:
            part.instance.hold(HELD)
        state = self.turns.state()
        h = self.fit(min(self.told["next"], self.experiment.longest_step or room), room)
        while (end := self.pair(k, h, state)) is None:
            self.told["rejected"] += 1
            self.back(state)
            h = max(least, min(h // 2, self.told["next"]))
        return end

    def room(self, k: int) -> int:
        """Base steps up to the next one at which a step has to end."""
        every = self.work.decimation
        ends = [self.experiment.count, k - k % every + every, self.work.limit()]
        for i, part in enumerate(self.parts):
            if part.component.offset > k:
                ends.append(part.component.offset)
            elif i not in self.free:
                ends.append(self.turns.last[i] + part.component.step)
        return min(end for end in ends if end > k) - k

    def fit(self, h: int, room: int) -> int:
        """Half of a pair that is about as long as wanted, such that pairs of it fill the room."""
        return max(self.experiment.shortest_step, room // (2 * -(-room // (2 * h))))

    def reach(self, k: int) -> None:
        """Let all step that are due at a base step."""
        self.work.marks[STEP] = k
        self.play(k)
        self.turns.step(k)
        if self.experiment.method == JACOBI:
            self.turns.exchange(k)

    def back(self, state: Any) -> None:
        """Be where this was kept."""
        for part in self.parts:
            part.instance.back(HELD)
        self.turns.back(state)

    def pair(self, k: int, h: int, state: Any) -> int | None:
        """Two steps of h base steps, after one of 2 h; where they end, or None if they were too long."""
        is_least, before = h <= self.experiment.shortest_step, self.values()
        once, middle = self.once(k + 2 * h), before
        self.back(state)
        try:
            for end in (k + h, k + 2 * h):
                self.reach(end)
                if self.has_news() or self.has_ended():
                    self.told["next"] = max(1, h // 2)
                    return self.done(k, end) if is_least else None
                middle = self.values() if end == k + h else middle
        except FmuError:
            if is_least or any(part.instance.is_dead for part in self.parts):
                raise
            return None
        off, name = self.off(before, middle, once)
        if off > 1.0 and not is_least:
            self.told["next"] = self.next(h, off)
            return None
        if off > 1.0:
            self.told["beyond"] += 1
        if off > self.told["worst"]:
            self.told.update(worst=off, at=end, of=name)
        self.told["next"] = max(self.next(h, off), self.told["next"] if off <= CAUTION**2 else 0)
        self.done(k, k + h)
        return self.done(k + h, end)

    def once(self, end: int) -> list[float] | None:
        """Values after a single step up to there, or None if a component fails of that."""
        try:
            self.reach(end)
        except FmuError:
            if any(part.instance.is_dead for part in self.parts):
                raise
            return None
        return self.values()

    def values(self) -> list[float]:
        """The outputs that are judged."""
        return [float(self.work.buffer[place]) for place in self.judged]

    def off(self, before: list[float], middle: list[float], once: list[float] | None) -> tuple[float, str]:
        """What the pair and the single step differ by, over what is allowed, and the output that differs most."""
        now = self.values()
        if once is None:
            return 1.0 / SHORTER**2, ""
        worst, name = 0.0, ""
        for port, first, half, one, two, nominal, is_mean in zip(
            self.judged.values(), before, middle, once, now, self.nominals, self.means
        ):
            found = abs(one - (0.5 * (half + two) if is_mean else two)) / max(nominal, abs(first))
            if found > worst:
                worst, name = found, str(port)
        return worst / (self.experiment.step_control or 1.0), name

    def next(self, h: int, off: float) -> int:
        """The step that should keep the error, which grows with its square."""
        factor = min(GROWTH, max(SHORTER, CAUTION / sqrt(off))) if off > 0.0 else GROWTH
        return max(self.experiment.shortest_step, int(factor * h))

    def done(self, begin: int, end: int) -> int:
        """Count a step; its end."""
        self.told["done"] += 1
        self.told["shortest"] = min(self.told["shortest"] or end - begin, end - begin)
        self.told["longest"] = max(self.told["longest"], end - begin)
        self.told["gone"] = {self.parts[i].component.name: self.turns.gone[i] for i in sorted(self.free)}
        return end


def is_smooth(part: Part, port: Any) -> bool:
    """True for an output that has an error and no jumps, and does not say when in a step an edge comes."""
    variable = part.places.variable(port)
    is_continuous = variable.type == "Real" and variable.variability in ("", "continuous")
    return is_continuous and part.places.index[port] not in part.edges
