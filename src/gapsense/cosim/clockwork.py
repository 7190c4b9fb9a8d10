"""Who steps at which base step (part i at `offset + j * step`, j >= 1, over the time before), and how long it took."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from time import perf_counter

from gapsense.cosim.part import Part
from gapsense.cosim.scenario import Experiment

BaseStep = Callable[[int], None]


def base_stepper(parts: Sequence[Part], experiment: Experiment, seconds: list[float], calls: list[int]) -> BaseStep:
    """Function that does a whole base step; for Jacobi it exchanges after all have stepped.

    The parts are in execution order; the wall time and the number of the steps of each are added to the lists.
    """
    step = stepper(parts, experiment, seconds, calls)
    if experiment.method == "gauss-seidel":
        return step
    exchange = exchanger(parts, experiment, seconds)
    exchange(0)

    def both(k: int) -> None:
        step(k)
        exchange(k)

    return both


def stepper(parts: Sequence[Part], experiment: Experiment, seconds: list[float], calls: list[int]) -> BaseStep:
    """Function of the base step that lets every part step that is due, in order."""
    clock, start, base = perf_counter, experiment.start, experiment.base_step
    is_sequential = experiment.method == "gauss-seidel"
    due = [part.component.offset + part.component.step for part in parts]
    turns = [(i, part.component.step, part.stepper(base, is_sequential)) for i, part in enumerate(parts)]

    def step(k: int) -> None:
        last = clock()
        for i, every, advance in turns:
            if due[i] == k:
                begin = start + (k - every) * base
                failed = advance(begin)
                if failed:
                    raise parts[i].failure(failed, begin, k)
                due[i] = k + every
                calls[i] += 1
                now = clock()
                seconds[i] += now - last
                last = now

    return step


def exchanger(parts: Sequence[Part], experiment: Experiment, seconds: list[float]) -> BaseStep:
    """Function of the base step that gives its inputs to every part that begins a step there (Jacobi).

    A row of the record therefore shows the inputs of the step that begins at its time; with Gauss-Seidel it shows
    those of the step that ended there. In both cases it is what the FMU would answer if asked for its inputs.
    """
    clock, begins = perf_counter, [part.component.offset for part in parts]
    turns = [(i, part.component.step, part.taker()) for i, part in enumerate(parts)]

    def exchange(k: int) -> None:
        last = clock()
        for i, every, take in turns:
            if begins[i] == k:
                failed = take()
                if failed:
                    raise parts[i].failure(failed, experiment.time(k), k)
                begins[i] = k + every
                now = clock()
                seconds[i] += now - last
                last = now

    return exchange
