"""What a fit leaves that is no noise, and what that may have done to the parameters.

The residual cannot tell what the parameters have taken of a cause that the model does not know.  Two things can: how
much of the residual each known cause explains, with the parameters free, and so how far it moves them; and the
correlation that a misfit of the size of the residual would need to move a parameter most.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter

from gapsense.identification.causes import CAUSES, Matrix
from gapsense.identification.measurements.record import Vector
from gapsense.identification.valve.linear import Linear

LENGTHS = (1, 2, 5, 10, 20, 50, 100, 200, 500)  # of correlation, in samples
FEW, ALIKE = 0.1, 0.6  # part of the residual that is too little, and what explains nearly as much as another
SIGNIFICANT = 4.0  # standard errors from which on a cause counts


class Share(NamedTuple):
    """What a cause has of a residual, the parameters being free to follow it."""

    value: float  # that explains most
    error: float  # its standard error
    part: float  # of the squares that it explains

    @property
    def is_significant(self) -> bool:
        """Whether the residual shows it."""
        return abs(self.value) > SIGNIFICANT * self.error


def likely(found: Mapping[str, Share]) -> list[str]:
    """Causes that the residual shows and that can be, the one that explains most of it first."""
    can_be = [name for name, s in found.items() if s.is_significant and s.part > FEW]
    can_be = [name for name in can_be if found[name].value > 0.0 or not CAUSES[name].is_positive]
    most = max((found[name].part for name in can_be), default=0.0)
    near = [name for name in can_be if found[name].part > ALIKE * most]
    return sorted(near, key=lambda name: -found[name].part)


def spread(W: Matrix, size: float) -> Matrix:
    """Covariance of sums of W[:, k] m[k] over a misfit m of this size, with the worst length of correlation for each.

    The correlation falls exponentially.  The covariances of all lengths together tell which sums go together.
    """
    return size**2 * largest([_correlated(W, length) for length in LENGTHS])


def largest(parts: Sequence[Matrix]) -> Matrix:
    """Covariance with the largest variances of several; together they tell the correlations."""
    worst, total = np.max([np.diag(part) for part in parts], axis=0), np.sum(parts, axis=0)
    scale = np.sqrt(worst / np.maximum(np.diag(total), 1e-300))
    return np.asarray(total * np.outer(scale, scale))


def shares(at: Linear, residuals: Vector, sizes: Mapping[str, float], errors: Vector) -> dict[str, Share]:
    """Of each cause that is not fitted; `sizes` are their scales, `errors` those of values relative to them."""
    values, total = -at.rows @ residuals, max(float(residuals @ residuals), 1e-300)
    parts = (values**2 * (at.left**2).sum(axis=0) / total).tolist()
    found = zip(sizes.items(), values.tolist(), errors.tolist(), parts)
    return {name: Share(size * x, size * error, part) for (name, size), x, error, part in found if name in CAUSES}


def _correlated(W: Matrix, length: float) -> Matrix:
    """Sum of W[:, k] W[:, j] exp(-|k - j| / length) over all k and j."""
    before = W @ lfilter([1.0], [1.0, -np.exp(-1.0 / length)], W, axis=1).T
    return np.asarray(before + before.T - W @ W.T)
