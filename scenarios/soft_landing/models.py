"""The reduced model of [RTS] with right and with wrong parameters, and measurement noise, (52)-(58)."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from scipy.integrate import quad

from gapsense.estimators.reduced_model import Model, gap_law, normalised
from gapsense.estimators.rts import Floats
from gapsense.fmi.components import kernel_parameters, own

from .batch import Varied
from .core_fit import fit_core

ERRORS = 8  # parameters that are wrong (52)
CHUNK = 5000  # runs that share a generator, and are computed at once


def nominal() -> Model:
    """The reduced model (13)-(17) with the right parameters: those of the actuator, and the core of Table II.

    As in the paper e_i is never forgotten.
    """
    return normalised(kernel_parameters(own("ekf"), {"process.current_error_memory": 0.0}))


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
