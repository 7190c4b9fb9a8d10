"""What a host that knows arrays can read of the state of `ertss`: the covariance of its filter.

The smoothed motion is not among it.  The memory holds samples of several motions, some of them smoothed and some not
yet, and a motion has any number of them; they are published one by one, each with its time.
"""

from __future__ import annotations

from gapsense.estimators import ekf_arrays
from gapsense.estimators.ekf_arrays import ROWS, Arrays
from gapsense.estimators.ertss import Parameters, State

__all__ = ["ROWS", "Arrays", "arrays"]


def arrays(state: State, par: Parameters) -> Arrays:
    """Those of the filter."""
    return ekf_arrays.arrays(state.filter, par.filter)
