"""Checks of a filter on itself: wild samples, and conditions that last too long."""

from __future__ import annotations

from typing import NamedTuple

from gapsense.estimators.kalman import mean, surprise
from gapsense.records import Scalar
from gapsense.trace import clip, fabs, sqrt, where

PATIENCE = 5.0  # wild samples in a row that are skipped; if there are more, it is the model that is wrong
FAR = 10.0  # deviations as which a larger innovation or current error counts, so that a burst is soon forgotten
OFTEN = 0.75  # share of the samples in which a position may be put back to a bound
LONG = 10.0  # time over which a current error counts, in those over which an innovation does
WANDERING = 20e-3  # memory that a current error without end is judged by: an operation and the rest after it [s]


class Watch(NamedTuple):
    """What is carried from sample to sample."""

    surprise: Scalar  # mean of the squared normalised innovation [1]
    strain: Scalar  # mean of the squared normalised current error at rest [1]
    pressed: Scalar  # share of the samples in which the position was put back to a bound
    far: Scalar  # samples in a row with a wild innovation


class Seen(NamedTuple):
    """Observations at one sample."""

    innovation: Scalar
    innovation_std: Scalar
    is_used: Scalar
    current_error: Scalar
    current_error_std: Scalar  # stationary
    is_resting: Scalar
    is_pressed: Scalar  # the position is at a bound where it need not be


START = Watch(surprise=1.0, strain=0.0, pressed=0.0, far=0.0)


def is_far(innovation: Scalar, std: Scalar, most: Scalar) -> Scalar:
    """Whether an innovation is beyond `most` standard deviations; with 0 none is."""
    return (most > 0.0) & (fabs(innovation) > most * std)


def near(value: Scalar, std: Scalar) -> Scalar:
    """A value, clipped to `FAR` standard deviations."""
    return clip(value, -FAR * std, FAR * std)


def patient(most: Scalar, far: Scalar) -> Scalar:
    """The limit for `is_far`, or 0 after `PATIENCE` such samples in a row."""
    return where(far < PATIENCE, most, 0.0)


def counted(before: Scalar, is_so: Scalar) -> Scalar:
    """For how many samples in a row something is so."""
    return where(is_so, before + 1.0, 0.0)


def watched(before: Watch, seen: Seen, most: Scalar, samples: Scalar) -> Watch:
    """The means over about so many samples, and over `LONG` times as many at rest, with one sample more."""
    surprised = surprise(before.surprise, near(seen.innovation, seen.innovation_std), seen.innovation_std, samples)
    current_error = near(seen.current_error, seen.current_error_std)
    strained = surprise(before.strain, current_error, seen.current_error_std, LONG * samples)
    return Watch(
        surprise=where(seen.is_used, surprised, before.surprise),
        strain=where(seen.is_resting, strained, before.strain),
        pressed=mean(before.pressed, where(seen.is_pressed, 1.0, 0.0), samples),
        far=counted(before.far, is_far(seen.innovation, seen.innovation_std, most)),
    )


def stationary(noise: Scalar, memory: Scalar, per: Scalar) -> Scalar:
    """Stationary standard deviation of a state with process noise `per` time [s] and a memory [s]."""
    return noise * sqrt(0.5 * where(memory > 0.0, memory, WANDERING) / per)
