"""SEMERA: resistance, inductance and flux linkage of a reluctance actuator from its voltage and current.

Algorithm 1 of [SEMERA].  State x = (r_k, l_k, l_(k-1)); process: r constant, l linear in time; observation: backward
difference of v = r i + d(l i)/dt.  It needs no model of the device.  Samples whose current cannot be told from noise
are of low quality: the estimates then follow the expert rule (r held, l of the resting device).  At a lost reading,
and at the sample after a lost current, nothing is learnt, and the published estimates are held.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from gapsense.estimators.kalman import Gaussian, condition, predict
from gapsense.estimators.readings import can_be_read
from gapsense.linalg import deviation, diagonal, matrix, vector
from gapsense.records import Array, Covariance, Scalar, Vector
from gapsense.trace import clip, cond, fabs, square, where

FINE, LOST = 1.0, 0.0  # health


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
    gate_update: Scalar  # 1: noise-only samples update the filter, within gate_decay; 0: they do not
    gate_decay: Scalar  # longest time after an operation in which they do; 0: always, as in the paper [s]
    range_voltage: Scalar  # a reading beyond counts as lost [V]
    range_current: Scalar  # [A]
    coil_turns: Scalar  # N, or 0 if unknown [1]


class State(NamedTuple):
    """What is carried from sample to sample."""

    x: Annotated[Array, Vector(3)]  # prior estimate of (r, l, previous l) for the next sample
    P: Annotated[Array, Covariance(3)]  # its covariance
    current: Scalar  # previous current measurement, or the last that was not lost [A]
    has_current: Scalar  # 1 if it is that of the previous sample
    is_gap: Scalar  # 1 if the previous sample could not be used, for a lost reading
    credit: Scalar  # time for which noise-only samples still update the filter [s]
    is_lone: Scalar  # 1 if the previous sample alone was outside the noise band: an operation starts, or it was noise
    rest_resistance: Scalar  # estimate before a lone sample, which holds if it was noise [ohm]
    rest_variance: Scalar  # its variance [ohm^2]
    resistance: Scalar  # last published resistance [ohm]
    inductance: Scalar  # last published inductance [H]


class Inputs(NamedTuple):
    """Measurements; a lost one is not a number."""

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
    health: Scalar  # 1 fine, 0 a reading was lost


def initial(inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """Prior, and iota_0 registered; the prior belongs to sample 1 and is not propagated."""
    r, l = par.prior_resistance, par.prior_inductance
    x, P = _at_rest(r, square(par.prior_resistance_std), par)
    has_current = where(can_be_read(inputs.current, par.range_current), 1.0, 0.0)
    i = where(has_current > 0.0, inputs.current, 0.0)
    health = where(can_be_read(inputs.voltage, par.range_voltage) & (has_current > 0.0), FINE, LOST)
    outputs = _outputs(i, par, r, l, P)._replace(innovation_std=par.noise_voltage, health=health)
    return State(
        x=x,
        P=P,
        current=i,
        has_current=has_current,
        is_gap=0.0,
        credit=0.0,
        is_lone=0.0,
        rest_resistance=r,
        rest_variance=P[0, 0],
        resistance=r,
        inductance=l,
    ), outputs


def _at_rest(r: Scalar, r_var: Scalar, par: Parameters) -> Gaussian:
    """Estimate for a device at rest, (25)-(26)."""
    l, l_var = par.prior_inductance, square(par.prior_inductance_std)
    return Gaussian(vector([r, l, l]), matrix([[r_var, 0.0, 0.0], [0.0, l_var, l_var], [0.0, l_var, l_var]]))


def step(state: State, inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """One sample, lines 5 to 16."""
    has_voltage = can_be_read(inputs.voltage, par.range_voltage)
    has_current = can_be_read(inputs.current, par.range_current)
    is_known = has_voltage & has_current & (state.has_current > 0.0)
    u, i = where(has_voltage, inputs.voltage, 0.0), where(has_current, inputs.current, state.current)
    i_prev, dt = state.current, par.sample_time
    is_outside, is_high = _is_outside(i, state, par)

    H = vector([i, i / dt, -i_prev / dt])  # (11)
    S = H @ (state.P @ H) + square(par.noise_voltage)  # sigma_v only, not (15): papers.md
    innovation = where(is_known, u - H @ state.x, 0.0)
    prior = Gaussian(state.x, state.P)
    updated = cond(  # lines 8 to 10, Joseph form: in float32 the printed one spoils r
        is_outside | _is_decay(state, par),
        lambda: condition(prior, vector([innovation]), matrix([H]), vector([square(par.noise_voltage)])),
        lambda: _rest(prior, state, par),
    )
    x, P = cond(is_known, lambda: updated, lambda: prior)

    quality = where(is_known & is_high, 1.0, 0.0)
    r = where(quality > 0.0, x[0], state.resistance)  # lines 14 and 15
    l = where(is_known, where(is_high, x[1], par.prior_inductance), state.inductance)
    health = where(has_voltage & has_current, FINE, LOST)
    extra = {"innovation": innovation, "innovation_std": deviation(S), "quality": quality, "health": health}
    outputs = _outputs(i, par, r, l, P)._replace(**extra)
    x, P = cond(  # a gap counts as one sample, however long: no inductance is extrapolated through it
        is_known | (state.is_gap <= 0.0), lambda: _predicted(Gaussian(x, P), par), lambda: prior
    )
    state = cond(is_known, lambda: _remembered(state, i, updated, par), lambda: state._replace(is_gap=1.0))
    has_current = where(has_current, 1.0, 0.0)
    return state._replace(x=x, P=P, current=i, has_current=has_current, resistance=r, inductance=l), outputs


def _remembered(state: State, i: Scalar, updated: Gaussian, par: Parameters) -> State:
    """What the next samples need to know of this one to tell an operation from noise."""
    is_outside, is_high = _is_outside(i, state, par)
    is_lone = is_outside & (where(is_high | _is_decay(state, par), 1.0, 0.0) <= 0.0)
    return state._replace(
        is_gap=0.0,
        credit=clip(state.credit + where(is_high, par.sample_time, -par.sample_time), 0.0, par.gate_decay),
        is_lone=where(is_lone, 1.0, 0.0),
        rest_resistance=where(is_lone, state.rest_resistance, updated.mean[0]),
        rest_variance=where(is_lone, state.rest_variance, updated.cov[0, 0]),
    )


def _is_outside(i: Scalar, state: State, par: Parameters) -> tuple[Scalar, Scalar]:
    """Whether the current is outside the noise band, and whether that before it is too, line 13."""
    band = par.gate_sigmas * par.noise_current
    return fabs(i) > band, (fabs(i) > band) & (fabs(state.current) > band)


def _is_decay(state: State, par: Parameters) -> Scalar:
    """Whether a noise-only sample updates the filter.

    Such samples tell how a decay ends, but in a long rest they pull r to zero, because H counts as exact.  So they are
    used as long as the operation before them lasted, and for `gate_decay` at most: not before the first operation.
    """
    return (par.gate_update > 0.0) & ((par.gate_decay <= 0.0) | (state.credit > 0.5 * par.sample_time))


def _predicted(estimate: Gaussian, par: Parameters) -> Gaussian:
    """Prior of the next sample, lines 11 and 12."""
    dt = par.sample_time
    F = matrix([[1.0, 0.0, 0.0], [0.0, 2.0, -1.0], [0.0, 1.0, 0.0]])  # (21)
    Q = diagonal([square(par.process_resistance_rate * dt), square(par.process_inductance_acceleration * dt * dt), 0.0])
    return Gaussian(F @ estimate.mean, predict(estimate.cov, F, Q))


def _rest(prior: Gaussian, state: State, par: Parameters) -> Gaussian:
    """The device rests: l is that of the prior, as if measured, and what this says of r is kept; l then restarts.

    If the sample before was a lone one, it was noise, and what it said of r is forgotten.
    """
    innovation = vector([par.prior_inductance - prior.mean[1]])
    x, P = condition(prior, innovation, matrix([[0.0, 1.0, 0.0]]), vector([square(par.prior_inductance_std)]))
    is_lone = state.is_lone > 0.0
    return _at_rest(where(is_lone, state.rest_resistance, x[0]), where(is_lone, state.rest_variance, P[0, 0]), par)


def _outputs(i: Scalar, par: Parameters, r: Scalar, l: Scalar, P: Array) -> Outputs:
    """Flux linkage (line 16), and flux and reluctance where N is known; without innovation, of low quality."""
    flux_linkage = l * i
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
        health=FINE,
    )
