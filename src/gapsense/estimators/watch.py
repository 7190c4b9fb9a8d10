"""Checks of a filter on itself: wild samples, and signs of a wrong model that count until an operation is fine."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from gapsense.estimators.kalman import mean, normalised, surprise
from gapsense.kernels.elementary import exp, log
from gapsense.kernels.layout import Array, Count, Memory, Scalar, Whole, blank
from gapsense.kernels.trace import clip, cond, fabs, floor, load, not_, sqrt, square, store, where

PATIENCE = 5.0  # wild samples in a row that are skipped; if there are more, it is the model that is wrong
WILD = 200.0  # deviations of an innovation that is told in its sample, however few there are
FAR = 10.0  # deviations as which a larger innovation or current error counts, so that a burst is soon forgotten
OFTEN = 0.3  # share of the samples in which a position may be put back to a bound
LONG = 6.0  # time over which a current error counts, in those over which an innovation does
WANDERING = 20e-3  # memory that a current error without end is judged by: an operation and the rest after it [s]
OPERATIONS = 3.0  # takeoffs until a sign is forgotten: between them lie a motion to either stop
EARLY = 0.18  # share of the stroke that may be left when the contact closes
EARLIER, LATER = 0.08, 0.15  # how much more than usual that may be; share of an operation with less in what is usual
PULL = 0.5  # share of the spring's force with which a stop may seem to hold the mover back
FEW, KNOWN = 4.0, 20.0  # operations after which what is usual is used, and after which they may be called alike
ALIKE = 4.0  # largest range of a part in operations that are alike but for noise [deviations]
RARE = 6e-4  # probability that a mean is too far beyond those of other operations where they are not alike
WIDER, SLACK = 0.45, 0.2  # how far it may be beyond them in any case: part of the range, and so many deviations more
ALIKE_WIDER, ALIKE_SLACK, BESIDE = 0.9, 0.5, 0.1  # the same where they are alike, with a share of the parts beside
MOST = 1e3  # deviations as which a larger error of the model's current counts
PARTS, PER_MEAN = 24, 4.0  # of an operation, and how many of them are as long as `Limits.samples`
RESTING = PARTS // 2  # the part that begins at an edge of the voltage, before which the mover may rest for any time
EDGE = 1.0  # change of the voltage beyond its noise from which on an operation is compared from there [V]
AWAY = 0.05  # share of the stroke within which the position of the model alone is at a stop
FALL = 0.005  # share of an operation in what is usual, if it has less; one that has more is usual from then on
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
    short_lower: Scalar  # share of the stroke that is usually left where the contact closes at the lower stop, at most
    short_upper: Scalar  # and at the upper one


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
    lands: Scalar  # the stop on which the contact closes in this sample, as the mode says it; 0: none
    short: Scalar  # share of the stroke that is left then
    is_other: Scalar  # the force is that of another device


class Limits(NamedTuple):
    """What is too much."""

    samples: Scalar  # over which is averaged
    innovation: Scalar  # mean of the squared normalised innovation
    current_error: Scalar  # root mean square of the current error at rest, in stationary deviations


START = Watch(*[1.0, *[0.0] * 9, *[EARLY - EARLIER] * 2])


class Usual(NamedTuple):
    """How wrong the model's current usually is at each time of an operation: a wrong model has its own error in each.

    It is that of the model alone: a filter follows a fault with its flux linkage and hides it.  An operation lasts
    until the mover of that model leaves the other stop, and consists of `PARTS`: half of them from its takeoff on, the
    others from each edge of the voltage on; the last of either half is repeated.  The mean is compared where a part
    ends, or at an edge: within one it may change fast.  Memory has the largest mean of each part, then the largest of
    minus the mean, both plus `MOST`; 0: none yet.  What was seen in an operation becomes usual in the first samples of
    the next one, which is compared with the other half of that memory.
    """

    surprise: Scalar  # mean of the squared normalised innovation [1]
    bias: Scalar  # mean of the error of the model's current over half as many samples [deviations of the noise]
    samples: Annotated[Scalar, Count]  # since the takeoff, or since an edge of the voltage after it
    has_edge: Annotated[Scalar, Whole(0, 1)]  # flag: there was one
    operations: Annotated[Scalar, Count]  # from which it is known what is usual
    left: Scalar  # side of the stop that the mover left last, as a mode; 0: none yet
    spread: Scalar  # largest range of a part that is not repeated [deviations of the noise]
    learnt: Annotated[Scalar, Count]  # parts of either half of the last operation that became usual, or were dropped
    learns: Annotated[Scalar, Whole(0, 1)]  # flag: that operation had no sign
    innovation: Scalar  # takeoffs until this sign is forgotten, as the following
    other: Scalar
    seen: Annotated[Array, Memory(2 * PARTS)]  # in this operation
    usual: Annotated[Array, Memory(4 * PARTS)]  # from the lower stop on, then from the upper one on


class Now(NamedTuple):
    """A sample that is compared with what is usual."""

    innovation: Scalar  # of the filter, normalised [1]
    error: Scalar  # measured current minus that of the model alone [deviations of the noise]
    is_used: Scalar
    leaves: Scalar  # the stop that the mover of the model alone leaves in this sample, as a mode; 0: none
    is_edge: Scalar  # of the voltage


def unknown() -> Usual:
    """No operation so far."""
    return blank(Usual, surprise=1.0, learnt=float(RESTING))


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
    arrives, is_upper = (seen.lands > 0.0) & not_(seen.lands == before.left), seen.lands > 2.0
    usual = where(is_upper, before.short_upper, before.short_lower)
    bearable = where(arrives & (usual < EARLY - EARLIER), usual + EARLIER, EARLY)
    is_early = (seen.lands > 0.0) & (seen.short > bearable)
    learnt = where(seen.short > usual, seen.short, usual + LATER * (seen.short - usual))
    learns = arrives & not_(is_early)
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
        other=lasting(before.other, seen.is_other | is_early, is_over),
        short_lower=where(learns & not_(is_upper), learnt, before.short_lower),
        short_upper=where(learns & is_upper, learnt, before.short_upper),
    )


def compared(before: Usual, now: Now, limits: Limits) -> Usual:
    """One sample more.  What is usual is learnt from operations without a sign."""
    is_over = is_takeoff(before.left, now.leaves)
    surprised = mean(before.surprise, square(clip(now.innovation, -FAR, FAR)), limits.samples)
    biased = mean(before.bias, clip(now.error, -MOST, MOST), 0.5 * limits.samples)
    surprised, biased = where(now.is_used, surprised, before.surprise), where(now.is_used, biased, before.bias)
    part, later = (floor((before.samples + k) * PER_MEAN / limits.samples) for k in (0.0, 1.0))
    ends = (later > part) | now.is_edge
    half, first = before.has_edge * RESTING, where(before.left > 2.0, 2.0 * PARTS, 0.0)
    part = half + clip(part, 0.0, RESTING - 1.0)
    has_more = before.learnt < RESTING
    seen, usual, spread = cond(
        has_more, lambda: _learnt(before, 2.0 * PARTS - first), lambda: (before.seen, before.usual, before.spread)
    )

    def ended() -> tuple[Array, Scalar]:
        is_alike = (before.operations >= KNOWN) & (spread <= ALIKE)
        n = larger(floor(0.5 * before.operations), 0.5 * FEW)

        def is_unusual(beside: float, more: Scalar, slack: float) -> Scalar:
            above, below = (_most(usual, first, part, half, k * PARTS, beside) for k in (0, 1))
            most = more * (above + below - 2.0 * MOST) + slack
            return (MOST + biased > above + most) | (MOST - biased > below + most)

        is_beyond = is_unusual(1.0, where(is_alike, WIDER, larger(beyond(n), WIDER)), SLACK)
        is_beyond = is_beyond | (is_alike & is_unusual(BESIDE, ALIKE_WIDER, ALIKE_SLACK))
        is_known = (before.operations >= FEW) & (before.left > 0.0) & (load(usual, first + part) > 0.0)
        noted = seen
        for k, value in enumerate((MOST + biased, MOST - biased)):
            noted = store(noted, part, larger(load(noted, part, k * PARTS), value), k * PARTS)
        return noted, where(is_known & is_beyond, 1.0, 0.0)

    seen, is_other = cond(ends, ended, lambda: (seen, 0.0))
    is_learnt = (before.left > 0.0) & not_(before.innovation + before.other > 0.0) & not_(has_more)
    return Usual(
        surprise=surprised,
        bias=biased,
        samples=where(is_over | now.is_edge, 0.0, before.samples + 1.0),
        has_edge=where(is_over, 0.0, where(now.is_edge, 1.0, before.has_edge)),
        operations=before.operations + where(is_over & is_learnt, 1.0, 0.0),
        left=where(is_over, now.leaves, before.left),
        spread=spread,
        learnt=where(is_over, 0.0, before.learnt + where(has_more, 1.0, 0.0)),
        learns=where(is_over, where(is_learnt, 1.0, 0.0), before.learns),
        innovation=lasting(before.innovation, surprised >= limits.innovation, is_over),
        other=lasting(before.other, is_other > 0.0, is_over),
        seen=seen,
        usual=usual,
    )


def beyond(n: Scalar) -> Scalar:
    """How far a value may be beyond `n` others, in their range: k, so that 2 / (n + 1) (1 + k)^(1 - n) is `RARE`.

    That is the probability that it is farther, if all are spread evenly between two bounds that nobody knows.
    """
    return exp(log(2.0 / (RARE * (n + 1.0))) / (n - 1.0)) - 1.0


def _most(usual: Array, first: Scalar, part: Scalar, half: Scalar, k: int, beside: float) -> Scalar:
    """The most of a part, and a share of what those beside it in the same half have more.

    With another supply the mover comes sooner; where operations are alike, it comes when it came before.
    """
    before, after = (load(usual, first + clip(part + e, half, half + (RESTING - 1.0)), k) for e in (-1.0, 1.0))
    own = load(usual, first + part, k)
    return own + beside * (larger(larger(before, after), own) - own)


def _learnt(before: Usual, first: Scalar) -> tuple[Array, Array, Scalar]:
    """A part more of either half of the last operation is usual: the most so far, slowly less; and its spread.

    One in each sample, as all at once take long on a microcontroller; this operation comes to each of them later.
    """
    seen, usual, spread = before.seen, before.usual, before.spread
    for half in (0.0, float(RESTING)):
        k, width = half + before.learnt, -2.0 * MOST
        for side in (0, PARTS):
            new, old = load(seen, k, side), load(usual, first + k, side)
            is_new = (before.learns > 0.0) & (new > 0.0)
            now = where(is_new, where(new > old, new, old + FALL * (new - old)), old)
            seen, usual, width = store(seen, k, 0.0, side), store(usual, first + k, now, side), width + now
        is_repeated = before.learnt == RESTING - 1.0
        spread = where(is_repeated, spread, larger(spread, width))
    return seen, usual, spread


def larger(a: Scalar, b: Scalar) -> Scalar:
    """The larger one."""
    return where(a > b, a, b)


def is_takeoff(left: Scalar, leaves: Scalar) -> Scalar:
    """Whether the mover leaves another stop than before, so that a bounce is none."""
    return (leaves > 0.0) & not_(leaves == left)


def leaves(before: Scalar, now: Scalar, low: Scalar, high: Scalar) -> Scalar:
    """The stop that the position of the model alone leaves, as a mode; 0: none.  At rest it is some nm away from it."""
    near = AWAY * (high - low)
    low, high = low + near, high - near
    is_low, is_high = (before <= low) & (now > low), (before >= high) & (now < high)
    return where(is_low, 1.0, where(is_high, 3.0, 0.0))


def stationary(noise: Scalar, memory: Scalar, per: Scalar) -> Scalar:
    """Stationary standard deviation of a state with process noise `per` time [s] and a memory [s]."""
    return noise * sqrt(0.5 * where(memory > 0.0, memory, WANDERING) / per)
