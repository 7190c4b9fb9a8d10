"""What the Monte Carlo studies of [RTS] share: the reference, the nominal model, the randomness, the process noise."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from gapsense.estimators.reduced_model import Model
from gapsense.estimators.rts import Floats, motions
from gapsense.studies.tasks import Facts

from .batch import MOVING, Tuning, Varied
from .cycle import Samples, reference, sampled
from .models import chunks, errors, fitted, noise, nominal, perturbed
from .reference import process_noise

NOISE = 2e-3  # sigma_i (58) [A]
OPERATIONS = ("making", "breaking")


class Study(NamedTuple):
    """What all runs share: the reference, the nominal model, and the randomness."""

    samples: Samples
    model: Model
    seed: int = 1
    noise_current: float = NOISE

    def facts(self) -> dict[str, Any]:
        """The same for JSON."""
        samples = {name: values.tolist() for name, values in self.samples._asdict().items()}
        return {**self._asdict(), "samples": samples, "model": [*self.model]}


def studied(core: str, seed: int) -> Study:
    """The soft-landing cycle of Fig. 5, with the core of the reduced model as asked for: fitted, or published."""
    if core not in ("fitted", "published"):
        raise ValueError(f"`--core {core}`: `fitted` or `published` expected. Correct it.")
    samples = sampled(reference())
    return Study(samples, fitted(samples, nominal()) if core == "fitted" else nominal(), seed)


def study_of(facts: Facts) -> Study:
    """The study of `Study.facts`."""
    samples = Samples(**{name: np.array(values) for name, values in facts["samples"].items()})
    model = Model(*(tuple(value) if isinstance(value, list) else value for value in facts["model"]))
    return Study(samples, model, facts["seed"], facts["noise_current"])


def drawn(study: Study, width: float, chunk: int, runs: int, chosen: slice = slice(None)) -> tuple[Varied, Floats]:
    """Wrong models (52)-(57) and measured currents (samples, runs) [A] (58) of the first runs of a chunk."""
    relative = errors(study.seed, chunk, runs)[:, chosen]
    measured = noise(study.seed, chunk, runs, study.samples.time.size, study.noise_current)[:, chosen]
    measured += study.samples.current[:, None]
    return perturbed(study.model, width * relative), measured


def tuning(variances: Sequence[float], study: Study) -> Tuning:
    """Standard deviations of the filter from the diagonal of Q."""
    _, _, flux_linkage, current_error, force_error = np.sqrt(variances).tolist()
    return Tuning(flux_linkage, current_error, force_error / study.model.l_z, study.noise_current)


def noise_of_width(facts: Facts, task: Facts) -> list[float]:
    """Task: the diagonal of Q (60) for one width."""
    study = study_of(facts)
    relative = [errors(study.seed, chunk, size) for chunk, size in chunks(task["runs"])]
    varied = perturbed(study.model, task["width"] * np.concatenate(relative, axis=1))
    return process_noise(study.samples, varied, study.model).tolist()  # type: ignore[no-any-return]


def moving(samples: Samples, operation: int) -> list[int]:
    """Samples in motion of an operation."""
    return [k for k in np.flatnonzero(samples.mode == MOVING).tolist() if operation_of(samples, k) == operation]


def operation_of(samples: Samples, k: int) -> int:
    """0 for a making, 1 for a breaking: by the stop on which the motion of sample `k` lands."""
    landed = next(after for first, after in motions(samples.mode) if first <= k < after)
    return 0 if samples.mode[landed] == 1.0 else 1
