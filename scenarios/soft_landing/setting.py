"""What the Monte Carlo studies of [RTS] share: the reference, the nominal model, the randomness, the process noise."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import quad

from gapsense.estimators.reduced_model import Model, gap_law, normalise_model
from gapsense.fmi.components import kernel_parameters, own
from gapsense.studies.runs import Facts

from .batch import MOVING, Tuning, Varied
from .core_fit import fit_core
from .cycle import Samples, reference, sampled
from .reference import process_noise
from .rts import Floats, motions

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


ERRORS = 8  # parameters that are wrong (52)
CHUNK = 5000  # runs that share a generator, and are computed at once


def nominal() -> Model:
    """The reduced model (13)-(17) with the right parameters: those of the actuator, and the core of Table II.

    As in the paper e_i is never forgotten.
    """
    return normalise_model(kernel_parameters(own("ekf"), {"process.current_error_memory": 0.0}))


def fitted(samples: Any, m: Model) -> Model:
    """The model with R_c0* and lambda_sat that leave the smallest current errors (47c) in a cycle, in least squares."""
    return fit_core(samples.position, samples.flux_linkage, samples.current, m).model(m)


def unvaried(m: Model) -> Varied:
    """A single run without errors."""
    return Varied(*(getattr(m, name) for name in Varied._fields))


@cache
def gap_means(m: Model) -> tuple[float, float]:
    """Means over the stroke of R_g* and of its derivative (53); that of the derivative is its integral."""
    mean, _ = quad(lambda z: gap_law(z, m)[0], 0.0, 1.0, epsabs=0.0, epsrel=1e-12)
    return float(mean), float(gap_law(1.0, m)[0] - gap_law(0.0, m)[0])


def perturbed(m: Model, errors: Floats) -> Varied:
    """Models with relative errors (8, runs) of the parameters (52), (54).

    Those of the means of R_g* and R_g*' shift the gap law and tilt it around the middle of the stroke (56)-(57): they
    are an offset and a tilt.
    """
    mean, mean_slope = gap_means(m)
    *relative, of_mean, of_slope = errors
    values = {name: getattr(m, name) * (1.0 + e) for name, e in zip(Varied._fields, relative)}
    return Varied(**values, gap_offset=m.gap_offset + mean * of_mean, gap_tilt=m.gap_tilt + mean_slope * of_slope)


def errors(seed: int, chunk: int, runs: int) -> Floats:
    """Relative errors (8, runs) for an interval of length 1 around zero (55); shorter intervals shrink them.

    Fewer runs are the first of more, and every width of the interval has the same runs, so that widths compare.
    """
    generator = np.random.default_rng([seed, chunk, 0])
    return np.ascontiguousarray(generator.uniform(-0.5, 0.5, (runs, ERRORS)).T)


def noise(seed: int, chunk: int, runs: int, samples: int, deviation: float) -> Floats:
    """White noise (samples, runs) of the measured current [A] (58)."""
    generator = np.random.default_rng([seed, chunk, 1])
    drawn = generator.standard_normal((runs, samples))
    drawn *= deviation
    return drawn.T


def chunks(runs: int) -> list[tuple[int, int]]:
    """Number and size of the chunks of some runs."""
    return [(k, min(CHUNK, runs - k * CHUNK)) for k in range(-(-runs // CHUNK))]
