"""Whose turn it is at a base step, and what components then do: every method, in Python; explicit ones are in C too."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator
from ctypes import c_double
from time import perf_counter
from typing import Any

from gapsense.cosim.fmu.instance import SLOPE
from gapsense.cosim.run.iterate import LOOP, Sweep, renew
from gapsense.cosim.run.part import Part, Stepper, Work, first_turn
from gapsense.cosim.run.recording import COMPONENT, STOP, bin_of
from gapsense.cosim.scenario.records import ITERATIVE, JACOBI
from gapsense.problems import FmuError

Vector = list[float]
PIECES = 1000  # of a step of a loop, at most
LEAST_PIECE = 1e-9  # of a step: what is left of it less than that is rounding
NOBODY: Collection[int] = frozenset()
Solve = Callable[[], bool]  # lets a loop step until it is solved; if it was not, nothing has changed
Solver = Callable[["Turns", Sweep], "Solve | None"]  # how a sweep is solved in C, if it can be


class Turns:
    """Whose turn it is at a base step, and what they then do.

    Parts that are `free` step whenever there is a base step, from the last one on, the others in steps of their own.
    """

    def __init__(self, work: Work, free: Collection[int] = NOBODY, solver: Solver | None = None) -> None:
        self.work, self.parts, self.free, self.k = work, work.parts, free, 0
        self.method = work.experiment.method
        self.last = [first_turn(part.component, work.begin) - part.component.step for part in work.parts]
        self.gone = [p.component.step if last > p.component.offset else 0 for p, last in zip(work.parts, self.last)]
        self.ramps = {i: Ramp(p, work) for i, p in enumerate(work.parts) if p.interpolates(work.experiment)}
        self.takers = [part.taker() for part in work.parts]
        self.steppers: dict[tuple[int, int], Stepper] = {}
        self.seconds, self.count = work.recording.seconds, counter(work)
        loops = {i: tuple(loop) for loop in work.loops for i in loop} if self.method == ITERATIVE else {}
        self.units = [(unit[0], unit) for unit in dict.fromkeys(loops.get(i, (i,)) for i in range(len(work.parts)))]
        self.remembers = any(part.places.earlier for part in work.parts[:1])
        self.looped, self.sweeps = frozenset(loops), dict[tuple[int, ...], Sweep]()
        self.solver, self.in_c = solver, dict[str, "Solve | None"]()
        self.numbers = {part: i for i, part in enumerate(work.parts)}
        self.warned: dict[int, int] = {}
        self.every = [part.component.step for part in work.parts]
        self.start, self.base = work.experiment.start, work.experiment.base_step
        self.passed = self.length = 0.0  # where the piece of a step begins that a loop does, its length; 0: all [s]
        self.stops = True  # the run, where a component has ended

    def step(self, k: int) -> None:
        """Let every part step that is due at a base step, in order, those of a loop until they agree."""
        self.k, last, free, every = k, self.last, self.free, self.every
        if self.remembers:
            self.parts[0].places.remember(self.parts[0].buffer, self.parts[0].texts)
        for i, unit in self.units:
            if i in self.looped:
                if due := tuple(j for j in unit if k == last[j] + every[j] or (j in free and k > last[j])):
                    self.loop(due)
            elif k == last[i] + every[i] or (i in free and k > last[i]):
                self.move(i)
                self.finish(i)

    def loop(self, due: tuple[int, ...]) -> None:
        """Let parts of a loop step, which are due."""
        self.warned = {i: self.parts[i].warnings for i in due}
        sweep = self.sweeps.get(due) or self.prepare_sweep(due)
        if sweep.is_loop:
            self.cut(sweep)
        else:
            for i in due:
                self.move(i)
        for i in due:
            self.finish(i)

    def finish(self, i: int) -> None:
        """A part has done its step."""
        if self.ramps and (ramp := self.ramps.get(i)):
            ramp.keep()
        self.last[i], self.gone[i] = self.k, self.k - self.last[i]
        self.count(i)
        if self.parts[i].ended and self.stops:
            self.work.marks[STOP] = 1

    def prepare_sweep(self, due: tuple[int, ...]) -> Sweep:
        """Prepare the sweep of these parts, with the inverse that was kept of it."""
        sweep = self.sweeps[due] = Sweep([self.parts[i] for i in due], self.work.experiment)
        sweep.inverse = self.work.recording.inverses.setdefault(sweep.names, sweep.inverse)
        self.in_c[sweep.names] = self.solver(self, sweep) if self.solver and sweep.is_loop else None
        return sweep

    def cut(self, sweep: Sweep) -> None:
        """Let a loop step to where its parts say that the step should end, then on from there, until it is over.

        Of outputs that are means others then get the mean of all pieces.
        """
        if not (edges := [place for part in sweep.parts for place in part.edges]):
            return self.solve(sweep)
        means = dict.fromkeys(self.means(sweep), 0.0)
        ramps = [self.ramps[i] for part in sweep.parts if (i := self.numbers[part]) in self.ramps]
        whole = length = (self.k - self.last[self.numbers[sweep.parts[0]]]) * self.base
        for _ in range(PIECES):
            self.solve(sweep)
            edge = min(self.work.buffer[place] for place in edges)
            if 0.0 < edge < length:
                for part in sweep.parts:
                    part.instance.back(LOOP)
                length = float(edge)
            else:
                for place in means:
                    means[place] += self.work.buffer[place] * length
                is_divided = length < whole
                self.passed, length = self.passed + length, whole - self.passed - length
                for ramp in ramps:
                    ramp.keep()
            is_over = length <= LEAST_PIECE * whole
            self.passed, self.length = (0.0, 0.0) if is_over else (self.passed, length)
            for ramp in ramps:
                ramp.piece = self.length
            if is_over:
                for place, total in means.items() if is_divided else ():
                    self.work.buffer[place] = total / whole
                return
        problem = f"a step of the loop of `{sweep.names}` has too many edges for {PIECES} trials. Reduce `base_step`."
        raise FmuError("run", problem, time=self.work.experiment.time(self.k - 1) + self.passed, step=self.k)

    def means(self, sweep: Sweep) -> Iterator[int]:
        """Places of outputs of a loop that are means over a step, as connections say."""
        own = {part.places.index[port] for part in sweep.parts for port in part.outputs}
        for part in self.parts:
            targets = {part.places.inlets[port] for port in part.means}
            yield from (wire.source for wire in part.wires if wire.target in targets and wire.source in own)

    def solve(self, sweep: Sweep) -> None:
        """Let the parts of a loop step until they agree, and count how often."""
        solve = self.in_c[sweep.names]
        if not (solve and solve()) and (unsolved := sweep.solve(self.repeat)):
            begin = self.work.experiment.time(self.last[self.numbers[sweep.parts[0]]])
            raise FmuError("run", unsolved, time=begin, step=self.k)
        counts = self.work.recording.loops.setdefault(sweep.names, [0, 0, 0, 0])
        counts[:2] = counts[0] + 1, counts[1] + sweep.count
        if sweep.count > counts[2]:
            counts[2:] = sweep.count, self.k

    def repeat(self, part: Part, is_again: bool) -> None:
        """Let a part of a loop step, from the state that it had before."""
        begin, i = perf_counter(), self.numbers[part]
        renew(part, is_again)
        part.ended, part.warnings = 0, self.warned[i]
        self.seconds[i] += perf_counter() - begin
        self.move(i)

    def begins(self, first: int) -> float:
        """Time at which the step, or the piece of it that is due, begins, from the base step of its beginning."""
        return self.start + first * self.base + self.passed

    def move(self, i: int) -> None:
        """Let a part step."""
        clock, first, self.work.marks[COMPONENT] = perf_counter(), self.last[i], i + 1
        begin, every = self.begins(first), self.k - first
        if self.ramps and (ramp := self.ramps.get(i)):
            ramp.every, ramp.gone = every, self.gone[i]
        step = None if self.length else self.steppers.get((i, every))
        failed = (step or self.prepare(i, every))(begin)
        self.seconds[i] += perf_counter() - clock
        if failed:
            raise self.parts[i].failure(failed, begin, self.k)

    def prepare(self, i: int, every: int) -> Stepper:
        """Function of the start time that lets a part do a step of so many base steps, or the piece that is due."""
        part, ramp = self.parts[i], self.ramps.get(i)
        take = self.takers[i] if part.follows and self.method != JACOBI else None
        if ramp:
            take = ramp.go_on if self.method == JACOBI else ramp.take
        made = part.stepper(self.length or every * self.base, take)
        if not self.length:
            self.steppers[i, every] = made
        return made

    def exchange(self, k: int) -> None:
        """Give its inputs to every part that begins a step at a base step (Jacobi).

        A row of the record therefore shows the inputs of the step that begins at its time; with Gauss-Seidel it shows
        those of the step that ended there. In both cases it is what the FMU would answer if asked for its inputs.
        """
        for i, part in enumerate(self.parts):
            if self.last[i] == k:
                clock, self.work.marks[COMPONENT] = perf_counter(), i + 1
                if failed := self.takers[i]():
                    raise part.failure(failed, self.work.experiment.time(k), k)
                self.seconds[i] += perf_counter() - clock

    def state(self) -> Any:
        """All that `back` needs beside the states of the components."""
        inputs = {i: [*ramp.old] for i, ramp in self.ramps.items()}
        warnings = [part.warnings for part in self.parts]
        return self.work.buffer.copy(), dict(self.parts[0].texts), [*self.last], [*self.gone], inputs, warnings

    def back(self, state: Any) -> None:
        """Be where this was kept."""
        self.work.buffer[:], texts, self.last[:], self.gone[:], inputs, warnings = state
        self.parts[0].texts.update(texts)
        self.passed = self.length = 0.0
        for i, old in inputs.items():
            self.ramps[i].old[:], self.ramps[i].piece = old, 0.0
        for part, count in zip(self.parts, warnings):
            part.warnings, part.ended = count, 0


def counter(work: Work) -> Callable[[int], None]:
    """Function of the number of a part that counts a step of it; with Jacobi its inputs took their time before."""
    of, spread = work.recording, [memoryview(counts) for counts in work.recording.spread]
    seconds, calls, longest, counted = of.seconds, of.calls, of.longest, of.seconds.copy()

    def count(i: int) -> None:
        took = seconds[i] - counted[i]
        counted[i] = seconds[i]
        if took > longest[i]:
            longest[i] = took
        spread[i][bin_of(took)] += 1
        calls[i] += 1

    return count


# Inputs that go in a straight line. It leads to their new value, so that what leaves one component arrives at the
# other. Where the new value is not known before the step, the line through the last two goes on.


def line(old: float, new: float, duration: float) -> tuple[float, float]:
    """Value at the beginning of a step, and slope; a value that was lost, NaN, has no line before or after it."""
    slope = (new - old) / duration
    return (old, slope) if math.isfinite(slope) else (new, 0.0)


class Ramp:
    """Continuous inputs of a part: what they were when it stepped last, and their slopes in a step."""

    def __init__(self, part: Part, work: Work) -> None:
        channel = next(channel for channel in part.givers if channel.is_in_place)
        own = {port: part.places.variable(port) for port in channel.ports if port not in part.held}
        if work.experiment.method == JACOBI:
            own = {port: variable for port, variable in own.items() if port in part.late}
        own = {p: v for p, v in own.items() if v.variability in ("", "continuous") and p not in part.means}
        self.part, self.buffer, self.places = part, part.buffer, [part.places.index[port] for port in own]
        self.variables = [*own.values()]
        self.base = work.experiment.base_step
        self.every = self.gone = 0  # the step, and the one before, in base steps
        self.piece = 0.0  # of a step [s]; 0: all of it
        now = [self.buffer[place] for place in self.places]
        self.old = work.recording.inputs.setdefault(part.component.name, now)
        self.is_late = [port in part.late for port in own]
        self.slopes = (c_double * len(own))()
        self.tell = part.instance.sloper(self.variables, self.slopes)
        self.copy, self.give, self.new = part.copier(), part.taker(self.put), list(now)

    def put(self) -> None:
        """Take the new values, and put those to where they are given from with which the step begins."""
        self.copy()
        self.set(self.lines())

    def lines(self) -> Vector:
        """Values with which the step begins, after finding the slopes in it."""
        self.new = [self.buffer[place] for place in self.places]
        step, before = self.piece or self.every * self.base, self.gone * self.base or math.inf
        values = zip(self.old, self.new, self.is_late)
        found = [(new, line(old, new, before)[1]) if late else line(old, new, step) for old, new, late in values]
        self.slopes[:] = [slope for _, slope in found]
        return [begin for begin, _ in found]

    def set(self, values: Vector) -> None:
        """Set the inputs in the buffer."""
        for place, value in zip(self.places, values):
            self.buffer[place] = value

    def take(self) -> str:
        """Give the part its inputs at the beginning of the step, and their slopes; what failed, or nothing."""
        failed = self.give()
        self.set(self.new)
        return failed or self.tell_slopes()

    def go_on(self) -> str:
        """Give the part the slopes of the inputs that it has; what failed, or nothing."""
        self.lines()
        return self.tell_slopes()

    def tell_slopes(self) -> str:
        """Tell the slopes; return what failed, or nothing."""
        return self.part.check_status(self.tell(), SLOPE) if self.places else ""

    def keep(self) -> None:
        """The step is over: the next one begins where it has ended."""
        self.old[:] = self.new
