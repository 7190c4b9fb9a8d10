"""Readings that an estimator can use, and what it says of them."""

from __future__ import annotations

import math

from gapsense.records import Scalar
from gapsense.trace import where

FINE, LOST = 1.0, 0.0  # health


def can_be_read(value: Scalar, limit: Scalar) -> Scalar:
    """Neither NaN nor infinite nor beyond plus or minus `limit`."""
    return (value > -limit) & (value < limit)


def wired(resistance: Scalar) -> Scalar:
    """Resistance at an input [ohm], or 0 if it says none: not wired, or not positive and finite."""
    return where((resistance > 0.0) & (resistance < math.inf), resistance, 0.0)


def told(resistance: Scalar, parameter: Scalar) -> Scalar:
    """The resistance to believe: what `wired` has left of the input, or else the parameter."""
    return where(resistance > 0.0, resistance, parameter)
