"""Checks of a filter on itself: wild samples, and signs of a wrong model that count until an operation is fine."""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

from gapsense.estimators.kalman import mean, normalise, surprise
from gapsense.kernels.elementary import log
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
TINY = 1e-12  # least variance that is divided by
MOST = 1e3  # deviations as which a larger error of the model's current counts
PARTS, PER_MEAN = 12, 4.0  # of half an operation, and how many of them are as long as `Limits.samples`
HALF = PARTS + 1  # entries of half an operation: the last part has its largest and its smallest mean
ENTRIES = 2 * HALF
FEW, MANY = 5.0, 100.0  # operations from which a curve is used, and over which it is learnt
LATELY = 12.0  # operations over which is learnt what drifts: it would add up to evidence
RARE = 4.5  # -log of about the probability of a mean that is far from its curve: twice this in two parts, thrice in one
SLACK = 0.1  # how far it may be beyond that [deviations]
KNOWN, SURE = 10.0, 100.0  # operations from which on noise may be all that they differ by; as how many that counts
ALONE = (0.25, 3.0)  # variance of a part that is noise alone, in that of noise
FLAT = (1e-3, 1e-3)  # variance of the supply, and of its square, times operations that bends nothing [V2, V4]
ALLOWED = 1.0  # what the -log of about the probability of a mean may be on the average, before it counts as evidence
MISFIT = 0.6  # share that counts where the model's error is larger than noise: several parts are wrong at once
PROVEN = 32.0  # evidence beyond which more adds nothing: it is to be gone soon after a fault
WITHIN = 4.0  # squared distance of a supply from the usual ones, in deviations, at which a parabola is half as sure
EDGE = 1.0  # change of the voltage beyond its noise from which on an operation is compared from there [V]
AWAY = 0.05  # share of the stroke within which the position of the model alone is at a stop
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


class Curve(NamedTuple):
    """Means, variances and covariances over operations: what the error of the model's current is at a supply."""

    n: Any  # operations
    supply: Any  # mean [V]
    square: Any  # mean of its square [V2]
    error: Any  # mean [deviations of the noise]
    supply_var: Any
    supply_square: Any  # covariance
    square_var: Any
    supply_error: Any
    square_error: Any
    error_var: Any
    lately: Any  # mean error beside the parabola in the last operations: what drifts, as a coil that warms


class Usual(NamedTuple):
    """How wrong the model's current usually is at each time of an operation: a wrong model has its own error in each.

    It is that of the model alone: a filter follows a fault with its flux linkage and hides it.  An operation lasts
    until the mover of that model leaves the other stop.  Each of its halves, the one from its takeoff and the one from
    an edge of the voltage on, has `PARTS`; the last one is repeated.  The mean is compared where a part ends, or at an
    edge: within one it may change fast.  It is compared with a parabola over the supply, as the errors of a wrong
    model depend on it.  What was seen in an operation is learnt in the first samples of the next one, which is
    compared with the curves of the other side.
    """

    surprise: Scalar  # mean of the squared normalised innovation [1]
    bias: Scalar  # mean of the error of the model's current over half as many samples [deviations of the noise]
    samples: Annotated[Scalar, Count]  # since the takeoff, or since an edge of the voltage after it
    has_edge: Annotated[Scalar, Whole(0, 1)]  # flag: there was one
    left: Scalar  # side of the stop that the mover left last, as a mode; 0: none yet
    supply: Scalar  # mean size of the voltage since it was switched on last [V]
    moving: Scalar  # that with which the mover of the model alone last left a stop before the next edge; 0: never [V]
    pulled: Scalar  # the stop that it left then first, as a mode; 0: none
    on: Annotated[Scalar, Count]  # samples since then, up to the next edge: later ones do not count
    spread: Scalar  # largest variance about the curves of the last operation, so far [1]
    spread_before: Scalar  # and about those of the one before it, of the side of this one
    learnt: Annotated[Scalar, Count]  # entries of either half of the last operation that were learnt, or dropped
    learns: Annotated[Scalar, Whole(0, 1)]  # flag: that operation had no sign
    innovation: Scalar  # takeoffs until this sign is forgotten, as the following
    other: Scalar
    apart: Scalar  # how far the last mean was from its curve: 0, 1 or 2, with its sign
    evidence: Scalar  # sum of the -log of about the probability of each mean, less what is allowed
    seen: Annotated[Array, Memory(2 * ENTRIES)]  # means of this operation plus `MOST`, 0: none; and the supplies
    curves: Annotated[Array, Memory(len(Curve._fields) * 2 * ENTRIES)]  # fields of `Curve`, each of both sides


class Now(NamedTuple):
    """A sample that is compared with what is usual."""

    innovation: Scalar  # of the filter, normalised [1]
    error: Scalar  # measured current minus that of the model alone [deviations of the noise]
    is_used: Scalar
    leaves: Scalar  # the stop that the mover of the model alone leaves in this sample, as a mode; 0: none
    is_edge: Scalar  # of the voltage
    voltage: Scalar  # [V]
    voltage_before: Scalar


def nothing_known() -> Usual:
    """Watch without an operation so far."""
    return blank(Usual, surprise=1.0, learnt=float(HALF))


def is_far(innovation: Scalar, std: Scalar, most: Scalar) -> Scalar:
    """Whether an innovation is beyond `most` standard deviations; with 0 none is."""
    return (most > 0.0) & (fabs(innovation) > most * std)


def near(value: Scalar, std: Scalar) -> Scalar:
    """A value, clipped to `FAR` standard deviations."""
    return clip(value, -FAR * std, FAR * std)


def patient(most: Scalar, far: Scalar) -> Scalar:
    """The limit for `is_far`, or 0 after `PATIENCE` such samples in a row."""
    return where(far < PATIENCE, most, 0.0)


def count(before: Scalar, is_so: Scalar) -> Scalar:
    """Count for how many samples in a row something is so."""
    return where(is_so, before + 1.0, 0.0)


def lasting(before: Scalar, is_so: Scalar, is_over: Scalar) -> Scalar:
    """A sign of a wrong model, as the takeoffs until it is forgotten."""
    return where(is_so, OPERATIONS, clip(before - where(is_over, 1.0, 0.0), 0.0, OPERATIONS))


def follow(before: Watch, seen: Seen, most: Scalar, limits: Limits) -> Watch:
    """Follow one more sample. An operation ends where the mover leaves another stop than before, not at a bounce."""
    innovation = near(seen.innovation, seen.innovation_std)
    surprised = surprise(before.surprise, innovation, seen.innovation_std, limits.samples)
    surprised = where(seen.is_used, surprised, before.surprise)
    biased = mean(before.bias, normalise(innovation, seen.innovation_std), limits.samples)
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
        far=count(before.far, is_far(seen.innovation, seen.innovation_std, most)),
        left=where(is_over, seen.leaves, before.left),
        innovation=lasting(before.innovation, is_surprised, is_over),
        current_error=lasting(before.current_error, strained >= square(limits.current_error), is_over),
        bound=lasting(before.bound, pressed >= OFTEN, is_over),
        other=lasting(before.other, seen.is_other | is_early, is_over),
        short_lower=where(learns & not_(is_upper), learnt, before.short_lower),
        short_upper=where(learns & is_upper, learnt, before.short_upper),
    )


def compare_with_usual(before: Usual, now: Now, limits: Limits, alike: float, evident: float) -> Usual:
    """Compare one more sample with what is usual, which is learnt from operations without a sign.

    They are alike but for noise if no variance is more than `alike` times that of noise.  Means that are not far from
    their curves add up to evidence, of which `evident` is a sign.
    """
    is_over = is_takeoff(before.left, now.leaves)
    surprised = mean(before.surprise, square(clip(now.innovation, -FAR, FAR)), limits.samples)
    biased = mean(before.bias, clip(now.error, -MOST, MOST), 0.5 * limits.samples)
    surprised, biased = where(now.is_used, surprised, before.surprise), where(now.is_used, biased, before.bias)
    has_more, side = before.learnt < HALF, where(before.left > 2.0, float(ENTRIES), 0.0)
    seen, curves, spread = cond(
        has_more, lambda: _learn_entry(before, ENTRIES - side), lambda: (before.seen, before.curves, before.spread)
    )
    part, later = (floor((before.samples + k) * PER_MEAN / limits.samples) for k in (0.0, 1.0))
    ends = (later > part) | now.is_edge
    noise = 1.0 / larger(limits.samples - 1.0, 1.0)
    reading = Reading(before.supply, biased, noise, before.spread_before < alike * noise)
    seen, far, evidence = cond(
        ends,
        lambda: _compare_part(before, part, side, seen, curves, reading),
        lambda: (seen, before.apart, before.evidence),
    )
    is_other = (ends & ((far * before.apart > 0.0) | (fabs(far) > 1.0))) | (evidence >= evident)
    is_learnt = (before.left > 0.0) & not_(before.innovation + before.other > 0.0) & not_(has_more)
    on, supply, moving, pulled = _find_supply(before, now, is_over)
    return Usual(
        surprise=surprised,
        bias=biased,
        samples=where(is_over | now.is_edge, 0.0, before.samples + 1.0),
        has_edge=where(is_over, 0.0, where(now.is_edge, 1.0, before.has_edge)),
        left=where(is_over, now.leaves, before.left),
        supply=supply,
        moving=moving,
        pulled=pulled,
        on=on,
        spread=where(is_over, 0.0, spread),
        spread_before=where(is_over, spread, before.spread_before),
        learnt=where(is_over, 0.0, before.learnt + where(has_more, 1.0, 0.0)),
        learns=where(is_over, where(is_learnt, 1.0, 0.0), before.learns),
        innovation=lasting(before.innovation, surprised >= limits.innovation, is_over),
        other=lasting(before.other, is_other, is_over),
        apart=far,
        evidence=evidence,
        seen=seen,
        curves=curves,
    )


class Reading(NamedTuple):
    """A mean that is compared with its curve."""

    supply: Any
    error: Any
    noise: Any  # variance of the mean by noise alone
    is_alike: Any  # such operations may differ by noise alone


class Bent(NamedTuple):
    """The parabola of a curve: error + slope (U - supply) + bend (U^2 - square - tilt (U - supply))."""

    slope: Any  # [deviations/V]
    bend: Any  # [deviations/V2]
    tilt: Any  # of the square over the supply [V]
    spread: Any  # variance of the supply
    rest: Any  # that of its square beside it
    variance: Any  # that of the errors beside both


def _compare_part(
    before: Usual, part: Scalar, side: Scalar, seen: Array, curves: Array, reading: Reading
) -> tuple[Array, Scalar, Scalar]:
    """Compare the mean of a part that ends with its curve, and note it.

    Returns what was seen, with this mean; how far it is from its curve; and the evidence so far.
    """
    half, is_last = before.has_edge * HALF, part >= PARTS - 1.0
    high = half + where(is_last, PARTS - 1.0, part)
    low = high + where(is_last, 1.0, 0.0)
    above, rare = _far(curves, side, high, half, reading)
    below = cond(is_last, lambda: _far(curves, side, low, half, reading)[0], lambda: above)
    value, is_new = MOST + reading.error, not_(load(seen, high) > 0.0)
    for k, sign in ((high, 1.0), (low, -1.0)):
        old = load(seen, k)
        is_more = not_(old > 0.0) | (is_last & (sign * value > sign * old))
        seen = store(seen, k, where(is_more, value, old))
        seen = store(seen, k, where(is_new, before.supply, load(seen, k, ENTRIES)), ENTRIES)
    far = where(above > 0.0, above, where(below < 0.0, below, 0.0))
    is_known = before.left > 0.0
    summed = clip(before.evidence + rare - ALLOWED, 0.0, PROVEN)
    is_summed = is_new & is_known & not_(is_last)
    return seen, where((is_new | is_last) & is_known, far, 0.0), where(is_summed, summed, before.evidence)


def _find_supply(before: Usual, now: Now, is_over: Scalar) -> tuple[Scalar, Scalar, Scalar, Scalar]:
    """Find the samples with a voltage, the supply, that which last pulled the mover, and the stop it left first."""
    is_on = now.is_edge & (fabs(now.voltage) > fabs(now.voltage_before))
    on = where(is_on, 1.0, where(now.is_edge | not_(before.on > 0.0), 0.0, before.on + 1.0))
    supply = before.supply + (fabs(now.voltage) - before.supply) / larger(on, 1.0)
    supply = where(on > 0.0, supply, before.supply)
    is_moving = is_over & (on > 0.0)
    pulled = where(is_moving & not_(before.pulled > 0.0), now.leaves, before.pulled)
    is_pulled = is_moving & (now.leaves == pulled)
    moving = where(is_pulled, supply, before.moving)
    on = where(is_moving & not_(is_pulled), 0.0, on)
    is_off = (before.on > 0.0) & not_(on > 0.0)  # one that pulled nothing, as a servo's, tells no supply
    return on, where(is_off & (moving > 0.0), moving, supply), moving, pulled


def _curve(curves: Array, at: Scalar) -> Curve:
    """The curve of an entry."""
    return Curve(*(load(curves, at, k * 2 * ENTRIES) for k in range(len(Curve._fields))))


def _fit_parabola(curve: Curve) -> Bent:
    """Fit a parabola to a curve, by one elimination."""
    straight, bowed = (flat / larger(curve.n, 1.0) for flat in FLAT)
    spread = curve.supply_var + straight
    slope, tilt = curve.supply_error / spread, curve.supply_square / spread
    rest = larger(curve.square_var - tilt * curve.supply_square, 0.0) + bowed
    beside = curve.square_error - tilt * curve.supply_error
    bend = beside / rest
    variance = larger(curve.error_var - slope * curve.supply_error - bend * beside, 0.0)
    return Bent(slope=slope, bend=bend, tilt=tilt, spread=spread, rest=rest, variance=variance)


def _far(curves: Array, side: Scalar, entry: Scalar, half: Scalar, at: Reading) -> tuple[Scalar, Scalar]:
    """How far an error is from the curve of its entry, with its sign, and -log of about the probability of that.

    It is 0 if that is not far, or there is no curve yet.  It is far if it is off by t deviations of the prediction from
    n operations, t^2 = m (exp(2 k RARE / m) - 1) with m = n - 3. That is about as rare for any n in Student's
    distribution; 1 with k = 2, 2 with k = 3.  The variance is the largest of an entry and of those beside it: with
    another supply the mover comes sooner or later, which is no parabola.
    """
    own = _curve(curves, side + entry)
    bent = _fit_parabola(own)
    variance = bent.variance
    for step in (-1.0, 1.0):
        beside = _curve(curves, side + clip(entry + step, half, half + PARTS))
        variance = larger(variance, _fit_parabola(beside).variance)
    n, away = larger(own.n, FEW), at.supply - own.supply
    is_noise = at.is_alike & (own.n >= KNOWN) & (variance > ALONE[0] * at.noise) & (variance < ALONE[1] * at.noise)
    m, each = where(is_noise, SURE, n - 3.0), where(is_noise, at.noise / n, variance / (n - 3.0))
    bow = square(at.supply) - own.square - bent.tilt * away
    off = at.error - own.error - bent.slope * away - bent.bend * bow - own.lately
    beyond = larger(fabs(off) - SLACK, 0.0)
    apart = square(away) / bent.spread + square(bow) / bent.rest
    unit = m * each * (n + 1.0 + apart * where(fabs(away) > EDGE, 1.0 + apart / WITHIN, 1.0))
    rare = where(own.n >= FEW, 0.5 * m * log(1.0 + square(beyond) / larger(unit, TINY)), 0.0)
    size = where(rare > 3.0 * RARE, 2.0, where(rare > 2.0 * RARE, 1.0, 0.0))
    return where(off > 0.0, size, -size), where(is_noise, 1.0, MISFIT) * rare


def _learn_entry(before: Usual, side: Scalar) -> tuple[Array, Array, Scalar]:
    """Learn one more entry of either half of the last operation, and forget what was seen there.

    One in each sample, because all at once would take long on a microcontroller. This operation reaches each entry
    later. Returns what is left to learn, the curves, and the largest variance about them.
    """
    seen, curves, spread = before.seen, before.curves, before.spread
    for half in (0.0, float(HALF)):
        k = half + before.learnt
        old, value, supply = _curve(curves, side + k), load(seen, k), load(seen, k, ENTRIES)
        is_new = (before.learns > 0.0) & (value > 0.0)
        n = where(old.n < MANY, old.n + 1.0, MANY)
        means = (old.supply, old.square, old.error)
        du, dq, de = (now - mean for now, mean in zip((supply, square(supply), value - MOST), means))
        products = (du * du, du * dq, dq * dq, du * de, dq * de, de * de)
        moved = (mean + d / n for mean, d in zip(means, (du, dq, de)))
        spreads = ((1.0 - 1.0 / n) * (entry + product / n) for entry, product in zip(old[4:-1], products))
        taught = Curve(*(n, *moved, *spreads, old.lately))
        bent = _fit_parabola(taught)
        du, dq, de = (now - mean for now, mean in zip((supply, square(supply), value - MOST), taught[1:4]))
        beside = de - bent.slope * du - bent.bend * (dq - bent.tilt * du)
        taught = taught._replace(lately=old.lately + (beside - old.lately) / LATELY)
        seen, spread = store(seen, k, 0.0), larger(spread, bent.variance)
        for j, (new, was) in enumerate(zip(taught, old)):
            curves = store(curves, side + k, where(is_new, new, was), j * 2 * ENTRIES)
    return seen, curves, spread


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
