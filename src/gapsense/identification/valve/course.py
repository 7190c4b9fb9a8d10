"""How far an identification is: simulations of all records that are done, and those that are to be expected."""

from __future__ import annotations

from typing import NamedTuple

from gapsense._os.workers import Progress

JACOBIANS = 12  # of a fit to the first operations, about
PARAMETERS = 7
TRIALS = 9  # fits for each level of forms, three forms from three starts; as many for the readings of the voltage
WHOLE = 8  # Jacobians of the fits to everything


class Expected(NamedTuple):
    """Samples that the phases simulate."""

    starts: float
    readings: float
    forms: float
    whole: float


NOTHING = Expected(0.0, 0.0, 0.0, 0.0)


def _silent(done: int, total: int) -> None:
    """Nobody looks."""


def expected(firsts: int, samples: int, starts: int, readings: int, forms: int) -> Expected:
    """For so many samples of the first operations and of all, and so many of what is tried."""
    one = float(JACOBIANS * PARAMETERS * firsts)
    tried = TRIALS * one * min(forms, 1)
    return Expected(starts * one, min(readings, 1) * (readings * one + tried), tried, WHOLE * PARAMETERS * samples)


class Course:
    """Counts what is simulated; what a phase took less or more than expected changes the end."""

    def __init__(self, progress: Progress = _silent, phases: Expected = NOTHING, samples: int = 1) -> None:
        self.progress, self.phases, self.samples = progress, phases._asdict(), samples
        self.done, self.since = 0, 0  # samples simulated, and when the phase began

    def __call__(self, simulated: int) -> None:
        """So many samples have been simulated by now."""
        self.done = simulated
        self._tell()

    def begins(self, phase: str) -> None:
        """The phases before this one are over."""
        for name in list(self.phases):
            if name == phase:
                break
            self.phases.pop(name)
        self.since = self.done
        self._tell()

    def _tell(self) -> None:
        used = self.done - self.since
        now, *later = self.phases.values()
        left = max(now - used, 0.1 * now) + sum(later)
        self.progress(round(self.done / self.samples), round((self.done + left) / self.samples) + 1)
