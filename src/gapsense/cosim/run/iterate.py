"""Loops of components that repeat each step from saved states until their values agree: `method = "iterative"`.

The unknowns x (n,) of a loop are the outputs that a component takes before their own component has stepped. A sweep
lets all of its components step, one after the other, which gives these outputs anew, G(x). Sought is a zero of
r(x) = G(x) - x, in units of the nominal values. Sums go from left to right, so that all machines, and loop.c, agree on
the bits.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from itertools import pairwise
from math import isfinite

from gapsense.cosim.run.part import Part
from gapsense.cosim.scenario.records import Experiment
from gapsense.problems import FmuError

Vector = list[float]
Matrix = list[Vector]
Act = Callable[[Part, bool], None]  # lets a part of a loop act, for the first time or again
PARALLEL = 1e-12  # of its square: what is left of a difference that says nothing new
CHANGE = 1e-6  # of an unknown, for the Jacobian by differences
PATIENCE = 6  # evaluations beyond 2 n after which secants are given up
ROUNDING = 1e-19  # of a value: with a larger one nothing can be told of its residual
HALVINGS, SHORTER = 12, 2  # of a step that has failed, and of one that has made the residual larger
THIRD = 3  # of so many steps between two points one goes to their middle
LOOP = "loop"  # what the state is held for


class Spent(Exception):
    """A loop has had all the evaluations that it may have in a step."""


class Secants:
    """Inverse (n, n) of the Jacobian of r, of pairs dx, dr, and before there are any -1: the step of the fixed point.

    A pair is added by the least change that keeps those before it, which is Anderson acceleration. With an inverse that
    is kept from step to step, it is the interface quasi-Newton method of Bogaers et al. (2014).
    """

    def __init__(self, inverse: Matrix) -> None:
        self.inverse = inverse
        self.known: list[Vector] = []  # directions of dr in this step, at right angles

    def learn(self, dx: Vector, dr: Vector) -> None:
        """Know from now on that r changes by dr where x changes by dx."""
        self.known = self.known if len(self.known) < len(dr) else []
        new = dr
        for old in self.known:
            new = add_scaled(new, old, -dot(old, new) / dot(old, old))
        if dot(new, new) <= PARALLEL * dot(dr, dr):
            self.known, new = [], dr
        size = dot(new, new)
        if size > 0.0 and isfinite(size):
            self.known.append(new)
            self.inverse[:] = [add_scaled(row, new, (d - dot(row, dr)) / size) for row, d in zip(self.inverse, dx)]


def dot(a: Vector, b: Vector) -> float:
    """Sum of the products; `sum` of Python 3.12 rounds differently."""
    total = 0.0
    for x, y in zip(a, b):
        total += x * y
    return total


def add_scaled(a: Vector, b: Vector, factor: float) -> Vector:
    """Return `a + factor * b`."""
    return [x + factor * y for x, y in zip(a, b)]


def identity(n: int, value: float) -> Matrix:
    """Matrix with a value on the diagonal."""
    return [[value * (i == j) for j in range(n)] for i in range(n)]


def invert_matrix(columns: Matrix) -> Matrix | None:
    """Invert a matrix that is given by its columns, by elimination with pivots; None if it has no inverse."""
    n = len(columns)
    rows = [[*(column[i] for column in columns), *one] for i, one in enumerate(identity(n, 1.0))]
    for k in range(n):
        pivot = max(range(k, n), key=lambda i: abs(rows[i][k]))
        rows[k], rows[pivot] = rows[pivot], rows[k]
        if not (rows[k][k] and isfinite(rows[k][k])):
            return None
        rows[k] = [value / rows[k][k] for value in rows[k]]
        rows = [row if i == k else add_scaled(row, rows[k], -row[k]) for i, row in enumerate(rows)]
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
        least = {place: self.variables[place].nominal for place in self.unknowns}
        takers = {inlet: places.variables[port].nominal for port, inlet in places.inlets.items()}
        for wire in (wire for part in parts for wire in part.wires if wire.source in least and wire.factor):
            least[wire.source] = min(least[wire.source], takers[wire.target] / abs(wire.factor))
        self.nominals = [*least.values()]
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
        """Act until the residual is small, at last with what solves the loop; else a sentence that says what is not.

        A component that fails of more than the values with which the step begins tells of the loop too.
        """
        self.count, self.best = 0, (0.0, [], [])
        try:
            self.search(act)
        except Spent:
            return self.describe_failure()
        except FmuError as error:
            if not self.best[1]:
                raise
            raise error.adding(f"It fails in a trial: {self.describe_failure()}") from error
        return ""

    def search(self, act: Act) -> None:
        """Take steps of the secants until the loop is solved.

        If they do not find the solution, new secants are made by differences: first at the best point so far, from
        where a step that makes the residual larger is halved. If that fails too, they are made where the steps have
        led, and so in turn. A single unknown then stays between two points of unlike residuals. A step of which a
        component fails is halved.
        """
        secants, since, tries, n = Secants(self.inverse), 0, 0, len(self.unknowns)
        x = [self.buffer[place] for place in self.unknowns]
        most = self.experiment.loop_tolerance
        self.limits = [most * max(1.0, abs(value / one)) for value, one in zip(x, self.nominals)]
        r = self.evaluate(x, act)
        self.best, points = (size(r), x, r), [(x, r)]
        while not self.is_solved(x, r):
            if n and since > 2 * n + PATIENCE:
                tries += 1
                if tries % 2:
                    _, x, r = self.best
                self.differ(x, r, act)
                secants, since = Secants(self.inverse), 0
            dx = [-dot(row, r) for row in secants.inverse]  # that should make r zero
            ends = bracket_solution(points) if tries and n == 1 else []
            if ends and (since % THIRD == THIRD - 1 or not ends[0] < x[0] + dx[0] * self.nominals[0] < ends[1]):
                dx = [(0.5 * sum(ends) - x[0]) / self.nominals[0]]
            new, found = self.step(x, r, dx, tries % 2 > 0 and not ends, act)
            secants.learn([(b - a) / one for a, b, one in zip(x, new, self.nominals)], add_scaled(found, r, -1.0))
            x, r, since = new, found, since + 1
            self.best = min(self.best, (size(r), x, r))
            points.append((x, r))

    def step(self, x: Vector, r: Vector, dx: Vector, is_careful: bool, act: Act) -> tuple[Vector, Vector]:
        """The point after a step and its residual; the step is halved until no component fails."""
        for left in range(HALVINGS, -1, -1):
            new = [v + one * d for v, d, one in zip(x, dx, self.nominals)]
            try:
                found = self.evaluate(new, act)
                if not is_careful or size(found) <= size(r) or left <= HALVINGS - SHORTER:
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
        self.inverse[:] = invert_matrix(columns) or identity(len(x), -1.0)

    def describe_failure(self) -> str:
        """Say that the loop was not solved, with the residuals at the best point, the largest first."""
        off = sorted(zip(self.unknowns, *self.best[1:], self.nominals), key=lambda one: -abs(one[2]))
        said = [
            f"`{self.ports[place]}` = {value:.9g} comes back as {value + own * one:.9g}{self.unit(place)}, off by "
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


def bracket_solution(points: Sequence[tuple[Vector, Vector]]) -> Vector:
    """Find, of one unknown, the neighbours of unlike sign of residual nearest to a solution; empty without any."""
    pairs = [(max(size(r), size(q)), *x, *y) for (x, r), (y, q) in pairwise(sorted(points)) if r[0] * q[0] < 0.0]
    return [*min(pairs)[1:]] if pairs else []


def renew(part: Part, is_again: bool) -> None:
    """Keep the state of a part, or bring it back to that."""
    if is_again:
        part.instance.back(LOOP)
    else:
        part.instance.hold(LOOP)


# At the start: first by inputs and outputs in initialization mode, which FMI provides for loops. Some FMUs compute
# nothing before this mode ends: what still changes then is repeated from saved states.


def start_loop(parts: Sequence[Part], experiment: Experiment, mark: Callable[[Part], None]) -> None:
    """Bring the parts of a loop to their start."""
    calls = {part: (part.taker(), part.reader()) for part in parts}

    def act(part: Part, is_again: bool, leaves: bool) -> None:
        """Exchange values with a part, from the state that it had before, and let it leave the initialization mode."""
        mark(part)
        renew(part, is_again)
        take, read = calls[part]
        failed = take()
        if leaves and not failed:
            part.instance.call("fmi2ExitInitializationMode")
        if failed := failed or read():
            raise part.failure(failed, experiment.time(part.component.offset), 0)

    sweep = Sweep(parts, experiment)
    for leaves in (False, True):
        if unsolved := sweep.solve(partial(act, leaves=leaves)):
            raise FmuError("run", unsolved, time=experiment.start, step=0)
