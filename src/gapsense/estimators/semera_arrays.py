"""Arrays of the state of `semera`, for hosts that read arrays."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from gapsense.estimators.semera import Parameters, State
from gapsense.kernels.layout import Array, Covariance

ROWS = ("resistance", "inductance")


class Arrays(NamedTuple):
    """Covariance of the outputs `ROWS` that the filter expects at the next sample."""

    predicted_covariance: Annotated[Array, Covariance(2)]


def arrays(state: State, par: Parameters) -> Arrays:
    """Covariance that the filter carries to the next sample."""
    del par
    return Arrays(state.P[:2, :2])
