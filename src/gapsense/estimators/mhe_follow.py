"""What `Mhe` does with a mover that something holds or moves between its stops: it feeds the current back.

Open loop, the model comes to a stop where a servo does not.  Where the mean innovation has been too large for some time,
an extended Kalman filter of (lambda, z, v) on the learnt model follows, begun with so little trust in the state that the
first currents decide.  It ends at rest on a stop.  Where it explains the currents no better, or where a held voltage
says that R is another one, it was no servo but a fault: the model runs on open loop until the next edge.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from gapsense.estimators.gap import gap
from gapsense.estimators.kalman import Gaussian, condition, predict
from gapsense.estimators.mhe_model import Model, Point, advance, current, electric, gain, is_resting, mean_of, point
from gapsense.linalg import diagonal, identity, matrix, vector
from gapsense.records import Array, Scalar, Vector
from gapsense.trace import clip, cond, fabs, not_, square, where

PERSISTENT = 2e-3  # time of too large innovations until it follows, or gives up [s]
AT_FIRST = (2e-3, 0.5e-3, 0.5)  # deviations of flux linkage, position and velocity where it begins [Wb], [m], [m/s]
FLUX, SPEED = 0.3e-6, 2e-3  # standard deviations that a sample of 20 us adds to flux linkage and velocity [Wb], [m/s]
SAMPLE = 20e-6  # [s]
OTHER_COIL = 0.03  # of R: a held voltage over its current says that something else is wrong


class Follow(NamedTuple):
    """The filter; its mean is the causal estimate."""

    is_on: Scalar  # 1: it follows
    is_futile: Scalar  # 1: it did, and that was no servo; until the next edge of the voltage
    persists: Scalar  # samples in a row with too large innovations, since it began or ended
    rests: Scalar  # samples in a row on a stop
    covariance: Annotated[Array, Vector(9)]


class Sample(NamedTuple):
    """What is measured, and how far it counts."""

    voltage: Scalar
    current: Scalar
    counts: Scalar  # 1: the current does
    variance: Scalar  # of it


class Coil(NamedTuple):
    """What is seen of the coil at a sample."""

    is_large: Scalar  # whether the mean innovation is too large
    is_edge: Scalar  # of the voltage
    pulls: Scalar  # whether there is current enough to tell where the mover is
    resistance: Scalar  # by a held voltage, or 0


def first_follow() -> Follow:
    """It does not follow."""
    return Follow(is_on=0.0, is_futile=0.0, persists=0.0, rests=0.0, covariance=vector([0.0] * 9))


def followed(before: Point, follow: Follow, seen: Sample, m: Model) -> tuple[Array, Array]:
    """The next `Point` and the covariance, with the current fed back.

    i = through (g_e u + f), so that di/dlambda = through f_lambda and di/dz = through R_g' lambda.
    """
    F, now = _transition(before, seen.voltage, m), advance(before, seen.voltage, m)
    of_time = m.T_s / SAMPLE
    P = predict(
        matrix([follow.covariance[3 * k : 3 * k + 3] for k in range(3)]),
        F,
        diagonal([square(FLUX) * of_time, 0.0, square(SPEED) * of_time]),
    )
    by = vector([m.through * now.mmf_slope, m.through * now.slope * now.flux_linkage, 0.0])
    innovation = seen.current - current(now, mean_of(before.voltage, seen.voltage, m), m)
    prior = Gaussian(vector([now.flux_linkage, now.position, now.velocity]), P)

    def corrected() -> tuple[Array, Array]:
        (lam, free, v), P = condition(prior, vector([innovation]), matrix([by]), vector([seen.variance]))
        z = clip(free, m.lower, m.upper)
        hits = ((z <= m.lower) & (v < 0.0)) | ((z >= m.upper) & (v > 0.0))
        at = point(lam, now.hysteresis, z, where(hits, 0.0, v), seen.voltage, m)
        return vector(at), vector([*P[0], *P[1], *P[2]])

    return cond(seen.counts, corrected, lambda: (vector(now), vector([*P[0], *P[1], *P[2]])))


def _transition(p: Point, voltage: Scalar, m: Model) -> Array:
    """Derivatives of `advance` by flux linkage, position and velocity; at rest on a stop the last two stay."""
    step = gain(p, electric(p, mean_of(p.voltage, voltage, m), m), m.T_s, m) * m.load
    _, _, curvature = gap(p.position, m.gap, m.d.gap, m.d.bend)
    lam, T_s, mass = p.flux_linkage, m.T_s, m.d.mass
    by = vector([-p.slope * lam, -m.stiffness - 0.5 * curvature * square(lam), -m.d.damping]) / mass
    F = identity(3)
    moves = where(is_resting(p, m), 0.0, 1.0)
    F[0] = F[0] - step * vector([p.mmf_slope, moves * p.slope * lam, 0.0])
    F[1] = F[1] + moves * (0.5 * square(T_s) * by + vector([0.0, 0.0, T_s]))
    F[2] = F[2] + moves * T_s * by
    return F


def noticed(before: Follow, coil: Coil, now: Point, m: Model) -> Follow:
    """Whether it begins or ends after a sample."""
    persists, is_on = where(coil.is_large & not_(coil.is_edge), before.persists + 1.0, 0.0), before.is_on > 0.0
    is_on_stop = (now.position <= m.lower) | (now.position >= m.upper)
    rests = where(is_on_stop, before.rests + 1.0, 0.0)
    lasts = persists >= PERSISTENT / m.T_s
    R = coil.resistance
    is_other = (R > 0.0) & (fabs(R - m.d.resistance) > OTHER_COIL * m.d.resistance) | not_(coil.pulls)
    is_futile = is_on & (lasts | is_other)
    ends = is_futile | (is_on & (rests >= PERSISTENT / m.T_s))
    was_futile = (before.is_futile > 0.0) & not_(coil.is_edge)
    begins = lasts & not_(is_on) & not_(was_futile | is_other)
    fresh = vector([s for k, std in enumerate(AT_FIRST) for s in (square(std) if n == k else 0.0 for n in range(3))])
    return Follow(
        is_on=where((is_on & not_(ends)) | begins, 1.0, 0.0),
        is_futile=where(is_futile | was_futile, 1.0, 0.0),
        persists=where(begins | ends, 0.0, persists),
        rests=where(begins, 0.0, rests),
        covariance=cond(begins, lambda: fresh, lambda: before.covariance),
    )
