"""Observability of the model behind SEMERA, [SEMERA] Section II-B: which currents let its state be estimated.

The state is (r, l_k, l_(k-1)), and the output matrix depends on the current.  A window of samples k .. k+n makes the
state at k observable if the matrix (30) has rank 3.  It has not for a linear current (35), and neither for one that
decays to zero exponentially, i_(k+j) = q^j i_k: its rows are q^j times rows that are linear in j.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

TOLERANCE = 1e-9


def observability_matrix(current: ArrayLike, dt: Any, n: int = 2) -> NDArray[Any]:
    """Observability matrices of all windows of `n + 1` samples.

    Row j is C_(k+j) F^j with C of (28) and F^j of (34); for n = 2 this is (31).  [SEMERA, eqs. (30)-(31), (33)-(34)]
    Entry [w] of (m - n - 1, n + 1, 3) belongs to the window that starts at k = w + 1, because (28) needs the current of
    k - 1.  `current` (m,) [A] is the true one, `dt` the sampling period [s]; fractions give exact matrices.
    """
    return _rows(*_windows(current, n), dt)


def flux_state_matrix(current: ArrayLike, dt: Any, n: int = 2) -> NDArray[Any]:
    """As `observability_matrix`, with the flux linkages instead of the inductances in the state.

    Row j is (i_(k+j), 1/dt, -1/dt): the last two columns are proportional, so that the rank is never above 2.
    [SEMERA, eqs. (36)-(39)]
    """
    i = _windows(current, n)[0]
    one = i * 0 + 1
    return np.stack((i, one / dt, -one / dt), axis=-1)


def rank(matrices: ArrayLike, dt: float, tolerance: float = TOLERANCE) -> NDArray[np.int_]:
    """Rank of observability matrices (..., n + 1, 3), after scaling.

    A singular value counts if it is above `tolerance` times the largest one.

    Notes
    -----
    The rank of a matrix of measured or simulated numbers depends on units and on the tolerance.  Here the inductances
    are expressed as l/dt, in ohm like r, which makes all columns currents; the largest entry is then made 1, which
    changes no ratio.  What is left of the third singular value is of the order of the relative second difference of
    the current: about (dt/tau)^2 = 1e-3 where the current of a valve starts to rise, 1e-16 by rounding where it is
    steady.  The default of 1e-9 lies between these; a coarser one tells less of the rise observable.  It is a bound for
    exact currents, as in [SEMERA]: against measurement noise, far more information is needed than for rank 3.
    """
    scaled = np.asarray(matrices, dtype=float) * np.array([1.0, dt, dt])
    size = np.abs(scaled).max(axis=(-2, -1), keepdims=True)
    values = np.linalg.svd(scaled / np.where(size > 0.0, size, 1.0), compute_uv=False)
    largest = values.max(axis=-1, keepdims=True)
    return np.asarray(np.sum(values > tolerance * largest, axis=-1))


def steps_since_observable(current: ArrayLike, dt: float, tolerance: float = TOLERANCE) -> NDArray[np.float64]:
    """Number of steps since the last observable state, for every sample: the last plot of Fig. 3.

    At sample k it is the smallest n for which the samples k-n .. k, or the first of them, make the state at k-n
    observable: 2 at least; NaN while no state has been observable.  The `current` [A] is the true one.
    """
    i = np.asarray(current, dtype=float)
    latest = np.full(i.size, -1)  # state that becomes observable at a sample
    pending = np.arange(1, max(1, i.size - 2))  # states that are not observable yet
    factor = np.zeros((pending.size, 0, 3))  # what the rows so far amount to: same singular values, three rows
    for n in range(i.size - 1):
        factor, pending = factor[pending + n < i.size], pending[pending + n < i.size]
        if pending.size == 0:
            break
        factor = np.concatenate((factor, _rows(i[pending + n], i[pending + n - 1], n, 1.0)[:, None, :]), axis=1)
        if n < 2:
            continue
        is_observable = rank(factor, 1.0, tolerance) == 3
        np.maximum.at(latest, pending[is_observable] + n, pending[is_observable])
        factor, pending = np.asarray(np.linalg.qr(factor[~is_observable], mode="r")), pending[~is_observable]
    latest = np.maximum.accumulate(latest)
    return np.where(latest > 0, np.arange(i.size) - latest, np.nan)


def _windows(current: ArrayLike, n: int) -> tuple[NDArray[Any], NDArray[Any], NDArray[np.int_]]:
    """Currents i_(k+j) and i_(k+j-1) of every window, and j."""
    i = np.asarray(current)
    j = np.arange(n + 1)
    k = np.arange(1, max(1, i.size - n))[:, None]
    return i[k + j], i[k + j - 1], j


def _rows(i: NDArray[Any], before: NDArray[Any], j: Any, dt: Any) -> NDArray[Any]:
    """Rows j of the matrices, of the currents i_(k+j) and i_(k+j-1)."""
    return np.stack((i, ((j + 1) * i - j * before) / dt, ((j - 1) * before - j * i) / dt), axis=-1)
