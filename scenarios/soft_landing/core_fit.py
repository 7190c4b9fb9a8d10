"""Fit of the core of the reduced model, R_c0* and lambda_sat of [RTS] (15), to a simulated or measured cycle."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from rich.table import Table
from scipy.integrate import cumulative_trapezoid
from scipy.optimize import least_squares

from gapsense._os.files import read_columns
from gapsense._os.workers import Progress
from gapsense.actuators.motion import MOVING
from gapsense.estimators.reduced_model import Model, current, gap_law, normalise_model
from gapsense.report.table import table
from gapsense.studies.devices import RTS_VALVE

from .cycle import sampled, soft_landing
from .rts import Floats

FEWEST = 10  # samples
PUBLISHED = {"R_c0": 1.75, "lam_sat": 0.0238}  # Table II
COLUMNS = {"time": "s", "voltage": "V", "current": "A", "position": "m"}  # of a record, and their units
SIMPLER = {
    "complete model, as in the paper": {},
    "  its samples in motion only": {},
    "without hysteresis": {"hysteresis": 0.0},
    "without eddy currents": {"eddy_currents": 0.0},
    "without both": {"hysteresis": 0.0, "eddy_currents": 0.0},
}


class CoreFit(NamedTuple):
    """What a fit gives; the standard errors are infinite where the cycle does not tell."""

    reluctance: float  # R_c0* [1/H]
    saturation: float  # lambda_sat [Wb]
    reluctance_std: float
    saturation_std: float
    rms: float  # of the current that is left, e_i [A]
    samples: int

    def model(self, m: Model) -> Model:
        """A model with this core."""
        return m._replace(R_c0=self.reluctance, lam_sat=self.saturation)


class Fitted(NamedTuple):
    """One fit, and what the published core leaves of the same currents."""

    title: str
    fit: CoreFit
    published_rms: float


def of_reference_cycle(par: Any, progress: Progress = lambda done, total: None) -> list[Fitted]:
    """Fits to the soft-landing cycle (Fig. 5) of the complete model, and of simpler ones, with their flux linkage."""
    m, found = normalise_model(par), []
    simulated = cache(lambda *changes: sampled(soft_landing(RTS_VALVE._replace(**dict(changes)))[-1], par.sample_time))
    for title, changes in SIMPLER.items():
        s = simulated(*changes.items())
        chosen = s.mode == MOVING if "motion" in title else np.full(s.mode.shape, True)
        found.append(_fitted(title, s.position[chosen], s.flux_linkage[chosen], s.current[chosen], m))
        progress(len(found), len(SIMPLER))
    return found


def of_record(file: Path, par: Any, held: bool) -> list[Fitted]:
    """Fit to a measured record, with the flux linkage from voltage and current."""
    columns = read_columns(file, COLUMNS)
    missing = [name for name in COLUMNS if name not in columns]
    if missing:
        raise ValueError(f"{file}: column {', '.join(missing)} is missing; it has {', '.join(columns)}. Add it.")
    time, voltage, current, position = (columns[name] for name in COLUMNS)
    late = np.flatnonzero(~(np.diff(time) > 0.0))
    if late.size:
        raise ValueError(f"{file}, line {late[0] + 3}: `time` does not rise. Correct the file.")
    m = normalise_model(par)
    return [_fitted(file.name, position, integrated_flux(time, voltage, current, m.R, held), current, m)]


def _fitted(title: str, position: Floats, flux_linkage: Floats, measured: Floats, m: Model) -> Fitted:
    published = _left(*_samples(position, flux_linkage, measured, m), m._replace(**PUBLISHED))
    return Fitted(title, fit_core(position, flux_linkage, measured, m), float(np.sqrt(np.mean(published**2))))


def fit_core(position: ArrayLike, flux_linkage: ArrayLike, measured: ArrayLike, m: Model) -> CoreFit:
    """Least squares of the current error (47c), i - f_i*(z, lambda, 0), over the samples of a cycle.

    Parameters
    ----------
    position, flux_linkage, measured : (N,) arrays
        Position [m], flux linkage [Wb], see `integrated_flux`, and current [A].
    m : Model
        Its gap law is taken as it is; its core is where the search starts.

    Notes
    -----
    What hysteresis, eddy currents and a wrong gap law leave is no white noise: the standard errors are those of Newey
    and West, with as many lags as the errors of neighbouring samples are alike.  They say how well the samples fix the
    two numbers, not how true the model is.
    """
    R_g, lam, i = _samples(position, flux_linkage, measured, m)

    def residual(logs: Floats) -> Floats:
        """In logarithms both numbers stay positive."""
        R_c0, lam_sat = np.exp(logs).tolist()
        return _left(R_g, lam, i, m._replace(R_c0=m.R_c0 * R_c0, lam_sat=m.lam_sat * lam_sat))

    tight = 1e-14
    found = least_squares(residual, np.zeros(2), jac="3-point", xtol=tight, ftol=tight, gtol=tight)
    values = np.array([m.R_c0, m.lam_sat]) * np.exp(found.x)
    stds = values * standard_errors(found.jac, found.fun)
    rms = float(np.sqrt(np.mean(found.fun**2)))
    return CoreFit(
        reluctance=float(values[0]),
        saturation=float(values[1]),
        reluctance_std=float(stds[0]),
        saturation_std=float(stds[1]),
        rms=rms,
        samples=len(i),
    )


def integrated_flux(time: ArrayLike, voltage: ArrayLike, measured: ArrayLike, resistance: float, held: bool) -> Floats:
    """Flux linkage of a measured record: the integral of u - R i from a start at rest and without flux [Wb].

    Parameters
    ----------
    time, voltage, measured : (N,) arrays
        Sample times [s], voltage [V] and current [A].
    resistance : float
        Of the coil [ohm].
    held : bool
        Whether the voltage holds from each sample to the next; otherwise it is straight between them, as the current.
    """
    t, u, i = (np.asarray(values, float) for values in (time, voltage, measured))
    applied = np.append(0.0, np.cumsum(np.diff(t) * u[:-1])) if held else cumulative_trapezoid(u, t, initial=0.0)
    return np.asarray(applied - resistance * cumulative_trapezoid(i, t, initial=0.0))


def standard_errors(J: Floats, residual: Floats) -> Floats:
    """Standard errors of least squares with serially correlated residuals; infinite where `J` says nothing.

    The covariance is A^-1 B A^-1 with A = J'J and B the sum of the autocovariances of J' r, weighted from 1 down to 0
    at the first lag at which the residuals are not correlated (Newey and West).
    """
    n = residual.size
    if np.linalg.matrix_rank(J) < J.shape[1]:
        return np.full(J.shape[1], np.inf)
    white = residual - residual.mean()
    correlated = (float(white[lag:] @ white[: n - lag]) > 0.0 for lag in range(1, n // 4))
    lags = next((lag for lag, is_alike in enumerate(correlated) if not is_alike), n // 4)
    scores = J * residual[:, None]
    B = scores.T @ scores
    for lag in range(1, lags + 1):
        shifted = scores[lag:].T @ scores[: n - lag]
        B += (1.0 - lag / (lags + 1.0)) * (shifted + shifted.T)
    inverse = np.linalg.inv(J.T @ J)
    return np.asarray(np.sqrt(np.maximum(np.diag(inverse @ B @ inverse) * n / (n - J.shape[1]), 0.0)))


def _samples(position: ArrayLike, flux_linkage: ArrayLike, measured: ArrayLike, m: Model) -> tuple[Any, Any, Any]:
    """Reluctance of the gap, flux linkage and current."""
    arrays = tuple(np.asarray(values, float) for values in (position, flux_linkage, measured))
    sizes = [a.shape for a in arrays]
    if len(set(sizes)) > 1 or arrays[0].ndim != 1 or arrays[0].size < FEWEST:
        raise ValueError(f"position, flux linkage and current have shapes {sizes}; expected equal (N,), N >= {FEWEST}.")
    if not all(np.all(np.isfinite(a)) for a in arrays):
        raise ValueError("position, flux linkage or current is not finite somewhere. Leave those samples out.")
    z, lam, i = ((arrays[0] - m.z_min) / m.l_z).tolist(), arrays[1].tolist(), arrays[2].tolist()
    return [gap_law(at, m)[0] for at in z], lam, i


def _left(R_g: list[float], lam: list[float], i: list[float], m: Model) -> Floats:
    """What the model leaves of the currents [A]."""
    return np.array([measured - current(R, flux, 0.0, m) for R, flux, measured in zip(R_g, lam, i)])


REASON = """\
left: root mean square of the current that the fitted model does not explain, e_i of (47c); +-: standard errors.
The published core belongs to the gap reluctance of the paper's Fig. 4, a picture without numbers; beside our
formula for it the published core explains the currents less well than the fitted one."""


def cores(fits: Sequence[Fitted], is_reference: bool) -> list[Table | str]:
    """A table of the fits, and why they differ from the published values."""
    rows = []
    if is_reference:
        numbers = f"{PUBLISHED['R_c0']:.4g}", f"{1e3 * PUBLISHED['lam_sat']:.4g}", f"{1e3 * fits[0].published_rms:.3g}"
        rows.append(["published, Table II", *numbers])
    for title, fit, _ in fits:
        reluctance = f"{fit.reluctance:.4g} +- {fit.reluctance_std:.2g}"
        saturation = f"{1e3 * fit.saturation:.4g} +- {1e3 * fit.saturation_std:.2g}"
        rows.append([title, reluctance, saturation, f"{1e3 * fit.rms:.3g}", f"{fit.samples}"])
    made = table("", ["", "R_c0* [1/H]", "lambda_sat [mWb]", "left [mA]", "samples"], rows)
    return [made, REASON] if is_reference else [made]
