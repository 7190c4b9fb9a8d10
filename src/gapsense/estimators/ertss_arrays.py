"""Arrays of the state of `ertss`, for hosts that read arrays: the covariance of its filter."""

from __future__ import annotations

from gapsense.estimators import ekf_arrays
from gapsense.estimators.ekf_arrays import ROWS, Arrays
from gapsense.estimators.ertss import Parameters, State

__all__ = ["ROWS", "Arrays", "arrays"]


def arrays(state: State, par: Parameters) -> Arrays:
    """Arrays of the filter."""
    return ekf_arrays.arrays(state.filter, par.filter)
