"""The loop over base steps of a run: in C where its library loads, in Python anywhere else, with the same bits."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable, Sequence
from functools import cache, partial
from pathlib import Path
from typing import Any

from gapsense._os.native import structures
from gapsense._os.processes import MARKS
from gapsense.cosim.fmu.instance import FATAL, SLOPE, STEP, referring
from gapsense.cosim.run import iterate
from gapsense.cosim.run.control import make_controlled
from gapsense.cosim.run.iterate import LOOP, PARALLEL, ROUNDING, Sweep
from gapsense.cosim.run.part import NOT_FINITE, Advance, Channel, Part, Work, first_exchange, first_turn
from gapsense.cosim.run.recording import COMPONENT, MASTER, ROWS, STOP
from gapsense.cosim.run.recording import STEP as STEP_MARK
from gapsense.cosim.run.turns import Ramp, Solve, Solver, Turns
from gapsense.cosim.scenario.records import ITERATIVE, JACOBI, reporter

__all__ = ["Advance", "Work", "advancer", "language"]


def language() -> str:
    """What the loop is written in, as a result tells it."""
    return "C" if entry() else "Python"


def advancer(work: Work) -> Advance:
    """Function that does base steps up to a given one, and says how far it came."""
    experiment = work.experiment
    is_needed = (  # what does more than one step after the other, with values that hold in them
        experiment.method == ITERATIVE
        or experiment.step_control is not None
        or any(part.interpolates(experiment) for part in work.parts)
    )
    run = None if is_needed else entry()
    work.recording.loop = "C" if run else "Python only" if is_needed else "Python"
    if run:
        return in_c(work, run)
    return in_python(work, partial(in_loop, work) if entry("solve") else None)


# Base steps in Python: what loop.c does, with the same calls and bits, wherever that does not load.


def in_python(work: Work, solver: Solver | None = None) -> Advance:
    """Function that does base steps; the solver does what C can do of loops."""
    if work.experiment.step_control is not None:
        return make_controlled(work, recorder(work), solver)
    play, turns, record = work.player.into(work.buffer), Turns(work, solver=solver), recorder(work)
    exchange = turns.exchange if work.experiment.method == JACOBI else None
    marks, done, has_news = work.marks, work.begin - 1, reporter(work.watches, work.buffer)

    def advance(until: int) -> int:
        nonlocal done
        for k in range(done + 1, until + 1):
            marks[STEP_MARK] = k
            play(k)
            turns.step(k)
            if exchange:
                exchange(k)
            marks[COMPONENT] = MASTER
            record(k)
            done = k
            work.recording.warnings[:] = [part.warnings for part in work.parts]
            if marks[STOP] or has_news():
                break
        return done

    return advance


def recorder(work: Work) -> Callable[[int], None]:
    """Function of the base step that adds a row to the record, at every so many of them."""
    recording, columns, decimation, marks = work.recording, work.columns, work.decimation, work.marks
    take, data = work.buffer.take, work.recording.data

    def record(k: int) -> None:
        if not k % decimation:
            take(columns, out=data[recording.rows], mode="clip")
            recording.rows += 1
            marks[ROWS] = recording.rows

    return record


# Base steps in C, many per call: what loop.c works on, and what its answers mean.


SOURCE = Path(__file__).resolve().with_name("loop.c")
BINARY = SOURCE.with_name("linux64") / "loop.so"
DONE, AT_SET, AT_STEP, AT_GET, AT_CHECK, IN_PYTHON, AT_SLOPE, AT_HOLD, AT_BACK, UNSOLVED = range(10)  # what failed
IN_STATE = {AT_HOLD: "fmi2GetFMUstate", AT_BACK: "fmi2SetFMUstate"}
NAMED = {AT_SLOPE: SLOPE, **IN_STATE}
PythonStep = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_double)
PythonTake = ctypes.CFUNCTYPE(ctypes.c_int)
MADE = structures(SOURCE.read_text("utf-8"))
NAMES = ("Link", "Exchange", "Part", "Watch", "Loop", "Cycle", "Ramp")
Link, Exchange, PartInC, WatchInC, Loop, Cycle, RampInC = (MADE[name] for name in NAMES)
Number = MADE["int64_t"]
PATIENCE = 0.05  # seconds after which Python looks up: only then it learns of a Ctrl-C in a native FMU


def in_c(work: Work, run: Callable[..., int]) -> Advance:
    """Function that does base steps; `run` is that of the library."""
    guests = [Guest(part, work) for part in work.parts]
    parts = (PartInC * len(guests))(*(structure(guest, i, work) for i, guest in enumerate(guests)))
    loop, player = whole(work, parts), work.player
    changing = [guest for guest in guests if guest.part.stages and guest.part.is_direct]

    def advance(until: int) -> int:
        last = min(until, player.provide(loop.next))
        for guest in changing:
            renew(guest)
        for place, watch in enumerate(work.watches):
            state = {"is_above": watch.is_above, "is_on": watch.is_on, "holds": watch.holds}
            loop.watches[place] = WatchInC(place=watch.place, level=watch.level, **state)
        loop.played, loop.played_from = player.block.ctypes.data, player.begin
        try:
            while cause := run(loop, last):
                if cause != AT_STEP or not is_ended(guests[loop.part], loop, parts[loop.part]):
                    raise failure(guests[loop.part], loop, cause)
                work.marks[STOP], last = 1, int(loop.next)  # what is left of this base step, the row too
        finally:  # whatever is raised, a KeyboardInterrupt perhaps
            keep(work, loop, parts)
        return int(loop.next) - 1

    return advance


def is_ended(guest: Guest, loop: Any, structure: Any) -> bool:
    """True if the step that C could not go on from was the orderly end of its component: it then counts as done."""
    instance, begin = guest.part.instance, loop.time
    instance.last = loop.last
    loop.status = instance.judge_step(loop.status, begin, structure.duration)
    if not guest.part.has_ended(loop.status):
        return False
    if failed := guest.part.read_outputs():
        raise guest.part.failure(failed, begin, loop.next)
    structure.steps_at = loop.next + structure.every
    structure.calls += 1
    return True


class Guest:
    """A part in the loop in C. What only Python can move is called back, and what that fails of is kept."""

    def __init__(self, part: Part, work: Work) -> None:
        self.part, self.failed, self.marks = part, "", work.marks
        self.error: BaseException | None = None
        base, is_sequential = work.experiment.base_step, work.experiment.method != JACOBI
        # Connections into the part, and after them the stages of events, in order:
        self.links = (Link * (len(part.wires) + len(part.stages)))(*part.wires)
        self.takes_first = is_sequential and part.follows
        if not part.is_direct:
            take = part.taker()
            self.step = PythonStep(
                self.note_failure(part.stepper(part.component.step * base, take if self.takes_first else None))
            )
            self.take = PythonTake(self.note_failure(take))

    def note_failure(self, act: Callable[..., str]) -> Callable[..., int]:
        """Make a function that does the same, says whether it failed, and never raises."""

        def do(*arguments: float) -> int:
            try:
                self.failed = act(*arguments)
                self.marks[STOP] = self.marks[STOP] or int(self.part.ended > 0)
            except BaseException as error:  # raised when C has returned
                self.error = error
                return 1
            return int(bool(self.failed))

        return do


def structure(guest: Guest, i: int, work: Work) -> Any:
    """What loop.c needs to know of part `i`."""
    part, component, recording = guest.part, guest.part.component, work.recording
    common = {
        "duration": component.step * work.experiment.base_step,
        "every": component.step,
        "steps_at": first_turn(component, work.begin),
        "takes_at": first_exchange(component, work.begin),
        "calls": recording.calls[i],
        "warnings": recording.warnings[i],
        "seconds": recording.seconds[i],
        "counted": recording.seconds[i],
        "longest": recording.longest[i],
        "spread": recording.spread[i].ctypes.data,
    }
    if not part.is_direct:
        return PartInC(**common, python_step=address(guest.step), python_take=address(guest.take))
    return PartInC(
        **common,
        fmi=part.instance.description.fmi,
        instance=part.instance.pointer,
        inputs=exchange(part, part.givers),
        outputs=exchange(part, part.readers),
        do_step=address(part.instance.function(STEP)),
        links=guest.links,
        link_count=len(guest.links),
        follows=guest.takes_first,
    )


def renew(guest: Guest) -> None:
    """Let the links do what the stages now say."""
    stages, first = guest.part.stages.values(), len(guest.links) - len(guest.part.stages)
    for place, stage in enumerate(stages, first):
        guest.links[place] = Link(
            target=stage.slot.after, source=stage.source, converts=stage.converts, factor=stage.factor, bias=stage.bias
        )


def exchange(part: Part, channels: Sequence[Channel]) -> Any:
    """The call that moves values, if there are any, for C."""
    for c in channels:
        entry = address(part.instance.function(c.function))
        references, values = map(ctypes.addressof, (c.references, c.values))
        return Exchange(entry, references, len(c.references), values, value_count=len(c.values))
    return Exchange()


def whole(work: Work, parts: Any) -> Any:
    """What loop.c needs to know of the run."""
    experiment = work.experiment
    return Loop(
        parts=parts,
        part_count=len(parts),
        buffer=work.buffer.ctypes.data,
        start=experiment.start,
        base_step=experiment.base_step,
        is_jacobi=experiment.method == JACOBI,
        decimation=work.decimation,
        columns=work.columns.ctypes.data,
        column_count=len(work.columns),
        data=work.recording.data.ctypes.data,
        rows=work.recording.rows,
        places=work.player.places.ctypes.data,
        place_count=len(work.player.places),
        marks=ctypes.addressof((Number * MARKS).from_buffer(work.marks)),
        patience=PATIENCE,
        watches=(WatchInC * len(work.watches))(),
        watch_count=len(work.watches),
        next=work.begin,
    )


def keep(work: Work, loop: Any, parts: Any) -> None:
    """Take over what was recorded and counted."""
    work.recording.rows = loop.rows
    work.recording.seconds[:] = [part.seconds for part in parts]
    work.recording.longest[:] = [part.longest for part in parts]
    work.recording.calls[:] = [part.calls for part in parts]
    near = [part.is_direct for part in work.parts]
    work.recording.warnings[:] = [c.warnings if n else p.warnings for c, p, n in zip(parts, work.parts, near)]


def failure(guest: Guest, loop: Any, cause: int) -> BaseException:
    """Error for what the loop returned."""
    part = guest.part
    if cause == IN_PYTHON:
        return guest.error or part.failure(guest.failed, loop.time, loop.next)
    part.status = loop.status
    called = {AT_SET: part.givers, AT_GET: part.readers}.get(cause, ())
    what = NAMED.get(cause, STEP if cause == AT_STEP else NOT_FINITE)
    return part.failure(called[0].function if called else what, loop.time, loop.next)


# Loops that repeat their steps: base steps are in Python, and the search for a solution in C.


def in_loop(work: Work, turns: Turns, sweep: Sweep) -> Solve | None:
    """Function that solves a loop in C, by the secants of iterate.py; none if only Python can move its values."""
    run = entry("solve")
    is_plain = sweep.unknowns and not (sweep.others or sweep.said) and all(part.is_direct for part in sweep.parts)
    return InLoop(work, turns, sweep, run) if run and is_plain else None


class InLoop:
    """A loop in C. What it does not solve Python does again, from where it was, in its own words."""

    def __init__(self, work: Work, turns: Turns, sweep: Sweep, run: Callable[..., int]) -> None:
        n, of = len(sweep.unknowns), work.experiment
        self.turns, self.sweep, self.run = turns, sweep, run
        self.guests = {work.parts.index(part): Guest(part, work) for part in sweep.parts}
        self.parts = (PartInC * len(self.guests))(*(self.part(i, guest, work) for i, guest in self.guests.items()))
        self.rows = [*zip(self.guests, self.guests.values(), self.parts)]
        self.rising = [(i, Rising(turns.ramps[i]), part) for i, _, part in self.rows if i in turns.ramps]
        for _, rising, part in self.rising:
            part.ramp = ctypes.pointer(rising.in_c)
        self.loop, self.inverse, self.size = whole(work, self.parts), doubles([0.0] * n * n), n
        self.kept = doubles(sweep.nominals), doubles([0.0] * n * (n + 7)), doubles([0.0] * len(work.buffer))
        self.places = (Number * n)(*sweep.unknowns)
        nominals, space, before = map(ctypes.addressof, self.kept)
        self.cycle = Cycle(
            loop=ctypes.pointer(self.loop),
            unknowns=ctypes.addressof(self.places),
            unknown_count=n,
            nominals=nominals,
            tolerance=of.loop_tolerance,
            parallel=PARALLEL,
            rounding=ROUNDING,
            patience=2 * n + iterate.PATIENCE,
            most=of.loop_evaluations,
            inverse=ctypes.addressof(self.inverse),
            space=space,
            before=before,
            size=len(work.buffer),
        )

    @staticmethod
    def part(i: int, guest: Guest, work: Work) -> Any:
        """What loop.c needs to know of a part of a loop."""
        made, instance = structure(guest, i, work), guest.part.instance
        made.number, made.held = i, ctypes.addressof(instance.held.setdefault(LOOP, ctypes.c_void_p()))
        made.get_state, made.set_state = (address(instance.function(name)) for name in IN_STATE.values())
        return made

    def __call__(self) -> bool:
        """Let the parts step until they agree; true if they do."""
        turns, n = self.turns, self.size
        self.loop.next = turns.k
        for i, guest, part in self.rows:
            first = turns.last[i]
            part.begins, part.duration = turns.begins(first), turns.length or (turns.k - first) * turns.base
            part.warned, part.seconds = turns.warned[i], 0.0
            if guest.part.stages:
                renew(guest)
        for i, rising, _ in self.rising:
            rising.begin(turns.gone[i])
        self.inverse[:] = [value for row in self.sweep.inverse for value in row]
        said = [len(guest.part.instance.messages) for guest in self.guests.values()]
        cause = self.run(self.cycle)
        for i, guest, part in self.rows:
            turns.seconds[i] += part.seconds
            if not cause:
                guest.part.warnings, guest.part.ended = part.warnings, 0
        if cause:
            self.go_back(cause, said)
            return False
        for _, rising, _ in self.rising:
            rising.end()
        self.sweep.count = self.cycle.count
        self.sweep.inverse[:] = [self.inverse[n * i : n * i + n] for i in range(n)]
        return True

    def go_back(self, cause: int, said: Sequence[int]) -> None:
        """Be at the beginning of the step again, unless a part can never be."""
        if self.loop.status == FATAL:
            raise failure([*self.guests.values()][self.loop.part], self.loop, cause)
        for part, count in zip(self.sweep.parts[: self.cycle.begun], said):
            part.instance.back(LOOP)
            while len(part.instance.messages) > count:  # which it will say again
                part.instance.messages.pop()


class Rising:
    """Inputs in a straight line, of a part of a loop."""

    def __init__(self, ramp: Ramp) -> None:
        self.ramp, self.count = ramp, len(ramp.places)
        self.values, self.references = doubles([*ramp.old, *ramp.old]), referring(ramp.variables)
        self.orders = (ctypes.c_int * self.count)(*[1] * self.count)
        self.places, self.are_late = ((Number * self.count)(*of) for of in (ramp.places, ramp.is_late))
        kept = (self.references, ramp.slopes, self.places, self.are_late, self.values)
        names = ("references", "slopes", "places", "are_late", "values")
        self.in_c = RampInC(
            entry=address(ramp.part.instance.function(SLOPE)),
            count=self.count,
            orders=self.orders,
            **dict(zip(names, map(ctypes.addressof, kept))),
        )

    def begin(self, gone: int) -> None:
        """Begin a step, after one of so many base steps."""
        self.values[: self.count] = self.ramp.old
        self.in_c.before = gone * self.ramp.base or math.inf

    def end(self) -> None:
        """Have done a step."""
        self.ramp.new = self.values[self.count :]


def doubles(values: Sequence[float]) -> Any:
    """An array for C."""
    return (ctypes.c_double * len(values))(*values)


# The C library that does base steps, for Linux on x86-64.


def entry(name: str = "loop") -> Callable[..., int] | None:
    """Function of the library, or None where it does not load: Python then does the same, more slowly."""
    return load_function(BINARY, name)


@cache
def load_function(binary: Path, name: str) -> Callable[..., int] | None:
    """Load a function of a library."""
    try:
        function: Any = getattr(ctypes.CDLL(str(binary)), name)
    except (OSError, AttributeError):  # another platform, no file, or not ours
        return None
    function.argtypes = {"loop": [ctypes.POINTER(Loop), Number], "solve": [ctypes.POINTER(Cycle)]}[name]
    found: Callable[..., int] = function
    return found


def address(function: Any) -> int | None:
    """Address of a function that ctypes has loaded."""
    return ctypes.cast(function, ctypes.c_void_p).value
