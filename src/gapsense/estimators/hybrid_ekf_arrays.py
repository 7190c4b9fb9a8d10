"""Arrays of the state of `hybrid_ekf`, for hosts that read arrays."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from gapsense.estimators.hybrid_ekf import Parameters, State
from gapsense.kernels.layout import Array, Covariance

ROWS = ("current_estimated", "position", "velocity")


class Arrays(NamedTuple):
    """Covariance of the outputs `ROWS`."""

    covariance: Annotated[Array, Covariance(3)]


def arrays(state: State, par: Parameters) -> Arrays:
    """Covariance of the state."""
    del par
    return Arrays(state.P)
