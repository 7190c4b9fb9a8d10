"""Who steps at which base step, and how long it took."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from time import perf_counter, sleep

from gapsense.cosim.part import Part
from gapsense.cosim.scenario import Experiment

BaseStep = Callable[[int], None]


class Clockwork:
    """The parts of a run in execution order; part i steps at `offset + j * step`, j >= 1, over the time before."""

    def __init__(self, parts: Sequence[Part], experiment: Experiment) -> None:
        self.parts, self.experiment = parts, experiment
        self.steps = [part.component.step for part in parts]
        self.offsets = [part.component.offset for part in parts]
        self.seconds = [0.0] * len(parts)
        self.calls = [0] * len(parts)

    def stepper(self) -> BaseStep:
        """Function of the base step that lets every part step that is due, in order."""
        parts, seconds, calls, clock = self.parts, self.seconds, self.calls, perf_counter
        start, base = self.experiment.start, self.experiment.base_step
        due = [offset + every for offset, every in zip(self.offsets, self.steps)]
        is_sequential = self.experiment.method == "gauss-seidel"
        advances = [part.stepper(base, takes_inputs=is_sequential) for part in parts]
        turns = list(zip(range(len(parts)), self.steps, advances))

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

    def exchanger(self) -> BaseStep:
        """Function of the base step that gives its inputs to every part that begins a step there (Jacobi).

        A row of the record therefore shows the inputs of the step that begins at its time; with Gauss-Seidel it shows
        those of the step that ended there. In both cases it is what the FMU would answer if asked for its inputs.
        """
        parts, steps, seconds, clock, time = self.parts, self.steps, self.seconds, perf_counter, self.experiment.time
        begins, takers, everyone = list(self.offsets), [part.taker() for part in parts], range(len(parts))

        def exchange(k: int) -> None:
            last = clock()
            for i in everyone:
                if begins[i] == k:
                    failed = takers[i]()
                    if failed:
                        raise parts[i].failure(failed, time(k), k)
                    begins[i] = k + steps[i]
                    now = clock()
                    seconds[i] += now - last
                    last = now

        return exchange

    def base_stepper(self) -> BaseStep:
        """Function that does a whole base step; for Jacobi it exchanges after all have stepped."""
        step = self.stepper()
        if self.experiment.method == "gauss-seidel":
            return step
        exchange = self.exchanger()
        exchange(0)

        def both(k: int) -> None:
            step(k)
            exchange(k)

        return both


class Pacer:
    """Sleeps at the end of each base step until its time has come, and notes when it is late."""

    def __init__(self, experiment: Experiment) -> None:
        self.period = experiment.base_step / (experiment.pace or 1.0)
        self.overruns, self.lag, self.begin = 0, 0.0, perf_counter()

    def wait(self, index: int) -> None:
        """Wait for the end of base step `index`."""
        left = self.begin + index * self.period - perf_counter()
        if left > 0.0:
            sleep(left)
        else:
            self.overruns += 1
            self.lag = max(self.lag, -left)
