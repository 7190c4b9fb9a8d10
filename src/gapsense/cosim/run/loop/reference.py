"""Base step after base step in Python: what loop.c does, with the same calls and bits, wherever that does not load."""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter

from gapsense.cosim.run.part import Advance, Work, first_exchange, first_turn
from gapsense.cosim.run.recording import COMPONENT, MASTER, ROWS, STEP, STOP, bin_of
from gapsense.cosim.scenario.records import reporter

Do = Callable[[int], None]


def in_python(work: Work, step: Do | None = None) -> Advance:
    """Function that does base steps; `step` lets the components step, if not each for itself."""
    play, step, record = work.player.into(work.buffer), step or stepper(work), recorder(work)
    exchange = exchanger(work) if work.experiment.method == "jacobi" else None
    marks, done, has_news = work.marks, work.begin - 1, reporter(work.watches, work.buffer)

    def advance(until: int) -> int:
        nonlocal done
        for k in range(done + 1, until + 1):
            marks[STEP] = k
            play(k)
            step(k)
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


def stepper(work: Work) -> Do:
    """Function of the base step that lets every part step that is due, in order."""
    clock, parts, marks = perf_counter, work.parts, work.marks
    start, base = work.experiment.start, work.experiment.base_step
    seconds, count = work.recording.seconds, counter(work)
    is_sequential = work.experiment.method == "gauss-seidel"
    due = [first_turn(part.component, work.begin) for part in parts]
    turns = [(i, part.component.step, part.stepper(base, is_sequential)) for i, part in enumerate(parts)]

    def step(k: int) -> None:
        last = clock()
        for i, every, advance in turns:
            if due[i] == k:
                marks[COMPONENT] = i + 1
                begin = start + (k - every) * base
                failed = advance(begin)
                if failed:
                    raise parts[i].failure(failed, begin, k)
                if parts[i].ended:
                    marks[STOP] = 1
                due[i] = k + every
                now = clock()
                seconds[i] += now - last
                last = now
                count(i)

    return step


def counter(work: Work) -> Do:
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


def exchanger(work: Work) -> Do:
    """Function of the base step that gives its inputs to every part that begins a step there (Jacobi).

    A row of the record therefore shows the inputs of the step that begins at its time; with Gauss-Seidel it shows
    those of the step that ended there. In both cases it is what the FMU would answer if asked for its inputs.
    """
    clock, parts, marks, seconds = perf_counter, work.parts, work.marks, work.recording.seconds
    begins = [first_exchange(part.component, work.begin) for part in parts]
    turns = [(i, part.component.step, part.taker()) for i, part in enumerate(parts)]

    def exchange(k: int) -> None:
        last = clock()
        for i, every, take in turns:
            if begins[i] == k:
                marks[COMPONENT] = i + 1
                failed = take()
                if failed:
                    raise parts[i].failure(failed, work.experiment.time(k), k)
                begins[i] = k + every
                now = clock()
                seconds[i] += now - last
                last = now

    return exchange


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
