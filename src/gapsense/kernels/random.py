"""Random numbers for kernels: uniform and normal, the same bits on every platform.

The generator is MRG32k3a (L'Ecuyer 1999, "Good parameters and implementations for combined multiple recursive random
number generators", Operations Research 47, doi:10.1287/opre.47.1.159): period 2^191, state of six whole numbers.  It
works in doubles that hold whole numbers below 2^53, so that nothing is rounded; a build in single precision is
meaningless.
"""

from __future__ import annotations

from gapsense.kernels.elementary import log
from gapsense.kernels.layout import Array, Scalar
from gapsense.kernels.linalg import vector
from gapsense.kernels.trace import cond, fabs, floor, loop, square, where

M1 = 4294967087.0  # 2^32 - 209, prime
M2 = 4294944443.0  # 2^32 - 22853, prime
HALF = 65536.0  # 2^16, splits a factor below 2^32
ROUND_CONSTANTS = (0x243F6A88, 0x85A308D3, 0x13198A2E, 0x03707344)  # the first binary digits of pi
CANDIDATES = 64  # of `normal`; all are rejected with a probability of 1e-36


def seed_state(seed: Scalar) -> Array:
    """Valid generator state (6,) for a seed, a whole number from 0 to 2^31 - 1.

    The words of the state are seed + 1 scrambled once, twice, ... six times.  The scrambling is a nonlinear bijection.
    The generator is linear: seeds spread by a linear congruence would leave u_n(s) - 2 u_n(s + 1) + u_n(s + 2) near a
    few fixed numbers modulo 1 for every n, however long the warm-up.  Runs over the seeds 1, 2, 3, ... would then not
    be independent.
    """
    words = loop(6, lambda *w: ((*w[1:], _scramble(w[-1])), False), (seed + 1.0,) * 6)
    return vector([*words[:3], *(where(w >= M2, w - M2, w) for w in words[3:])])


def uniform(state: Array) -> tuple[Array, Scalar]:
    """Next state and a number of uniform distribution in (0, 1), a multiple of 1/(2^32 - 208)."""
    a0, a1, a2, b0, b1, b2 = state
    a3 = _modulo(1403580.0 * a1 - 810728.0 * a0, M1)
    b3 = _modulo(527612.0 * b2 - 1370589.0 * b0, M2)
    difference = a3 - b3
    u = where(difference > 0.0, difference, difference + M1) * (1.0 / (M1 + 1.0))
    return vector([a1, a2, a3, b1, b2, b3]), u


def normal(state: Array) -> tuple[Array, Scalar]:
    """Next state and a number of standard normal distribution.

    Ratio of uniforms with quadratic bounds (Leva 1992, "A fast normal random number generator", ACM TOMS 18,
    doi:10.1145/138351.138364).  The number is a quotient of two exactly defined ones.  The only transcendental function
    is a logarithm in the comparison that 1.2 % of the candidates need.  How many uniforms are used up varies (2.74 on
    average).
    """
    return loop(CANDIDATES, lambda state, _: _candidate(state), (state, 0.0))


def _candidate(state: Array) -> tuple[tuple[Array, Scalar], Scalar]:
    """Next state with a candidate v/u, and whether (u, v) lies in the region v^2 <= -4 u^2 log u."""
    middle, u = uniform(state)
    after, w = uniform(middle)
    v = 1.7156 * (w - 0.5)
    x, y = u - 0.449871, fabs(v) + 0.386595
    q = square(x) + y * (0.196 * y - 0.25472 * x)
    is_near = (q >= 0.27597) & (q <= 0.27846)  # between the inner and the outer bound
    is_inside = cond(is_near, lambda: square(v) <= -4.0 * square(u) * log(u), lambda: q < 0.27597)
    return (after, v / u), is_inside


def _modulo(p: Scalar, m: float) -> Scalar:
    """Residue of a whole number of either sign, |p| < 2^21 m: so small a quotient cannot round up to a whole number."""
    return p - floor(p / m) * m


def _product(a: Scalar, b: Scalar) -> Scalar:
    """`a b` modulo M1 for factors below 2^32, by halves of `a` so that no intermediate value exceeds 2^49."""
    high = floor(a / HALF)
    return _modulo(_modulo(high * b, M1) * HALF + (a - high * HALF) * b, M1)


def _scramble(x: Scalar) -> Scalar:
    """Four rounds of x := (x + c)^3 modulo M1, each a bijection because 3 does not divide M1 - 1."""
    for c in ROUND_CONSTANTS:
        x = _modulo(x + float(c), M1)
        x = _product(_product(x, x), x)
    return x
