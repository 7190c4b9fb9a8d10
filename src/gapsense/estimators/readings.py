"""Readings that an estimator can use, and what it says of them."""

from __future__ import annotations

from gapsense.records import Scalar

FINE, LOST = 1.0, 0.0  # health


def can_be_read(value: Scalar, limit: Scalar) -> Scalar:
    """Neither NaN nor infinite nor beyond plus or minus `limit`."""
    return (value > -limit) & (value < limit)
