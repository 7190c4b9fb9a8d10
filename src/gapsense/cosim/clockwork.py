"""Who steps at which base step (part i at `offset + j * step`, j >= 1, over the time before), and how long it took."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from time import perf_counter, sleep
from typing import NamedTuple

from gapsense.cosim.part import Part
from gapsense.cosim.recording import COMPONENT, MASTER, PHASE, STEP, STEPPING, Recording
from gapsense.cosim.scenario import Component, Experiment
from gapsense.processes import Marks

BaseStep = Callable[[int], None]


def base_stepper(
    parts: Sequence[Part], experiment: Experiment, recording: Recording, marks: Marks, done: int = 0
) -> BaseStep:
    """Function that does a whole base step, where `done` are done; for Jacobi it exchanges after all have stepped.

    The parts are in execution order; the wall time and the number of the steps of each are added to the recording.
    """
    marks[PHASE] = STEPPING
    step = stepper(parts, experiment, recording, marks, done)
    if experiment.method == "gauss-seidel":
        return step
    exchange = exchanger(parts, experiment, recording.seconds, marks, done)
    if not done:
        exchange(0)

    def both(k: int) -> None:
        step(k)
        exchange(k)

    return both


def next_turn(component: Component, done: int) -> int:
    """The first base step after `done` at which a component is due."""
    return component.offset + component.step * (max(0, done - component.offset) // component.step + 1)


def stepper(parts: Sequence[Part], experiment: Experiment, recording: Recording, marks: Marks, done: int) -> BaseStep:
    """Function of the base step that lets every part step that is due, in order."""
    clock, start, base = perf_counter, experiment.start, experiment.base_step
    is_sequential = experiment.method == "gauss-seidel"
    seconds, calls, component, master = recording.seconds, recording.calls, COMPONENT, MASTER
    due = [next_turn(part.component, done) for part in parts]
    turns = [(i, part.component.step, part.stepper(base, is_sequential)) for i, part in enumerate(parts)]

    def step(k: int) -> None:
        marks[STEP] = k
        last = clock()
        for i, every, advance in turns:
            if due[i] == k:
                marks[component] = i + 1
                begin = start + (k - every) * base
                failed = advance(begin)
                if failed:
                    raise parts[i].failure(failed, begin, k)
                due[i] = k + every
                calls[i] += 1
                now = clock()
                seconds[i] += now - last
                last = now
        marks[component] = master

    return step


def exchanger(parts: Sequence[Part], experiment: Experiment, seconds: list[float], marks: Marks, done: int) -> BaseStep:
    """Function of the base step that gives its inputs to every part that begins a step there (Jacobi).

    A row of the record therefore shows the inputs of the step that begins at its time; with Gauss-Seidel it shows
    those of the step that ended there. In both cases it is what the FMU would answer if asked for its inputs.
    """
    clock, begins = perf_counter, [exchange_after(part.component, done) for part in parts]
    turns = [(i, part.component.step, part.taker()) for i, part in enumerate(parts)]

    def exchange(k: int) -> None:
        last = clock()
        for i, every, take in turns:
            if begins[i] == k:
                marks[COMPONENT] = i + 1
                failed = take()
                if failed:
                    raise parts[i].failure(failed, experiment.time(k), k)
                begins[i] = k + every
                now = clock()
                seconds[i] += now - last
                last = now
        marks[COMPONENT] = MASTER

    return exchange


def exchange_after(component: Component, done: int) -> int:
    """The base step at which a component takes inputs next, when `done` are done."""
    return component.offset if done < max(component.offset, 1) else next_turn(component, done)


def pacer(experiment: Experiment, recording: Recording, done: int) -> BaseStep:
    """Function that sleeps at the end of a base step until its time has come, and notes when it is late."""
    period = experiment.base_step / (experiment.pace or 1.0)
    begin = perf_counter() - done * period

    def wait(k: int) -> None:
        left = begin + k * period - perf_counter()
        if left > 0.0:
            sleep(left)
        else:
            recording.overruns += 1
            recording.lag = max(recording.lag, -left)

    return wait


class Action(NamedTuple):
    """What is done every so many base steps, and at the end."""

    every: int
    do: Callable[[int], None]


def pauses(actions: Sequence[Action], count: int, done: int) -> tuple[int, Callable[[int], int]]:
    """The next base step after which there is something to do, and the function that does it and gives the next one.

    The loop should not have to ask at each step.
    """

    def following(k: int) -> int:
        return min([count, *(k - k % action.every + action.every for action in actions)])

    def pause(k: int) -> int:
        for action in actions:
            if not k % action.every or k == count:
                action.do(k)
        return following(k)

    return following(done), pause
