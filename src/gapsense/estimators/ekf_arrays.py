"""Arrays of the state of `ekf`, for hosts that read arrays."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from gapsense.estimators.ekf import Parameters, State
from gapsense.estimators.reduced_model import (
    CURRENT_ERROR,
    FLUX_LINKAGE,
    FORCE_ERROR,
    POSITION,
    POSITION_PREV,
    normalised,
)
from gapsense.kernels.layout import Array, Covariance
from gapsense.kernels.linalg import matrix

ROWS = ("position", "velocity", "flux_linkage", "current_error", "force_error")


class Arrays(NamedTuple):
    """Covariance of the outputs `ROWS`, in SI units."""

    covariance: Annotated[Array, Covariance(5)]


def arrays(state: State, par: Parameters) -> Arrays:
    """Covariance of the normalised state, scaled on both sides; velocity by (23)."""
    m = normalised(par)

    def scaled(P: Array) -> Array:
        speed = (P[POSITION] - P[POSITION_PREV]) * (m.l_z / m.T_s)
        return matrix([m.l_z * P[POSITION], speed, P[FLUX_LINKAGE], P[CURRENT_ERROR], P[FORCE_ERROR] / m.l_z])

    return Arrays(scaled(scaled(state.P).T))
