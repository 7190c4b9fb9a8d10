"""Checks of a filter on itself: wild samples, and signs of a wrong model that count until an operation is fine."""

from __future__ import annotations

from typing import NamedTuple

from gapsense.estimators.kalman import mean, normalised, surprise
from gapsense.kernels.layout import Scalar
from gapsense.kernels.trace import clip, fabs, not_, sqrt, square, where

PATIENCE = 5.0  # wild samples in a row that are skipped; if there are more, it is the model that is wrong
FAR = 10.0  # deviations as which a larger innovation or current error counts, so that a burst is soon forgotten
OFTEN = 0.3  # share of the samples in which a position may be put back to a bound
LONG = 6.0  # time over which a current error counts, in those over which an innovation does
WANDERING = 20e-3  # memory that a current error without end is judged by: an operation and the rest after it [s]
OPERATIONS = 3.0  # takeoffs until a sign is forgotten: between them lie a motion to either stop
EARLY = 0.18  # share of the stroke that may be left when the contact closes
PULL = 0.5  # share of the spring's force with which a stop may seem to hold the mover back
KNOWN = 8.0  # operations after which it is known how large innovations usually are
FEW, FIRST_UNUSUAL = 5.0, 2.5  # operations after which so many times of it are another device
UNUSUAL, SLACK = 1.3, 0.4  # so many times of it, once it is known, and so many deviations more
RISE, FALL = 0.2, 0.02  # share of an operation in what is usual, if it has more or less
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


class Usual(NamedTuple):
    """How large the innovations are, and how large they usually are: a wrong model has them in each operation.

    An operation lasts until the mover leaves the other stop.
    """

    surprise: Scalar  # mean of the squared normalised innovation [1]
    bias: Scalar  # mean of the normalised innovation over half as many samples [1]
    above: Scalar  # largest bias in this operation
    below: Scalar  # the same of minus the bias
    down_above: Scalar  # what is usual from the upper stop on
    down_below: Scalar
    up_above: Scalar  # the same from the lower one on
    up_below: Scalar
    operations: Scalar  # from which these are
    left: Scalar  # side of the stop that the mover left last, as a mode; 0: none yet
    innovation: Scalar  # takeoffs until this sign is forgotten, as the following
    other: Scalar


UNKNOWN = Usual(1.0, *[0.0] * 11)


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
    is_over = is_takeoff(before.left, seen.leaves)
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


def compared(before: Usual, innovation: Scalar, std: Scalar, is_used: Scalar, leaves: Scalar, limits: Limits) -> Usual:
    """One sample more.  What is usual is learnt from operations without a sign."""
    seen = near(innovation, std)
    surprised = where(is_used, surprise(before.surprise, seen, std, limits.samples), before.surprise)
    biased = where(is_used, mean(before.bias, normalised(seen, std), 0.5 * limits.samples), before.bias)
    is_over, is_known = is_takeoff(before.left, leaves), before.operations >= KNOWN
    goes_down = before.left > 2.0
    times = where(is_known, UNUSUAL, FIRST_UNUSUAL)
    above = times * where(goes_down, before.down_above, before.up_above) + SLACK
    below = times * where(goes_down, before.down_below, before.up_below) + SLACK
    is_other = (before.operations >= FEW) & ((biased > above) | (-biased > below))
    is_learnt = is_over & (before.left > 0.0) & not_(before.innovation + before.other > 0.0)

    def usual(value: Scalar, new: Scalar, is_so: Scalar) -> Scalar:
        return where(is_learnt & is_so, _approached(value, new, is_known), value)

    return Usual(
        surprise=surprised,
        bias=biased,
        above=where(is_over, biased, larger(before.above, biased)),
        below=where(is_over, -biased, larger(before.below, -biased)),
        down_above=usual(before.down_above, before.above, goes_down),
        down_below=usual(before.down_below, before.below, goes_down),
        up_above=usual(before.up_above, before.above, not_(goes_down)),
        up_below=usual(before.up_below, before.below, not_(goes_down)),
        operations=before.operations + where(is_learnt, 1.0, 0.0),
        left=where(is_over, leaves, before.left),
        innovation=lasting(before.innovation, surprised >= limits.innovation, is_over),
        other=lasting(before.other, is_other, is_over),
    )


def _approached(usual: Scalar, new: Scalar, is_known: Scalar) -> Scalar:
    """What is usual with one operation more: the largest of the first ones, then slowly less and faster more."""
    is_more = new > usual
    return usual + where(is_known, where(is_more, RISE, FALL), where(is_more, 1.0, 0.0)) * (new - usual)


def larger(a: Scalar, b: Scalar) -> Scalar:
    """The larger one."""
    return where(a > b, a, b)


def is_takeoff(left: Scalar, leaves: Scalar) -> Scalar:
    """Whether the mover leaves another stop than before, so that a bounce is none."""
    return (leaves > 0.0) & not_(leaves == left)


def stationary(noise: Scalar, memory: Scalar, per: Scalar) -> Scalar:
    """Stationary standard deviation of a state with process noise `per` time [s] and a memory [s]."""
    return noise * sqrt(0.5 * where(memory > 0.0, memory, WANDERING) / per)
