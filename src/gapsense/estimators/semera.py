"""SEMERA: resistance, inductance and flux linkage of a reluctance actuator from its voltage and current.

Algorithm 1 of [SEMERA].  State x = (r_k, l_k, l_(k-1)); process: r constant, l linear in time; observation: backward
difference of v = r i + d(l i)/dt.  It needs no model of the device.  Samples whose current cannot be told from noise
are of low quality: the estimates then follow the expert rule (r held, l of the resting device).
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from gapsense.estimators.kalman import Gaussian, condition, predict
from gapsense.linalg import deviation, diagonal, matrix, vector
from gapsense.records import Array, Covariance, Scalar, Vector
from gapsense.trace import cond, fabs, square, where


class Parameters(NamedTuple):
    """Tuning, Tables II and V."""

    sample_time: Scalar  # Delta [s]
    prior_resistance: Scalar  # mean of r_0 [ohm]
    prior_resistance_std: Scalar  # sigma of r_0 [ohm]
    prior_inductance: Scalar  # mean of l_0, the resting device [H]
    prior_inductance_std: Scalar  # sigma of l_0 [H]
    process_resistance_rate: Scalar  # sigma of dr/dt [ohm/s]
    process_inductance_acceleration: Scalar  # sigma of d2l/dt2 [H/s^2]
    noise_voltage: Scalar  # sigma_v [V]
    noise_current: Scalar  # sigma_i [A]
    gate_sigmas: Scalar  # n_sigma [1]
    gate_update: Scalar  # 1: every sample updates the filter, as in the paper; 0: noise-only samples do not
    coil_turns: Scalar  # N, or 0 if unknown [1]


class State(NamedTuple):
    """What is carried from sample to sample."""

    x: Annotated[Array, Vector(3)]  # prior estimate of (r, l, previous l) for the next sample
    P: Annotated[Array, Covariance(3)]  # its covariance
    current: Scalar  # previous current measurement [A]
    resistance: Scalar  # last published resistance [ohm]


class Inputs(NamedTuple):
    """Measurements."""

    voltage: Scalar  # u_k [V]
    current: Scalar  # iota_k [A]


class Outputs(NamedTuple):
    """Estimates at the sample."""

    resistance: Scalar
    inductance: Scalar
    flux_linkage: Scalar
    quality: Scalar  # 1 if both currents are outside the noise band, else 0
    resistance_std: Scalar
    inductance_std: Scalar
    innovation: Scalar
    innovation_std: Scalar
    flux: Scalar
    reluctance: Scalar


def initial(inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """Prior, and iota_0 registered; the prior belongs to sample 1 and is not propagated."""
    r, l = par.prior_resistance, par.prior_inductance
    x, P = _at_rest(r, square(par.prior_resistance_std), par)
    outputs = _outputs(inputs, par, r, l, P)._replace(innovation_std=par.noise_voltage)
    return State(x=x, P=P, current=inputs.current, resistance=r), outputs


def _at_rest(r: Scalar, r_var: Scalar, par: Parameters) -> Gaussian:
    """Estimate for a device at rest, (25)-(26)."""
    l, l_var = par.prior_inductance, square(par.prior_inductance_std)
    return Gaussian(vector([r, l, l]), matrix([[r_var, 0.0, 0.0], [0.0, l_var, l_var], [0.0, l_var, l_var]]))


def step(state: State, inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """One sample, lines 5 to 16."""
    u, i, i_prev, dt = inputs.voltage, inputs.current, state.current, par.sample_time
    band = par.gate_sigmas * par.noise_current
    is_high = (fabs(i) > band) & (fabs(i_prev) > band)  # line 13

    H = vector([i, i / dt, -i_prev / dt])  # (11)
    R = square(par.noise_voltage)  # sigma_v only, not (15): papers.md
    S = H @ (state.P @ H) + R
    innovation = u - H @ state.x
    is_used = (fabs(i) > band) | (par.gate_update > 0.0)
    prior = Gaussian(state.x, state.P)
    x, P = cond(  # lines 8 to 10, Joseph form: in float32 the printed one spoils r
        is_used, lambda: condition(prior, vector([innovation]), matrix([H]), vector([R])), lambda: _rest(prior, par)
    )

    r = where(is_high, x[0], state.resistance)  # lines 14 and 15
    l = where(is_high, x[1], par.prior_inductance)
    outputs = _outputs(inputs, par, r, l, P)
    outputs = outputs._replace(quality=where(is_high, 1.0, 0.0), innovation=innovation, innovation_std=deviation(S))

    F = matrix([[1.0, 0.0, 0.0], [0.0, 2.0, -1.0], [0.0, 1.0, 0.0]])  # (21)
    Q = diagonal([square(par.process_resistance_rate * dt), square(par.process_inductance_acceleration * dt * dt), 0.0])
    return State(x=F @ x, P=predict(P, F, Q), current=i, resistance=r), outputs  # lines 11 and 12


def _rest(prior: Gaussian, par: Parameters) -> Gaussian:
    """The device rests: l is that of the prior, as if measured, and what this says of r is kept; l then restarts."""
    innovation = vector([par.prior_inductance - prior.mean[1]])
    x, P = condition(prior, innovation, matrix([[0.0, 1.0, 0.0]]), vector([square(par.prior_inductance_std)]))
    return _at_rest(x[0], P[0, 0], par)


def _outputs(inputs: Inputs, par: Parameters, r: Scalar, l: Scalar, P: Array) -> Outputs:
    """Flux linkage (line 16), and flux and reluctance where N is known; without innovation, of low quality."""
    flux_linkage = l * inputs.current
    has_turns = par.coil_turns > 0.0
    N = where(has_turns, par.coil_turns, 1.0)
    is_usable = has_turns & (fabs(l) > 0.0)
    return Outputs(
        resistance=r,
        inductance=l,
        flux_linkage=flux_linkage,
        quality=0.0,
        resistance_std=deviation(P[0, 0]),
        inductance_std=deviation(P[1, 1]),
        innovation=0.0,
        innovation_std=0.0,
        flux=where(has_turns, flux_linkage / N, 0.0),
        reluctance=where(is_usable, N * N / where(is_usable, l, 1.0), 0.0),
    )
