"""What `Mhe` does with a mover that something holds or moves between its stops: it feeds the current back.

Open loop, the model comes to a stop where a servo does not.  An extended Kalman filter of (lambda, z, v) on the learnt
model goes on where the mean innovation has been too large for some time, where a held voltage over its current is R, so
that coil and sensor are right, and where the little that R may be off does not explain it.  It begins with so little
trust in the state that the first currents decide (10), and ends at rest on a stop.  Where it explains the currents no
better, where a held voltage says that R is another one, or where no current is left to tell a position, it was no servo
but a fault: the model runs open loop again, at least until the next edge of the voltage.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, NamedTuple

from gapsense.estimators.gap import gap
from gapsense.estimators.kalman import Gaussian, condition, predict
from gapsense.estimators.mhe.model import (
    Model,
    Point,
    advance,
    current,
    electric,
    gain,
    is_between,
    is_resting,
    mean_of,
    point,
)
from gapsense.kernels.layout import Array, Scalar, Vector
from gapsense.kernels.linalg import diagonal, identity, matrix, vector
from gapsense.kernels.trace import clip, cond, fabs, flag, is_set, not_, square, when, where

LASTING = 2e-3  # time of too large innovations after which it begins or gives up, and of rest after which it ends [s]
AT_FIRST = (2e-3, 0.5e-3, 0.5)  # deviations of flux linkage, position and velocity where it begins [Wb], [m], [m/s]
FLUX, SPEED = 67e-6, 0.45  # deviations that come to flux linkage and velocity in a second [Wb/s^0.5], [m/s^1.5]
SAME_COIL, OTHER_COIL = 0.01, 0.03  # of R: how far off a held voltage over its current may be to begin, and later


class Follow(NamedTuple):
    """The filter; its mean is the causal estimate."""

    covariance: Annotated[Array, Vector(9)]  # of flux linkage, position, velocity; row by row
    is_on: Scalar = 0.0  # flag: the current is fed back
    is_futile: Scalar = 0.0  # flag: it was, and that was no servo; until the next edge of the voltage
    lasts: Scalar = 0.0  # samples in a row with too large innovations, since an edge, or since it began or ended
    rests: Scalar = 0.0  # samples in a row on a stop


class Reading(NamedTuple):
    """What is measured, and how far the current counts."""

    voltage: Scalar
    current: Scalar
    counts: Scalar  # whether it does
    variance: Scalar  # of it


class Coil(NamedTuple):
    """What is seen of the coil at a sample."""

    is_edge: Scalar  # of the voltage
    pulls: Scalar  # whether there is current enough to tell a position
    resistance: Scalar  # by a held voltage, or 0
    is_right: Scalar  # whether that explains the innovations


def feed_back(before: Point, follow: Follow, reading: Reading, m: Model) -> tuple[Array, Array]:
    """The next `Point` and the covariance (10), by i = (g_e u + f) / (1 + R g_e) with the derivatives of f."""
    now = advance(before, reading.voltage, m)
    F, Q = _transition(before, reading.voltage, m), diagonal([square(FLUX) * m.T_s, 0.0, square(SPEED) * m.T_s])
    P = predict(matrix([follow.covariance[3 * k : 3 * k + 3] for k in range(3)]), F, Q)
    H = m.through * vector([now.mmf_slope, now.slope * now.flux_linkage, 0.0])
    innovation = reading.current - current(now, mean_of(before.voltage, reading.voltage, m), m)

    def correct() -> tuple[Array, Array]:
        prior = Gaussian(vector([now.flux_linkage, now.position, now.velocity]), P)
        (lam, z, v), cov = condition(prior, vector([innovation]), matrix([H]), vector([reading.variance]))
        hits = ((z <= m.lower) & (v < 0.0)) | ((z >= m.upper) & (v > 0.0))
        at = point(lam, now.hysteresis, clip(z, m.lower, m.upper), where(hits, 0.0, v), reading.voltage, m)
        return vector(at), vector([*cov[0], *cov[1], *cov[2]])

    return cond(reading.counts, correct, lambda: (vector(now), vector([*P[0], *P[1], *P[2]])))


def _transition(p: Point, voltage: Scalar, m: Model) -> Array:
    """Derivatives of `advance` by flux linkage, position and velocity; at rest on a stop the last two stay."""
    step = gain(p, electric(p, mean_of(p.voltage, voltage, m), m), m.T_s, m) * m.load
    _, _, curvature = gap(p.position, m.gap, m.d.gap, m.d.bend)
    lam, moves = p.flux_linkage, where(is_resting(p, m), 0.0, 1.0)
    by = vector([-p.slope * lam, -m.stiffness - 0.5 * curvature * square(lam), -m.d.damping]) / m.d.mass
    F = identity(3)
    F[0] = F[0] - step * vector([p.mmf_slope, moves * p.slope * lam, 0.0])
    F[1] = F[1] + moves * (0.5 * square(m.T_s) * by + vector([0.0, 0.0, m.T_s]))
    F[2] = F[2] + moves * m.T_s * by
    return F


def decide(before: Follow, is_large: Scalar, is_edge: Scalar, seen: Callable[[], Coil], now: Point, m: Model) -> Follow:
    """Whether it begins or ends after a sample; as long as the mean innovation is not too large, it does not begin."""

    def wait() -> Follow:
        return before._replace(is_futile=flag(is_set(before.is_futile) & not_(is_edge)), lasts=0.0)

    is_lasting = is_large & not_(is_edge)
    return cond(is_set(before.is_on) | is_lasting, lambda: _change(before, is_lasting, seen(), now, m), wait)


def _change(before: Follow, is_lasting: Scalar, coil: Coil, now: Point, m: Model) -> Follow:
    is_on, long = is_set(before.is_on), LASTING / m.T_s
    lasts = where(is_lasting, before.lasts + 1.0, 0.0)
    rests = where(is_between(now, m), 0.0, before.rests + 1.0)
    off = fabs(coil.resistance - m.d.resistance) / m.d.resistance
    is_other = (coil.resistance > 0.0) & (off > OTHER_COIL)
    fails = is_on & ((lasts >= long) | is_other | not_(coil.pulls))
    was_futile = is_set(before.is_futile) & not_(coil.is_edge)
    begins = (lasts >= long) & coil.pulls & (off < SAME_COIL) & not_(coil.is_right | is_on | was_futile)
    ends = fails | (is_on & (rests >= long))
    first = vector([std * std if j == k else 0.0 for j, std in enumerate(AT_FIRST) for k in range(3)])
    return Follow(
        covariance=when(begins, lambda _: first, before.covariance),
        is_on=flag((is_on & not_(ends)) | begins),
        is_futile=flag(fails | was_futile),
        lasts=where(begins | ends, 0.0, lasts),
        rests=where(begins, 0.0, rests),
    )
