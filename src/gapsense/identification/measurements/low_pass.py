"""The low-pass of instruments that both channels have, 1 / (1 + a s + b s^2), from the edges of the recorded voltage.

Its mean delay is a, of both channels.  So such a record is that of a sharp edge, a later than it was, and of what the
current of the device becomes in the filter without its mean delay.  Times are in samples.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache, partial
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import scipy

from gapsense.identification.measurements.signals import Vector, edges, hidden, noise
from gapsense.report.table import quantity

SHORTEST, APART = 1e-6, 1e-4  # time constant that stands for none, and difference of two that stands for equal ones
FIRST = 0.05  # b / a^2 of a filter that is nearly one of first order
RINGING = 1.0  # largest b / a^2; a filter of Butterworth has 0.5
TAIL = 9.0  # mean delays after which an edge is over


class LowPass(NamedTuple):
    """A filter of first or second order."""

    a: float
    b: float = 0.0

    def step(self, t: Vector) -> Vector:
        """Volts behind it since a step of 1 V at 0 (n,)."""
        return np.where(t > 0.0, 1.0 - self._left(t, 1), 0.0)

    def since(self, t: Vector) -> Vector:
        """Volt-samples behind it since then (n,)."""
        return np.where(t > 0.0, t - self.a + self._left(t, 2), 0.0)

    def _left(self, t: Vector, power: int) -> Vector:
        root = np.sqrt(complex(0.25 * self.a**2 - self.b))
        root = root if abs(root) > APART * self.a else complex(APART * self.a)
        both = [complex(max(x.real, SHORTEST), x.imag) for x in (0.5 * self.a + root, 0.5 * self.a - root)]
        one, other = (tau**power * np.exp(-np.maximum(t, 0.0) / tau) for tau in both)
        return np.asarray(((one - other) / (both[0] - both[1])).real)


class Ramp(LowPass):
    """In place of a filter, a driver whose edges have a steady slope: the current follows them, and is not filtered."""

    def step(self, t: Vector) -> Vector:
        """Volts since an edge of 1 V began at 0 (n,)."""
        return np.clip(0.5 * t / self.a, 0.0, 1.0)

    def since(self, t: Vector) -> Vector:
        """Volt-samples since then (n,)."""
        return np.where(t < 2.0 * self.a, 0.25 * np.maximum(t, 0.0) ** 2 / self.a, t - self.a)


@lru_cache(maxsize=256)  # of which a fit needs few more than once
def weights(of: LowPass) -> Vector:
    """By which a filter without its mean delay weighs half samples, the middle one being now (2 n + 1,)."""
    n = int(np.ceil(2.0 * TAIL * of.a)) + 1
    return np.asarray(2.0 * np.diff(of.since(np.arange(-n - 1.0, n + 2.0) / 2.0 + of.a), 2))


class Edge(NamedTuple):
    """Of the voltage before the filter."""

    at: float  # samples from the first one on
    size: float  # [V]


class Filtered(NamedTuple):
    """What the edges of a voltage tell."""

    low_pass: LowPass
    edges: Sequence[Edge]
    others: Sequence[LowPass] = ()  # which it may be as well, each one standard error off

    @property
    def reversed(self) -> Filtered:
        """That of the voltage of opposite sign."""
        return self._replace(edges=[Edge(at, -size) for at, size in self.edges])

    def describe(self, dt: float, is_filtered: bool = True) -> str:
        """Describe it in a sentence, for a sampling period [s], of both channels or of the driver alone."""
        (a, b), is_first = self.low_pass, self.low_pass.b < FIRST * self.low_pass.a**2
        if not is_filtered:
            return (
                f"The driver is slow: its edges come {quantity(a * dt, 's')} later on the average. The current follows"
                " them, and is not filtered."
            )
        corner = 1.0 / (2.0 * np.pi * dt * (a if is_first else np.sqrt(b)))
        return (
            f"Both channels come through a low-pass of {'first' if is_first else 'second'} order with a corner of about"
            f" {quantity(corner, 'Hz')}: edges are taken as sharp, and the current of the model is filtered alike."
            " If it is the output of the driver that is slow so, give `--voltage slow`."
        )

    def halves(self, v: Vector) -> Vector:
        """Means of the recorded voltage over the halves of the interval before each sample (n, 2) [V]."""
        smooth = v - self._sum(lambda t, size: size * self.low_pass.step(t), np.arange(float(v.size)))
        return np.stack((np.roll(smooth, 1), smooth), axis=1) + self._means(self.low_pass.since, v.size)

    def lacking(self, count: int) -> tuple[Vector, Vector]:
        """What so many samples (n,), and these means (n, 2), lack of sharp edges [V]."""
        a, step = self.low_pass.a, self.low_pass.step
        samples = self._sum(lambda t, size: size * ((t >= a) - step(t)), np.arange(float(count)))
        sharp = self._means(lambda t: np.maximum(t - a, 0.0), count)
        return samples, sharp - self._means(self.low_pass.since, count)

    def _sum(self, each: Callable[[Vector, float], Vector], t: Vector) -> Vector:
        return np.asarray(np.sum([each(t - at, size) for at, size in self.edges], axis=0))

    def _means(self, since: Callable[[Vector], Vector], count: int) -> Vector:
        passed = self._sum(lambda t, size: size * since(t), np.arange(2.0 * count + 1.0) / 2.0 - 1.0)
        return np.asarray(2.0 * np.diff(passed).reshape(-1, 2))


BEFORE, AFTER = 4, 6  # samples before an edge and at least so many after it that tell its levels
SEEN = 0.02  # of the range: what shows in a sample
CLAMPED = 0.1  # likewise: the least voltage of a clamp
FEWEST, ENOUGH = 2, 8  # edges that tell a filter
SIZES, STARTS = (0.05, 0.2, 0.6), (0.01, 0.4)  # a in parts of what an edge takes, and b / a^2
LENGTHS = (0.25, 0.5)  # a of a ramp, likewise
LOWEST, HIGHEST = -3.0, 4.0  # logarithm of a
CLEAR = 40.0  # squares of the noise that a filter must explain
EXACT, SMALL, MOST = 1e-6, 1e-6, 100  # least noise, of the range; fall of the cost that ends a search, and its steps


class Piece(NamedTuple):
    """Samples of a voltage about one edge."""

    first: int  # of them
    begin: int  # the last sample before the edge
    over: int  # that at its end
    v: Vector  # [V]

    def fit(self, low_pass: LowPass, at: float) -> tuple[Vector, float]:
        """What an edge behind the filter, between a level and a straight line, leaves (n,), and its size [V]."""
        t = np.arange(float(self.v.size)) + (self.first - at)
        return self._left(low_pass.step(t), low_pass.since(t))

    @property
    def sharp(self) -> Vector:
        """What a sharp edge leaves, with any value of the first sample after it (n,) [V]."""
        t = np.arange(float(self.v.size)) + (self.first - self.begin - 1.0)
        return self._left(t > 0.0, np.maximum(t, 0.0), t == 0.0)[0]

    def _left(self, step: npt.NDArray[Any], *others: npt.NDArray[Any]) -> tuple[Vector, float]:
        columns = np.stack((np.ones(self.v.size), step, *others), axis=1)
        found = np.linalg.pinv(columns) @ self.v
        return np.asarray(self.v - columns @ found), float(found[1])


def pieces(v: Vector) -> list[Piece]:
    """About every edge between two levels, but for the end of a record; none if they follow each other too fast."""
    found = edges(v, SEEN)
    windows = [slice(max(a - BEFORE, 0), b + 1 + AFTER + 3 * (b - a - 1)) for a, b in found]
    if any(window.stop > begin for window, (begin, _) in zip(windows, found[1:])):
        return []
    return [Piece(w.start, a, b, v[w]) for w, (a, b) in zip(windows, found) if w.stop <= v.size]


def tell(every: Sequence[Piece], v: Vector) -> tuple[list[Piece], list[Piece]]:
    """The first edges that tell a filter, and the others: where a clamp ends, an open coil rings by itself."""
    least = CLAMPED * float(np.ptp(v))

    def is_end(p: Piece) -> bool:
        return float(v[p.begin]) * float(v[every[0].over]) < -(least**2) and abs(float(p.v[-1])) < least

    told = [p for p in every if not is_end(p)][:ENOUGH]
    return told, [p for p in every if p not in told]


def low_pass_at(x: Vector) -> LowPass:
    """That of log(a) and b / a^2."""
    return LowPass(float(np.exp(x[0])), float(x[1] * np.exp(2.0 * x[0])))


def ramp_at(x: Vector) -> LowPass:
    """That of log(a)."""
    return Ramp(float(np.exp(x[0])))


def find_low_pass(v: Vector) -> Filtered | None:
    """The filter through which the edges of a voltage come, or their slope; None if they are sharp."""
    every, sigma = pieces(v), max(noise(v), hidden(v), EXACT * float(np.ptp(v)))
    told, rest = tell(every, v)
    sharp = np.concatenate([piece.sharp for piece in told]) / sigma if len(told) >= FEWEST else np.zeros(0)
    if sharp @ sharp <= sharp.size + CLEAR:
        return None
    width = max(p.over - p.begin for p in told)

    def least(left: Callable[[Vector], Vector], start: Sequence[float], around: Sequence[Piece], **more: Any) -> Any:
        low, high = [-1.0 - width] * len(around), [1.0] * len(around)  # places from the last sample before an edge on
        own = len(start) - len(around)  # numbers of the shape
        low, high = [*(LOWEST, 0.0)[:own], *low], [*(HIGHEST, RINGING)[:own], *high]
        return scipy.optimize.least_squares(left, start, bounds=(low, high), ftol=SMALL, xtol=SMALL, **more)

    def left(x: Vector, shape: Callable[[Vector], LowPass] = low_pass_at) -> Vector:
        own = zip(told, x[x.size - len(told) :])
        return np.concatenate([p.fit(shape(x), p.begin + float(at))[0] for p, at in own]) / sigma

    how, middle = {"x_scale": "jac", "method": "dogbox", "max_nfev": MOST}, [0.5] * len(told)
    found = [least(left, [np.log(a * width), q, *middle], told, **how) for a in SIZES for q in STARTS]
    best, shape = min(found, key=lambda each: float(each.cost)), low_pass_at
    for a in LENGTHS:
        ramp = least(partial(left, shape=ramp_at), [np.log(a * width), *middle], told, **how)
        best, shape = (ramp, ramp_at) if ramp.cost < best.cost else (best, shape)
    variance = max(1.0, 2.0 * float(best.cost) / sharp.size)
    if sharp @ sharp - 2.0 * best.cost <= CLEAR * variance:
        return None
    low_pass, places = shape(best.x), best.x[best.x.size - len(told) :].tolist()
    for p in rest:

        def alone(x: Vector, p: Piece = p) -> Vector:
            return p.fit(low_pass, p.begin + float(x[0]))[0] / sigma

        places += least(alone, [0.5], [p]).x.tolist()
    at = [(p, p.begin + place) for p, place in zip((*told, *rest), places)]
    made = [Edge(place, p.fit(low_pass, place)[1]) for p, place in at]
    return Filtered(low_pass, made, others(best, variance) if shape is low_pass_at else ())


def others(best: Any, variance: float) -> list[LowPass]:
    """Filters one standard error off a minimum, in both directions of what is known of it."""
    free = best.active_mask == 0
    covariance = np.zeros((free.size, free.size))
    covariance[np.ix_(free, free)] = variance * np.linalg.pinv(best.jac[:, free].T @ best.jac[:, free])
    sizes, directions = np.linalg.eigh(covariance[:2, :2])
    ways = (directions * np.sqrt(np.maximum(sizes, 0.0))).T
    return [low_pass_at(np.clip(best.x[:2] + way, (LOWEST, 0.0), (HIGHEST, RINGING))) for way in ways]
