"""Communication steps: whether one follows the other, and the samples in it.

Standard library only, because a copy travels in every FMU.
"""

from __future__ import annotations

import math

from .sentences import Refusal, say

TOLERANCE = 1e-9  # relative, on sizes of steps: hosts round
COARSEST = 0.25  # tolerance for steps that are hardly more than a rounding of their time
MOST_SAMPLES = 1e7  # in a step: minutes, in which nothing else happens
SHIFT, ROUNDINGS = 1e-6, 8  # of a step, and of its time, by which it may begin too early or too late


def refuse_jump(time: float, step: float, expected: float) -> None:
    """Refuse a step that does not begin where it is expected; `nan` expects it anywhere."""
    allowed = SHIFT * step + ROUNDINGS * math.ulp(max(abs(time), abs(expected)))
    if abs(time - expected) > allowed:
        raise Refusal(say("jump", time - expected, expected))


def samples_due(end: float, step: float, period: float, elapsed: float) -> tuple[int, float]:
    """How many samples fall due in a step, and the time from the last one to its end; inputs are held within it."""
    tolerance = min(TOLERANCE + 2.0 * math.ulp(end) / step, COARSEST)  # a step may be a difference of times
    ratio = step / period if step >= period else period / step
    if math.isinf(ratio) or abs(ratio - round(ratio)) > tolerance * ratio:
        raise Refusal(say("no_fraction", step, period))
    if step / period > MOST_SAMPLES:
        raise Refusal(say("too_many_samples", step, step / period, period))
    elapsed += step
    count = int(elapsed / period * (1.0 + tolerance))
    if count and abs(elapsed - count * period) > tolerance * elapsed:
        raise Refusal(say("past_sample", step, elapsed - count * period, period))
    return count, 0.0 if count else elapsed
