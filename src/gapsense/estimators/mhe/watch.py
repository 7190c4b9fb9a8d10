"""What `Mhe` notices of its readings and of the device, now: noise, PWM, edges between samples, strange operations."""

from __future__ import annotations

from typing import NamedTuple

from gapsense.estimators.mhe.model import Model, Parameters, Point, is_between
from gapsense.estimators.mhe.window import DOUBTFUL, PRACTISED, PROVEN, Learnt, Samples, bounces_on, drives, place
from gapsense.estimators.readings import JUMP
from gapsense.kernels.layout import Array, Scalar
from gapsense.kernels.trace import clip, fabs, flag, is_set, load, not_, sqrt, square, when, where

SAME = 30.0  # samples over which the model's error of the current is the same
# error of eddy currents in doubt, over their deviation before the first window, while the flux linkage rises or falls
RISING, FALLING = 1.6, 0.64
RECENT = 1.0 / 16.0  # weight of a sample in the mean of the innovations, and in those of a held voltage and its current
WILD = 15.0  # deviations of a current's bend between equal voltages: a spike
MEDIAN = 0.6745 * 20.0**0.5  # of the sizes of third differences, over the deviation of white noise
LEVELLING = 1.0 / 500.0  # share by which a sample moves the deviation of the noise that is seen
TOLD_TOO_LOW, TOO_NOISY = 1.3, 12.0  # times the noise that was told: what is seen counts; and is told
OFTEN, PULSED = 1.0 / 512.0, 0.02  # weight of a sample in the share of edges, and the share from which it is PWM
UNKNOWN = 0.5  # largest deviation of the eddy currents that counts
DOUBTED = 0.5  # doubt of the eddy currents from which a device needs longer until it is proven
MINOR = 0.8  # error of the current under PWM, whose minor loops the hysteresis of the model does not have, over I_h
ANYWHERE = 1.0 / 12.0  # variance of the place of an edge that may be anywhere in a sampling period [1]
PLACED = 1.0 / 8.0  # weight of an edge in that of the last ones
KNOWN, KNOWN_SOFT = 2.0, 4.0  # operations that were explained, after which innovations are judged; where more is learnt
YOUNG = 6.0  # how much patience there is at first
LEARNT = 0.25  # error of the current that what was learnt from such noise makes, over its deviation
BOTH = 2.0  # operations, a closing and an opening: a fault may show in one of them only
STRANGE, STRANGE_SOFT = 4.4, 6.1  # deviations of a mean innovation that no healthy device has; where more is learnt
LITTLE, EASY = 0.2, 0.5  # of saturation: little flux; share of the model's error that is left there
FINE = 0.7  # share of them within which an operation after a strange one is fine: what was learnt of a fault has more


class Edge(NamedTuple):
    """The last edge of the voltage: it was somewhere between two samples, and the model has it in one place."""

    place: Scalar = 0.0  # from where the model has it [sampling periods]
    variance: Scalar = 0.0  # of that
    faded: Scalar = 0.0  # flux linkage by which the model is off now if it is a whole period off [Wb]


class Watch(NamedTuple):
    """What is noticed."""

    noise: Scalar  # standard deviation of the current, as it is seen; at least what was told [A]
    is_driven: Scalar = 0.0  # flag: a voltage has come
    switching: Scalar = 0.0  # share of samples at an edge, among those with a voltage or an edge
    edge: Edge = Edge()
    spread: Scalar = ANYWHERE  # variance of the places of edges, of late
    surprise: Scalar = 0.0  # mean of the innovations, of late [A]
    is_large: Scalar = 0.0  # flag: it is too large now
    is_strange: Scalar = 0.0  # flag: it was too large in this operation, which begins with an edge of the voltage
    is_odd: Scalar = 0.0  # flag: it was too large in this operation to be fine
    is_moving: Scalar = 0.0  # flag: there was a motion in this operation
    is_proven: Scalar = 0.0  # flag: enough were explained when this operation began for it to be right without a sign
    suspicion: Scalar = 0.0  # operations that must be fine until one that was strange is forgotten
    was_commanded: Scalar = 0.0  # flag: the command has changed
    has_moved: Scalar = 0.0  # flag: there was a motion since then
    is_still: Scalar = 0.0  # flag: there was none between the two changes before
    is_bouncing: Scalar = 0.0  # flag: the mover bounces, and innovations do not count


class Seen(NamedTuple):
    """A sample."""

    innovation: Scalar
    has_current: Scalar
    relevance: Scalar  # of the current
    jump: Scalar  # of the voltage
    is_edge: Scalar  # whether that is an edge
    change: Scalar  # of the command
    is_fed_back: Scalar  # whether the current was fed back
    before: Point  # the causal estimate of the sample before


def weight(par: Parameters) -> Scalar:
    """w^2 of a current: noise, and an error of the model that is the same over some samples."""
    return 1.0 / (square(par.noise_current) + SAME * square(par.model_error))


def relevance(u: Scalar, i: Scalar, R: Scalar, doubt: Scalar, par: Parameters) -> Scalar:
    """w^2 of a current over `weight`: less while the flux linkage changes, as far as eddy currents are in doubt.

    With `option.further` all count alike.
    """
    rate, rises = u - R * i, fabs(u) > fabs(R * i)
    error = doubt * where(rises, RISING, FALLING) * clip(par.prior_eddy, 0.0, UNKNOWN) * par.core_eddy * rate
    more = where(is_set(par.option_further), 0.0, SAME * weight(par) * square(error))
    return 1.0 / (1.0 + more)


# readings


def is_wild(before: Samples, u: Scalar, i: Scalar, par: Parameters) -> Scalar:
    """A current that is far from the line through the last two, although the voltage has not changed."""
    last, older, _ = _last(before.currents, before, par)
    is_far = square(i - 2.0 * last + older) * weight(par) > square(WILD)
    return is_far & _is_held(before, u, par.edge + JUMP * par.noise_voltage, par)


def listen(before: Watch, samples: Samples, u: Scalar, i: Scalar, par: Parameters) -> Watch:
    """The noise of the current, whether a voltage has come, and the share of edges, with a new sample."""
    is_edge, is_driving = drives(u - load(samples.voltages, samples.newest), par), drives(u, par)
    step = where(is_edge | is_driving, OFTEN * (flag(is_edge) - before.switching), 0.0)
    return before._replace(
        noise=_noise(before.noise, samples, u, i, par),
        is_driven=where(is_driving, 1.0, before.is_driven),
        switching=before.switching + step,
    )


def _noise(noise: Scalar, before: Samples, u: Scalar, i: Scalar, par: Parameters) -> Scalar:
    """The median of the third differences where the voltage has not changed, by steps: spikes do not move it far."""
    last, older, oldest = _last(before.currents, before, par)
    is_more = fabs(i - 3.0 * last + 3.0 * older - oldest) > MEDIAN * noise
    moved = noise * where(is_more, 1.0 + LEVELLING, 1.0 - LEVELLING)
    counts = _is_held(before, u, JUMP * par.noise_voltage, par) & (moved > par.noise_current)
    return where(counts, moved, noise)


def _last(memory: Array, samples: Samples, par: Parameters) -> list[Scalar]:
    """The three newest entries, the newest first."""
    return [load(memory, place(samples.newest, age, par)) for age in (0.0, 1.0, 2.0)]


def _is_held(before: Samples, u: Scalar, most: Scalar, par: Parameters) -> Scalar:
    """The voltage has changed by no more than this in each of the last three samples and this one."""
    voltages = [u, *_last(before.voltages, before, par)]
    is_held: Scalar = True
    for new, old in zip(voltages, voltages[1:]):
        is_held = (fabs(new - old) <= most) & is_held
    return is_held


def _is_pulsed(watch: Watch) -> Scalar:
    return watch.switching > PULSED


def as_seen(watch: Watch, par: Parameters) -> Parameters:
    """The noise that is seen where it is larger than what was told; under PWM the error of the model that it makes."""
    noise, minor = watch.noise, MINOR * par.core_hysteresis
    has_loops = _is_pulsed(watch) & is_set(par.option_mean) & (minor > par.model_error)
    return par._replace(
        noise_current=where(noise > TOLD_TOO_LOW * par.noise_current, noise, par.noise_current),
        model_error=where(has_loops, minor, par.model_error),
    )


def is_untold(watch: Watch, told: Parameters) -> Scalar:
    """Much more noise than was told, or PWM that is sampled."""
    return (watch.noise > TOO_NOISY * told.noise_current) | (_is_pulsed(watch) & not_(is_set(told.option_mean)))


# operations


def watch_operation(before: Watch, seen: Seen, now: Point, learnt: Learnt, m: Model, par: Parameters) -> Watch:
    """An operation whose innovations are too large is strange; only two that are fine, with motions, take that back."""
    between = is_between(now, m)
    is_known, by_place = learnt.explained >= _known(par), now.mmf_slope * m.through
    is_bouncing = bounces_on(before.is_bouncing, seen.before, now, m)
    is_lost = is_bouncing & seen.is_edge  # nobody knows where the mover is when the next operation begins
    counts = seen.has_current & not_(seen.is_edge | is_bouncing)
    new = when(seen.is_edge, lambda watch: _begin(watch, is_known, learnt), before)
    edge = _place_edge(before.edge, new.spread, seen, counts & not_(between), now, m, par)
    unexpected = sqrt(seen.relevance) * (seen.innovation - by_place * edge.faded * edge.place)
    surprise = before.surprise + where(counts, RECENT * (unexpected - before.surprise), 0.0)
    is_easy = (learnt.explained >= PRACTISED) & (fabs(now.flux_linkage) < LITTLE * m.d.saturation)
    is_large = is_known & is_too_large(surprise, learnt, par, is_easy)
    is_other = is_set(par.option_command) & (fabs(seen.change) > 0.0)
    return new._replace(
        edge=edge,
        is_bouncing=flag(is_bouncing),
        surprise=surprise,
        is_large=flag(is_large),
        is_strange=where(is_large | is_lost | seen.is_fed_back, 1.0, new.is_strange),
        is_odd=where(is_too_large(surprise / FINE, learnt, par), 1.0, new.is_odd),
        is_moving=where(between, 1.0, new.is_moving),
        was_commanded=where(is_other, 1.0, before.was_commanded),
        has_moved=where(between, 1.0, where(is_other, 0.0, before.has_moved)),
        is_still=where(is_other, flag(is_set(before.was_commanded) & not_(is_set(before.has_moved))), before.is_still),
    )


def is_too_large(mean: Scalar, learnt: Learnt, par: Parameters, is_easy: Scalar = False) -> Scalar:
    """Whether the mean of some innovations is more than a healthy device has; `is_easy`: the model has less error."""
    error = where(is_easy, EASY, 1.0) * par.model_error
    usual = sqrt(square(par.noise_current) * (0.5 * RECENT + square(LEARNT)) + square(error))
    most, known = where(is_set(par.option_further), STRANGE_SOFT, STRANGE), _known(par)
    young = YOUNG / square(where(learnt.explained >= known, learnt.explained, known))
    return fabs(mean) > (1.0 + young) * most * usual


def _known(par: Parameters) -> Scalar:
    return where(is_set(par.option_further), KNOWN_SOFT, KNOWN)


def _begin(before: Watch, is_known: Scalar, learnt: Learnt) -> Watch:
    """An operation begins at an edge: the one before is judged, if it was one; how well edges are placed is learnt."""
    was_strange = is_set(before.is_strange)
    placed = PLACED * (square(before.edge.place) + before.edge.variance - before.spread)
    is_over = was_strange | is_set(before.is_moving)
    needed = where(learnt.explained > YOUNG, BOTH, 1.0)  # early ones are strange by what is yet to be learnt
    is_less = (before.suspicion > 0.0) & not_(is_set(before.is_odd))
    less = before.suspicion - flag(is_less)
    return before._replace(
        spread=before.spread + where(is_known & not_(was_strange), placed, 0.0),
        is_proven=flag(learnt.explained >= where(learnt.doubt > DOUBTED, DOUBTFUL, PROVEN)),
        is_strange=where(is_over, 0.0, before.is_strange),
        is_odd=where(is_over, 0.0, before.is_odd),
        is_moving=where(is_over, 0.0, before.is_moving),
        suspicion=where(is_over, where(was_strange, needed, less), before.suspicion),
    )


def _place_edge(before: Edge, spread: Scalar, seen: Seen, rests: Scalar, now: Point, m: Model, par: Parameters) -> Edge:
    """Kalman filter of the place of an edge, by the innovations at rest after it."""
    is_edge = seen.is_edge
    faded = where(is_edge, par.sample_time * seen.jump, before.faded * (1.0 - par.sample_time * m.load * now.mmf_slope))
    place, variance = where(is_edge, 0.0, before.place), where(is_edge, spread, before.variance)
    slope = faded * now.mmf_slope * m.through
    informs = where(rests, weight(par) * slope, 0.0)
    left = variance / (1.0 + informs * slope * variance)
    place = place + left * informs * (seen.innovation - slope * place)
    return Edge(clip(place, -0.5, 0.5), left, faded)


def is_strange(watch: Watch) -> Scalar:
    """Whether this operation is, or one was, and not two with a motion since then were fine."""
    return is_set(watch.is_strange) | (watch.suspicion > 0.0)


def is_unlearnt(watch: Watch, par: Parameters) -> Scalar:
    """A voltage has come, and too few motions were explained before this operation.

    With `option.further` windows are searched thoroughly from the first one on.
    """
    return is_set(watch.is_driven) & not_(is_set(watch.is_proven) | is_set(par.option_further))
