"""Base step after base step in Python: what loop.c does, with the same calls and bits, wherever that does not load."""

from __future__ import annotations

from collections.abc import Callable

from gapsense.cosim.run.control import controlled
from gapsense.cosim.run.part import Advance, Work
from gapsense.cosim.run.recording import COMPONENT, MASTER, ROWS, STEP, STOP
from gapsense.cosim.run.turns import Solver, Turns
from gapsense.cosim.scenario.records import JACOBI, reporter

Do = Callable[[int], None]


def in_python(work: Work, solver: Solver | None = None) -> Advance:
    """Function that does base steps; the solver does what C can do of loops."""
    if work.experiment.step_control is not None:
        return controlled(work, recorder(work), solver)
    play, turns, record = work.player.into(work.buffer), Turns(work, solver=solver), recorder(work)
    exchange = turns.exchange if work.experiment.method == JACOBI else None
    marks, done, has_news = work.marks, work.begin - 1, reporter(work.watches, work.buffer)

    def advance(until: int) -> int:
        nonlocal done
        for k in range(done + 1, until + 1):
            marks[STEP] = k
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


def recorder(work: Work) -> Do:
    """Function of the base step that adds a row to the record, at every so many of them."""
    recording, columns, decimation, marks = work.recording, work.columns, work.decimation, work.marks
    take, data = work.buffer.take, work.recording.data

    def record(k: int) -> None:
        if not k % decimation:
            take(columns, out=data[recording.rows], mode="clip")
            recording.rows += 1
            marks[ROWS] = recording.rows

    return record
