"""SEMERA with fewer operations, for processors without a floating-point unit: `gapsense export-c semera --lean`.

The same filter, but rounded differently. The state has the inductances in multiples of the sampling period, l / Delta,
so that H = (i, i, -i_prev) needs no division, and one reciprocal replaces three divisions. Only one half of the
covariance is computed, in Joseph form as before. What rounding makes negative is set right once per sample, in the
prediction.
"""

from __future__ import annotations

from gapsense.estimators.kalman import Gaussian
from gapsense.estimators.semera import Form, Inputs, Outputs, Parameters, Seen, State, first, sample
from gapsense.kernels.layout import Array, Scalar
from gapsense.kernels.linalg import outer, pivot, symmetric, vector
from gapsense.kernels.trace import square

__all__ = ["Inputs", "Outputs", "Parameters", "State", "initial", "step"]


def initial(inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """Prior, and the first current registered."""
    return first(inputs, par, LEAN)


def step(state: State, inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """One sample."""
    return sample(state, inputs, par, LEAN)


def _see(prior: Gaussian, inputs: Inputs, i_prev: Scalar, par: Parameters) -> Seen:
    (u, i), R = inputs, square(par.noise_voltage)

    def measured(x: Array) -> Scalar:  # H x
        return i * x[0] + i * x[1] - i_prev * x[2]  # not i (x_0 + x_1): r is small beside l / Delta, and loses digits

    Ph = vector([measured(row) for row in prior.cov])
    S = measured(Ph) + R
    innovation = u - measured(prior.mean)

    def posterior() -> Gaussian:
        K = Ph * (1.0 / pivot(S))
        AP = symmetric(prior.cov - outer(K, Ph))
        rest = vector([measured(row) for row in AP]) - K * R
        return Gaussian(prior.mean + K * innovation, symmetric(AP - outer(rest, K)))

    return Seen(innovation, S, posterior)


LEAN = Form(unit=lambda par: par.sample_time, seen=_see)
