"""Wrong parameters and measurement noise of the Monte Carlo studies of [RTS], (52)-(58)."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import quad

from gapsense.estimators.reduced_model import Model, gap_law
from gapsense.studies.smoother.batch import Varied

Floats = NDArray[np.float64]
ERRORS = 8  # parameters that are wrong (52)
CHUNK = 5000  # runs that share a generator, and are computed at once


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
    e = dict(zip(("m", "k_sp", "z_sp", "c_f", "R_c0", "lam_sat", "mean", "mean_slope"), errors))
    return Varied(
        m=m.m * (1.0 + e["m"]),
        k_sp=m.k_sp * (1.0 + e["k_sp"]),
        z_sp=m.z_sp * (1.0 + e["z_sp"]),
        c_f=m.c_f * (1.0 + e["c_f"]),
        R_c0=m.R_c0 * (1.0 + e["R_c0"]),
        lam_sat=m.lam_sat * (1.0 + e["lam_sat"]),
        gap_offset=m.gap_offset + mean * e["mean"],
        gap_tilt=m.gap_tilt + mean_slope * e["mean_slope"],
    )


def errors(seed: int, chunk: int, runs: int) -> Floats:
    """Relative errors (8, runs) for an interval of length 1 around zero (55); shorter intervals shrink them.

    Fewer runs are the first of more, and every width of the interval has the same runs, so that widths compare.
    """
    generator = np.random.default_rng([seed, chunk, 0])
    return np.ascontiguousarray(generator.uniform(-0.5, 0.5, (runs, ERRORS)).T)


def noise(seed: int, chunk: int, runs: int, samples: int, deviation: float) -> Floats:
    """White noise (samples, runs) of the measured current [A] (58)."""
    generator = np.random.default_rng([seed, chunk, 1])
    return np.ascontiguousarray(deviation * generator.standard_normal((runs, samples)).T)


def chunks(runs: int) -> list[tuple[int, int]]:
    """Number and size of the chunks of some runs."""
    return [(k, min(CHUNK, runs - k * CHUNK)) for k in range(-(-runs // CHUNK))]
