"""Loops of components that repeat each step from saved states until their values agree: `method = "iterative"`.

The unknowns x (n,) of a loop are the outputs that a component takes before their own component has stepped. A sweep
lets all of its components step, one after the other, which gives these outputs anew, G(x). Sought is a zero of
r(x) = G(x) - x, in units of the nominal values. Sums are exact before they are rounded, so that all machines agree on
the bits.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from ctypes import c_double
from functools import partial
from math import fsum, isfinite
from time import perf_counter

from gapsense.cosim.fmu.instance import SLOPE
from gapsense.cosim.run.loop.reference import counter
from gapsense.cosim.run.part import Part, Stepper, Work, first_turn
from gapsense.cosim.run.recording import COMPONENT, STOP
from gapsense.cosim.scenario.records import Experiment
from gapsense.problems import FmuError

Vector = list[float]
Matrix = list[Vector]
Act = Callable[[Part, bool], None]  # lets a part of a loop act, for the first time or again
PARALLEL = 1e-12  # of its square: what is left of a difference that says nothing new
CHANGE = 1e-6  # of an unknown, for the Jacobian by differences
PIECES = 1000  # of a step of a loop, at most
LEAST_PIECE = 1e-9  # of a step: what is left of it less than that is rounding
PATIENCE = 6  # evaluations beyond 2 n after which secants are given up
ROUNDING = 1e-19  # of a value: with a larger one nothing can be told of its residual
HALVINGS = 12  # of a step that has failed


class Spent(Exception):
    """A loop has had all the evaluations that it may have in a step."""


class Secants:
    """Inverse (n, n) of the Jacobian of r, of pairs dx, dr, and before there are any -1: the step of the fixed point.

    A pair is added by the least change that keeps those before it, which is Anderson acceleration; since the inverse is
    kept from step to step, it is the interface quasi-Newton method of Bogaers et al. (2014).
    """

    def __init__(self, inverse: Matrix) -> None:
        self.inverse = inverse
        self.known: list[Vector] = []  # directions of dr in this step, at right angles

    def towards(self, r: Vector) -> Vector:
        """Change of x that should make r zero."""
        return [-dot(row, r) for row in self.inverse]

    def learn(self, dx: Vector, dr: Vector) -> None:
        """Know from now on that r changes by dr where x changes by dx."""
        self.known = self.known if len(self.known) < len(dr) else []
        new = dr
        for old in self.known:
            new = added(new, old, -dot(old, new) / dot(old, old))
        if dot(new, new) <= PARALLEL * dot(dr, dr):
            self.known, new = [], dr
        size = dot(new, new)
        if size > 0.0 and isfinite(size):
            self.known.append(new)
            self.inverse[:] = [added(row, new, (d - dot(row, dr)) / size) for row, d in zip(self.inverse, dx)]


def dot(a: Vector, b: Vector) -> float:
    """Sum of the products."""
    return fsum(x * y for x, y in zip(a, b))


def added(a: Vector, b: Vector, factor: float) -> Vector:
    """`a + factor * b`."""
    return [x + factor * y for x, y in zip(a, b)]


def identity(n: int, value: float) -> Matrix:
    """Matrix with a value on the diagonal."""
    return [[value * (i == j) for j in range(n)] for i in range(n)]


def inverted(columns: Matrix) -> Matrix | None:
    """Inverse of a matrix that is given by its columns, by elimination with pivots; None if it has none."""
    n = len(columns)
    rows = [[*(column[i] for column in columns), *one] for i, one in enumerate(identity(n, 1.0))]
    for k in range(n):
        pivot = max(range(k, n), key=lambda i: abs(rows[i][k]))
        rows[k], rows[pivot] = rows[pivot], rows[k]
        if not (rows[k][k] and isfinite(rows[k][k])):
            return None
        rows[k] = [value / rows[k][k] for value in rows[k]]
        rows = [row if i == k else added(row, rows[k], -row[k]) for i, row in enumerate(rows)]
    return [row[n:] for row in rows]


class Sweep:
    """Parts of a loop that step at the same base step, in order."""

    def __init__(self, parts: Sequence[Part], experiment: Experiment) -> None:
        self.parts, self.experiment, self.count = parts, experiment, 0
        self.names = ", ".join(part.component.name for part in parts)
        self.buffer, self.texts, places = parts[0].buffer, parts[0].texts, parts[0].places
        ports = list(places.variables)
        owners = {places.index[port]: k for k, part in enumerate(parts) for port in part.outputs}
        wires = ((k, wire.source) for k, part in enumerate(parts) for wire in part.wires)
        torn = sorted({source for k, source in wires if owners.get(source, -1) >= k})
        self.ports = {place: ports[place] for place in torn}
        self.variables = {place: places.variables[port] for place, port in self.ports.items()}
        self.unknowns = [place for place in torn if self.variables[place].type == "Real"]
        self.others = [place for place in torn if place not in self.unknowns]
        inside = {part.component.name for part in parts}
        self.said = [said for part in parts for _, said in part.spoken if said.component in inside]
        self.nominals = [self.variables[place].nominal for place in self.unknowns]
        self.inverse, self.is_settled = identity(len(self.unknowns), -1.0), True
        self.limits: Vector = []  # of residuals, wider where the last value was more than the nominal one
        self.best: tuple[float, Vector, Vector] = (0.0, [], [])  # the least residual, where it was, and all of it

    @property
    def is_loop(self) -> bool:
        """True if a component waits for one that steps after it."""
        return bool(self.unknowns or self.others or self.said)

    def discrete(self) -> list[object]:
        """Values that are no real numbers; once they stay the same the loop may be solved."""
        return [*(self.buffer[place] for place in self.others), *(self.texts[port] for port in self.said)]

    def evaluate(self, x: Vector, act: Act) -> Vector:
        """Residual of unknowns in units of their nominal values."""
        if self.count >= self.experiment.loop_evaluations:
            raise Spent
        for place, value in zip(self.unknowns, x):
            self.buffer[place] = value
        before, is_again = self.discrete(), self.count > 0
        self.count += 1
        for part in self.parts:
            act(part, is_again)
        self.is_settled = self.discrete() == before
        return [(self.buffer[place] - value) / one for place, value, one in zip(self.unknowns, x, self.nominals)]

    def is_solved(self, x: Vector, r: Vector) -> bool:
        """True if every residual is small, and not only since x is so large that it cannot be told."""
        found = zip(x, r, self.nominals, self.limits)
        are_small = all(abs(own) <= most and abs(v / one) * ROUNDING <= most for v, own, one, most in found)
        return are_small and self.is_settled

    def solve(self, act: Act) -> str:
        """Act until the residual is small, at last with what solves the loop; else a sentence that says what is not."""
        self.count = 0
        try:
            self.search(act)
        except Spent:
            return self.unsolved()
        return ""

    def search(self, act: Act) -> None:
        """Take steps of the secants until the loop is solved.

        Where these do not find it, they are made anew by differences, at the best point so far, and from then on a step
        that makes the residual larger is halved, as always one of which a component fails.
        """
        secants, since, is_careful, n = Secants(self.inverse), 0, False, len(self.unknowns)
        x = [self.buffer[place] for place in self.unknowns]
        most = self.experiment.loop_tolerance
        self.limits = [most * max(1.0, abs(value / one)) for value, one in zip(x, self.nominals)]
        r = self.evaluate(x, act)
        self.best = size(r), x, r
        while not self.is_solved(x, r):
            if n and since > 2 * n + PATIENCE:
                _, x, r = self.best
                self.differ(x, r, act)
                secants, since, is_careful = Secants(self.inverse), 0, True
            new, found = self.step(x, r, secants.towards(r), is_careful, act)
            secants.learn([(b - a) / one for a, b, one in zip(x, new, self.nominals)], added(found, r, -1.0))
            x, r, since = new, found, since + 1
            self.best = min(self.best, (size(r), x, r))

    def step(self, x: Vector, r: Vector, dx: Vector, is_careful: bool, act: Act) -> tuple[Vector, Vector]:
        """The point after a step and its residual; the step is halved until no component fails."""
        for left in range(HALVINGS, -1, -1):
            new = [v + one * d for v, d, one in zip(x, dx, self.nominals)]
            try:
                found = self.evaluate(new, act)
                if not left or not is_careful or size(found) <= size(r):
                    break
            except FmuError:
                if not left or any(part.instance.is_dead for part in self.parts):
                    raise
            dx = [0.5 * d for d in dx]
        return new, found

    def differ(self, x: Vector, r: Vector, act: Act) -> None:
        """Make the inverse Jacobian at x, of which the residual is r, by differences."""
        columns: Matrix = []
        for j, (value, one) in enumerate(zip(x, self.nominals)):
            change = CHANGE * max(1.0, abs(value / one))
            found = self.evaluate([v + one * change * (i == j) for i, v in enumerate(x)], act)
            columns.append([(a - b) / change for a, b in zip(found, r)])
        self.inverse[:] = inverted(columns) or identity(len(x), -1.0)

    def unsolved(self) -> str:
        """That the loop was not solved, with the residuals at the best point, the largest first."""
        off = sorted(zip(self.unknowns, *self.best[1:], self.nominals), key=lambda one: -abs(one[2]))
        said = [
            f"`{self.ports[place]}` = {value:.6g} comes back as {value + own * one:.6g}{self.unit(place)}, off by "
            f"{abs(own):.3g} of its nominal value"
            for place, value, own, one in off
        ]
        others = [*(self.ports[place] for place in self.others), *self.said]
        said += [f"`{port}` does not settle" for port in others if not self.is_settled]
        return (
            f"the loop of `{self.names}` was not solved in {self.count} evaluations: {'; '.join(said)}; "
            f"{self.experiment.loop_tolerance:.3g} expected. Reduce `base_step`, raise `loop_tolerance` or "
            "`loop_evaluations` in `[experiment]`, or open the loop with `delayed = true` in `[[connections]]`."
        )

    def unit(self, place: int) -> str:
        """Unit of an unknown, to stand behind its number."""
        unit = self.variables[place].unit
        return f" {unit}" if unit else ""


def size(r: Vector) -> float:
    """Largest residual."""
    return max(map(abs, r), default=0.0)


def renew(part: Part, is_again: bool) -> None:
    """Keep the state of a part, or bring it back to that."""
    if is_again:
        part.instance.back()
    else:
        part.instance.hold()


# At the start: first by inputs and outputs in initialization mode, which FMI foresees for loops; what then still
# changes when this mode ends, as in FMUs that compute nothing before, is repeated from saved states.


def start_loop(parts: Sequence[Part], experiment: Experiment, mark: Callable[[Part], None]) -> int:
    """Bring the parts of a loop to their start; evaluations."""
    calls = {part: (part.taker(), part.reader()) for part in parts}

    def act(part: Part, is_again: bool, leaves: bool) -> None:
        mark(part)
        renew(part, is_again)
        take, read = calls[part]
        failed = take()
        if leaves and not failed:
            part.instance.call("fmi2ExitInitializationMode")
        if failed := failed or read():
            raise part.failure(failed, experiment.time(part.component.offset), 0)

    sweep, evaluations = Sweep(parts, experiment), 0
    for leaves in (False, True):
        if unsolved := sweep.solve(partial(act, leaves=leaves)):
            raise FmuError("run", unsolved, time=experiment.start, step=0)
        evaluations += sweep.count
    return evaluations


# Inputs that go to their new value in a straight line: then what leaves one component arrives at the other.


def can_ramp(part: Part, experiment: Experiment) -> bool:
    """True for a part that takes slopes of its inputs, and should."""
    can = part.instance.description.can_interpolate and experiment.inputs == "linear"
    return can and part.follows and any(channel.is_in_place for channel in part.givers)


def line(old: float, new: float, duration: float) -> tuple[float, float]:
    """Value at the beginning of a step, and slope; a value that was lost, NaN, has no line before or after it."""
    slope = (new - old) / duration
    return (old, slope) if isfinite(slope) else (new, 0.0)


class Ramp:
    """Continuous inputs of a part: what they were when it stepped last, and their slopes in a step."""

    def __init__(self, part: Part, work: Work) -> None:
        channel = next(channel for channel in part.givers if channel.is_in_place)
        own = {port: part.places.variable(port) for port in channel.ports}
        own = {p: v for p, v in own.items() if v.variability in ("", "continuous") and p not in part.means}
        self.part, self.buffer, self.places = part, part.buffer, [part.places.index[port] for port in own]
        self.duration = part.component.step * work.experiment.base_step
        now = [self.buffer[place] for place in self.places]
        self.old = work.recording.inputs.setdefault(part.component.name, now)
        self.slopes = (c_double * len(own))()
        self.tell = part.instance.sloper([*own.values()], self.slopes)
        self.copy, self.give, self.new = part.copier(), part.taker(self.put), list(now)

    def put(self) -> None:
        """Take the new values, and put the old ones to where they are given from."""
        self.copy()
        self.new = [self.buffer[place] for place in self.places]
        lines = [line(old, new, self.duration) for old, new in zip(self.old, self.new)]
        self.slopes[:] = [slope for _, slope in lines]
        self.set([begin for begin, _ in lines])

    def set(self, values: Vector) -> None:
        """Set the inputs in the buffer."""
        for place, value in zip(self.places, values):
            self.buffer[place] = value

    def take(self) -> str:
        """Give the part its inputs at the beginning of the step, and their slopes; what failed, or nothing."""
        failed = self.give()
        self.set(self.new)
        return failed or (self.part.checked(self.tell(), SLOPE) if self.places else "")

    def keep(self) -> None:
        """The step is over: the next one begins where it has ended."""
        self.old[:] = self.new


# In every base step.


def iterating(work: Work) -> Callable[[int], None]:
    """Function of the base step that lets every part step that is due, in order, those of a loop until they agree."""
    turns = Turns(work)

    def step(k: int) -> None:
        turns.begin(k)
        for unit in turns.units:
            if due := tuple(i for i in unit if turns.due[i] == k):
                turns.take(due)

    return step


class Turns:
    """Whose turn it is at a base step, and what they then do."""

    def __init__(self, work: Work) -> None:
        self.work, self.parts, self.buffer, self.k = work, work.parts, work.parts[0].buffer, 0
        base = work.experiment.base_step
        self.due = [first_turn(part.component, work.begin) for part in work.parts]
        self.ramps = {part: Ramp(part, work) for part in work.parts if can_ramp(part, work.experiment)}
        takes = [self.ramps[part].take if part in self.ramps else None for part in work.parts]
        self.steppers = [part.stepper(base, True, take) for part, take in zip(work.parts, takes)]
        self.count = counter(work)
        self.numbers = {part: i for i, part in enumerate(work.parts)}
        in_loop = {i: tuple(loop) for loop in work.loops for i in loop}
        self.units = [*dict.fromkeys(in_loop.get(i, (i,)) for i in range(len(work.parts)))]
        self.sweeps: dict[tuple[int, ...], Sweep] = {}
        self.gone = self.length = 0.0  # where the piece of a step begins that a loop does, and its length; 0: all [s]
        self.warned: list[int] = []

    def begin(self, k: int) -> None:
        """Begin a base step: keep the values that delayed connections carry."""
        self.k = k
        for part in self.parts[:1]:
            part.places.remember(part.buffer, part.texts)

    def take(self, due: tuple[int, ...]) -> None:
        """Let parts of a unit step, which are due."""
        sweep = self.sweeps.get(due) or self.prepared(due)
        self.warned = [part.warnings for part in self.parts]
        if sweep.is_loop:
            self.cut(sweep)
        else:
            for part in sweep.parts:
                self.act(part)
        for i in due:
            self.due[i] = self.k + self.parts[i].component.step
            self.count(i)
            if ramp := self.ramps.get(self.parts[i]):
                ramp.keep()
        if any(part.ended for part in sweep.parts):
            self.work.marks[STOP] = 1

    def prepared(self, due: tuple[int, ...]) -> Sweep:
        """The sweep of these parts, with the inverse that was kept of it."""
        sweep = self.sweeps[due] = Sweep([self.parts[i] for i in due], self.work.experiment)
        sweep.inverse = self.work.recording.inverses.setdefault(sweep.names, sweep.inverse)
        return sweep

    def cut(self, sweep: Sweep) -> None:
        """Let a loop step to where its parts say that the step should end, then on from there, until it is over."""
        edges = [place for part in sweep.parts for place in part.edges]
        if not edges:
            return self.solve(sweep)
        ramps = [self.ramps[part] for part in sweep.parts if part in self.ramps]
        whole = length = sweep.parts[0].component.step * self.work.experiment.base_step
        for _ in range(PIECES):
            self.solve(sweep)
            edge = min(self.buffer[place] for place in edges)
            if 0.0 < edge < length:
                for part in sweep.parts:
                    part.instance.back()
                length = edge
            else:
                self.gone, length = self.gone + length, whole - self.gone - length
                for ramp in ramps:
                    ramp.keep()
            is_over = length <= LEAST_PIECE * whole
            self.gone, self.length = (0.0, 0.0) if is_over else (self.gone, length)
            for ramp in ramps:
                ramp.duration = whole if is_over else length
            if is_over:
                return
        problem = f"a step of the loop of `{sweep.names}` has too many edges for {PIECES} trials. Reduce `base_step`."
        raise FmuError("run", problem, time=self.work.experiment.time(self.k - 1) + self.gone, step=self.k)

    def stepper(self, i: int) -> Stepper:
        """Function of the start time that lets a part do its step, or the piece of it that is due."""
        if not self.length:
            return self.steppers[i]
        part = self.parts[i]
        ramp = self.ramps.get(part)
        return part.stepper(self.length / part.component.step, True, ramp.take if ramp else None)

    def solve(self, sweep: Sweep) -> None:
        """Let the parts of a loop step until they agree, and count how often."""
        if unsolved := sweep.solve(self.repeat):
            raise FmuError("run", unsolved, time=self.work.experiment.time(self.k - 1), step=self.k)
        counts = self.work.recording.loops.setdefault(sweep.names, [0, 0, 0, 0])
        counts[:2] = counts[0] + 1, counts[1] + sweep.count
        if sweep.count > counts[2]:
            counts[2:] = sweep.count, self.k

    def repeat(self, part: Part, is_again: bool) -> None:
        """Let a part of a loop step, from the state that it had before."""
        begin = perf_counter()
        renew(part, is_again)
        self.work.recording.seconds[self.numbers[part]] += perf_counter() - begin
        self.act(part)

    def act(self, part: Part) -> None:
        """Let a part step."""
        i, every, experiment = self.numbers[part], part.component.step, self.work.experiment
        self.work.marks[COMPONENT], part.ended, part.warnings = i + 1, 0, self.warned[i]
        begin, last = experiment.start + (self.k - every) * experiment.base_step + self.gone, perf_counter()
        failed = self.stepper(i)(begin)
        self.work.recording.seconds[i] += perf_counter() - last
        if failed:
            raise part.failure(failed, begin, self.k)
