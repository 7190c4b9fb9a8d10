"""Arrays of the state of `ukf`, for hosts that read arrays."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from gapsense.estimators.ukf import Parameters, State
from gapsense.estimators.valve_model import CURRENT_ERROR, FLUX_LINKAGE, POSITION, POSITION_PREV
from gapsense.kernels.layout import Array, Covariance
from gapsense.kernels.linalg import matrix

ROWS = ("position", "velocity", "flux_linkage", "current_error")


class Arrays(NamedTuple):
    """Covariance of the outputs `ROWS`."""

    covariance: Annotated[Array, Covariance(4)]


def arrays(state: State, par: Parameters) -> Arrays:
    """Covariance of the state, with the velocity in place of the previous position."""

    def shown(P: Array) -> Array:
        velocity = (P[POSITION] - P[POSITION_PREV]) / par.sample_time
        return matrix([P[POSITION], velocity, P[FLUX_LINKAGE], P[CURRENT_ERROR]])

    return Arrays(shown(shown(state.P).T))
