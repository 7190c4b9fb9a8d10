"""Checks of a filter on itself: wild samples, and signs of a wrong model that count until an operation is fine."""

from __future__ import annotations

from typing import NamedTuple

from gapsense.estimators.kalman import mean, normalised, surprise
from gapsense.records import Scalar
from gapsense.trace import clip, fabs, not_, sqrt, square, where

PATIENCE = 5.0  # wild samples in a row that are skipped; if there are more, it is the model that is wrong
FAR = 10.0  # deviations as which a larger innovation or current error counts, so that a burst is soon forgotten
OFTEN = 0.3  # share of the samples in which a position may be put back to a bound
LONG = 6.0  # time over which a current error counts, in those over which an innovation does
WANDERING = 20e-3  # memory that a current error without end is judged by: an operation and the rest after it [s]
OPERATIONS = 3.0  # takeoffs until a sign is forgotten: between them lie a motion to either stop
EARLY = 0.18  # share of the stroke that may be left when the contact closes
PULL = 0.4  # share of the spring's force with which a stop may seem to hold the mover back
ONE_SIDED = 1.4  # largest mean of the normalised innovation, which is much larger where the model is wrong


class Watch(NamedTuple):
    """What is carried from sample to sample."""

    surprise: Scalar  # mean of the squared normalised innovation [1]
    bias: Scalar  # mean of the normalised innovation [1]
    strain: Scalar  # mean of the squared normalised current error at rest [1]
    pressed: Scalar  # share of the samples in which the position was put back to a bound
    far: Scalar  # samples in a row with a wild innovation
    left: Scalar  # side of the stop that the mover left last, as the mode says it: 1 lower, 3 upper; 0: none yet
    innovation: Scalar  # takeoffs until this sign is forgotten, as the following
    current_error: Scalar
    bound: Scalar
    other: Scalar


class Seen(NamedTuple):
    """Observations at one sample."""

    innovation: Scalar
    innovation_std: Scalar
    is_used: Scalar
    current_error: Scalar
    current_error_std: Scalar  # stationary
    is_resting: Scalar
    is_pressed: Scalar  # the position is at a bound where it need not be
    leaves: Scalar  # the stop that the mover leaves in this sample, as the mode says it; 0: none
    is_other: Scalar  # contact or force are those of another device


class Limits(NamedTuple):
    """What is too much."""

    samples: Scalar  # over which is averaged
    innovation: Scalar  # mean of the squared normalised innovation
    current_error: Scalar  # root mean square of the current error at rest, in stationary deviations


START = Watch(1.0, *[0.0] * 9)


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


def lasting(before: Scalar, is_so: Scalar, is_over: Scalar) -> Scalar:
    """A sign of a wrong model, as the takeoffs until it is forgotten."""
    return where(is_so, OPERATIONS, clip(before - where(is_over, 1.0, 0.0), 0.0, OPERATIONS))


def watched(before: Watch, seen: Seen, most: Scalar, limits: Limits) -> Watch:
    """One sample more.  An operation ends where the mover leaves another stop than before, not where it bounces."""
    innovation = near(seen.innovation, seen.innovation_std)
    surprised = surprise(before.surprise, innovation, seen.innovation_std, limits.samples)
    surprised = where(seen.is_used, surprised, before.surprise)
    biased = mean(before.bias, normalised(innovation, seen.innovation_std), limits.samples)
    biased = where(seen.is_used, biased, before.bias)
    current_error = near(seen.current_error, seen.current_error_std)
    strained = surprise(before.strain, current_error, seen.current_error_std, LONG * limits.samples)
    strained = where(seen.is_resting, strained, before.strain)
    pressed = mean(before.pressed, where(seen.is_pressed, 1.0, 0.0), limits.samples)
    is_over = (seen.leaves > 0.0) & not_(seen.leaves == before.left)
    is_surprised = (surprised >= limits.innovation) | (fabs(biased) >= ONE_SIDED)
    return Watch(
        surprise=surprised,
        bias=biased,
        strain=strained,
        pressed=pressed,
        far=counted(before.far, is_far(seen.innovation, seen.innovation_std, most)),
        left=where(is_over, seen.leaves, before.left),
        innovation=lasting(before.innovation, is_surprised, is_over),
        current_error=lasting(before.current_error, strained >= square(limits.current_error), is_over),
        bound=lasting(before.bound, pressed >= OFTEN, is_over),
        other=lasting(before.other, seen.is_other, is_over),
    )


def stationary(noise: Scalar, memory: Scalar, per: Scalar) -> Scalar:
    """Stationary standard deviation of a state with process noise `per` time [s] and a memory [s]."""
    return noise * sqrt(0.5 * where(memory > 0.0, memory, WANDERING) / per)
