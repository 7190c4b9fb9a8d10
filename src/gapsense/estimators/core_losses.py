"""Core losses for the models of the estimators: eddy currents, hysteresis, and a sharper knee of saturation.

Eddy currents add g_e dlambda/dt to the magnetomotive force over N.  With dlambda/dt = u - R i this leaves the current
i = (g_e u + f)/(1 + R g_e) of a force f without them.  Hysteresis, by Dahl, adds h (1 + m^2) to f, m = lambda/lambda_s:

    dh/dlambda = (I_h - s h)/L,   s = sign(dlambda/dt),   L = l_h max(0.1, 1 - 0.9 m^2).

h is one number beside the state of an estimator, without a covariance.  It follows the flux linkage as the model
predicts it from sample to sample: what a measurement corrects does not move it.

The reluctance of the core R_c0 + K m^2/(1 - m^2) is flat for longer than that of Froehlich, R_c0/(1 - m), and bends
more sharply.  The three are independent; with g_e, I_h and K of zero all is as without this module, bit for bit.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from gapsense.kernels.elementary import exp
from gapsense.kernels.layout import Scalar
from gapsense.kernels.trace import cond, fabs, square, where

SHORTER = 0.9  # part of l_h that is lost at saturation
SHORTEST = 0.1  # part of it that is always left
SATURATED = 0.95  # |m| from which the reluctance goes on linearly: wrong parameters may pass 1


class Acting(NamedTuple):
    """Inputs held during an interval; records of the models have these fields too."""

    voltage: Scalar  # u of the interval [V]
    hysteresis: Scalar  # h [A]


class Losses(NamedTuple):
    """Coefficients of the core; records of the models have these fields too."""

    R: Scalar  # of the coil [ohm]
    lam_sat: Scalar  # flux linkage of saturation [Wb]
    eddy: Scalar  # conductance g_e [S]
    amplitude: Scalar  # largest h, I_h [A]
    length: Scalar  # flux linkage l_h in which h turns over [Wb]


def bent_reluctance(x: Scalar, reluctance: Scalar, bend: Scalar) -> tuple[Scalar, Scalar]:
    """Reluctance R_c0 + K x^2/(1 - x^2) of the core at x = |m|, and its derivative by x."""
    y = where(x < SATURATED, x, SATURATED)
    left = 1.0 - square(y)
    rate = 2.0 * bend * y / square(left)
    return reluctance + bend * square(y) / left + (x - y) * rate, rate


def share(core: Any) -> Scalar:
    """1/(1 + R g_e): the part of a magnetomotive force that the current makes; `core` has the fields of `Losses`."""
    return 1.0 / (1.0 + core.R * core.eddy)


def lossy(f: Scalar, lam: Scalar, held: Any, core: Any) -> Scalar:
    """Current [A] for the magnetomotive force over N without losses, `f` [A]; `held` has the fields of `Acting`."""
    left = share(core)

    def with_losses() -> Scalar:
        h = held.hysteresis * (1.0 + square(lam / core.lam_sat))
        return (core.eddy * held.voltage + (f + h)) * left

    return cond((core.eddy > 0.0) | (core.amplitude > 0.0), with_losses, lambda: f)


def advance_hysteresis(h: Scalar, lam: Scalar, change: Scalar, core: Any) -> Scalar:
    """State h after a `change` of the flux linkage from `lam`; exact for L as at its beginning."""

    def turned() -> Scalar:
        rest = 1.0 - SHORTER * square(lam / core.lam_sat)
        end = where(change >= 0.0, core.amplitude, -core.amplitude)
        return end + (h - end) * exp(-fabs(change) / (core.length * where(rest > SHORTEST, rest, SHORTEST)))

    return cond(core.amplitude > 0.0, turned, lambda: h)
