"""SEMERA: resistance, inductance and flux linkage of a reluctance actuator from its voltage and current.

Algorithm 1 of [SEMERA].  State x = (r_k, l_k, l_(k-1)); process: r constant, l linear in time; observation: backward
difference of v = r i + d(l i)/dt.  It needs no model of the device.  Samples whose current cannot be told from noise
are of low quality: the estimates then follow the expert rule (r held, l of the resting device).

Noise-only samples pull r to zero, because H counts as exact.  So, as an addition, the filter falls asleep some time
after an operation; each of them then starts it anew, with what it knew of r, until the next operation begins.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, NamedTuple

from gapsense.estimators import readings
from gapsense.estimators.kalman import Gaussian, condition, predict
from gapsense.kernels.interface import option, output, parameter, ports, sample_time
from gapsense.kernels.layout import Array, Covariance, Scalar, Vector
from gapsense.kernels.linalg import deviation, diagonal, matrix, vector
from gapsense.kernels.trace import cond, fabs, not_, square, where

CERTAIN = 5e-3  # of the resistance, that its standard deviation may be; with more the device is not learnt yet
AWAKENING = 10.0  # samples in a row outside the noise band that make an operation; noise of a small offset never does


@ports()
class Parameters(NamedTuple):
    """Tuning, Tables II and V."""

    sample_time: Scalar = sample_time(50e-6)  # Delta
    prior_resistance: Scalar = parameter("Ohm", "Expected resistance at the start", 77.5, min=1e-9)  # mean of r_0
    prior_resistance_std: Scalar = parameter("Ohm", "Its standard deviation", 1.0, min=0.0)  # sigma of r_0
    prior_inductance: Scalar = parameter("H", "Expected inductance at rest", 50e-3, min=0.0)  # mean of l_0
    prior_inductance_std: Scalar = parameter("H", "Its standard deviation", 5e-3, min=0.0)  # sigma of l_0
    process_resistance_rate: Scalar = parameter("Ohm/s", "Standard deviation of the resistance's rate", 1.0, min=0.0)
    process_inductance_acceleration: Scalar = parameter("H/s2", "Standard deviation of d2l/dt2", 1e8, min=0.0)
    noise_voltage: Scalar = parameter("V", "Standard deviation of the voltage noise", 15e-3, min=0.0)  # sigma_v
    noise_current: Scalar = parameter("A", "Standard deviation of the current noise", 1e-3, min=0.0)  # sigma_i
    gate_sigmas: Scalar = parameter(
        "1", "Half width of the noise band, in standard deviations (3.29: 99.9 %)", 3.29, min=0.0
    )  # n_sigma
    gate_update: Scalar = option("Noise-only samples update the filter while it sleeps, too", True)
    gate_decay: Scalar = parameter(
        "s",
        "Time after an operation until the filter falls asleep and learns no more from noise; 0: never, as printed",
        5e-3,
        min=0.0,
    )
    range_voltage: Scalar = readings.RANGE_VOLTAGE
    range_current: Scalar = readings.RANGE_CURRENT
    coil_turns: Scalar = parameter("1", "Number of turns, for flux and reluctance; 0: unknown", 0.0, min=0.0)


class State(NamedTuple):
    """What is carried from sample to sample."""

    x: Annotated[Array, Vector(3)]  # prior estimate of (r, l, previous l) for the next sample, l in the form's unit
    P: Annotated[Array, Covariance(3)]  # its covariance
    current: Scalar  # last current measurement that was not lost [A]
    lost: Scalar  # 1 if a reading of the previous sample was lost, else 0
    awake: (
        Scalar  # up to AWAKENING, samples in a row outside the noise band; above, those until the filter falls asleep
    )
    rest_resistance: Scalar  # r before the filter fell asleep [ohm]
    rest_variance: Scalar  # its variance [ohm^2]
    resistance: Scalar  # last published resistance [ohm]


@ports()
class Inputs(NamedTuple):
    """Measurements; a lost one is not a number."""

    voltage: Scalar = readings.VOLTAGE
    current: Scalar = readings.CURRENT


@ports(feedthrough=("voltage", "current"))
class Outputs(NamedTuple):
    """Estimates at the sample."""

    resistance: Scalar = output("Ohm", "Estimated coil resistance", nominal=76.0)
    inductance: Scalar = output("H", "Estimated apparent inductance", nominal=0.1)
    flux_linkage: Scalar = output("Wb", "Estimated flux linkage", nominal=0.02)
    quality: Scalar = output(
        "1", "1: current outside the noise band; 0: estimates follow the expert rule", min=0.0, max=1.0
    )
    resistance_std: Scalar = output("Ohm", "Standard deviation of the resistance in the filter", min=0.0)
    inductance_std: Scalar = output("H", "Standard deviation of the inductance in the filter", nominal=0.01)
    innovation: Scalar = output("V", "Measured minus predicted voltage")
    innovation_std: Scalar = output("V", "Standard deviation expected of the innovation")
    flux: Scalar = output("Wb", "Estimated flux; 0 while coil.turns is 0", nominal=2e-5)
    reluctance: Scalar = output("1/H", "Estimated reluctance; 0 while coil.turns is 0", nominal=1e7)
    health: Scalar = readings.HEALTH
    health_causes: Scalar = readings.HEALTH


class Seen(NamedTuple):
    """Result of one sample."""

    innovation: Scalar
    variance: Scalar  # of the innovation
    posterior: Callable[[], Gaussian]


class Form(NamedTuple):
    """Form of the filter: as printed here, with fewer operations in `semera_lean`."""

    unit: Callable[[Parameters], Scalar]  # in which the state has l [H]
    seen: Callable[[Gaussian, Inputs, Scalar, Parameters], Seen]  # by a prior, with the current of the last sample


def initial(inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """Prior, and iota_0 registered, as after a gap; the prior belongs to sample 1 and is not propagated."""
    return first(inputs, par, PRINTED)


def step(state: State, inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """One sample; one with a lost reading, and the one after it, are not used."""
    return sample(state, inputs, par, PRINTED)


def first(inputs: Inputs, par: Parameters, form: Form) -> tuple[State, Outputs]:
    """`initial` for a form of the filter."""
    r, r_var = par.prior_resistance, square(par.prior_resistance_std)
    x, P = _at_rest(r, r_var, par, form)
    before = State(x, P, current=0.0, lost=1.0, awake=0.0, rest_resistance=r, rest_variance=r_var, resistance=r)
    return sample(before, inputs, par, form)


def _at_rest(r: Scalar, r_var: Scalar, par: Parameters, form: Form) -> Gaussian:
    """Estimate for a device at rest, (25)-(26)."""
    unit = form.unit(par)
    l, l_var = par.prior_inductance / unit, square(par.prior_inductance_std / unit)
    return Gaussian(vector([r, l, l]), matrix([[r_var, 0.0, 0.0], [0.0, l_var, l_var], [0.0, l_var, l_var]]))


def sample(state: State, inputs: Inputs, par: Parameters, form: Form) -> tuple[State, Outputs]:
    """`step` for a form of the filter."""
    limit = readings.most_current(par.range_current, par.range_voltage, par.prior_resistance)
    has_current = readings.can_be_read(inputs.current, limit)
    is_lost = not_(readings.can_be_read(inputs.voltage, par.range_voltage) & has_current)
    i = where(has_current, inputs.current, state.current)
    after, outputs = cond(
        is_lost | (state.lost > 0.0),
        lambda: _held(state, i, par, form),
        lambda: _filter(state, Inputs(inputs.voltage, i), par, form),
    )
    is_unlearnt = outputs.resistance_std > CERTAIN * par.prior_resistance
    told = readings.health({readings.LOST: is_lost, readings.UNLEARNT: is_unlearnt})
    return after._replace(current=i, lost=where(is_lost, 1.0, 0.0)), outputs._replace(**told._asdict())


def _held(state: State, i: Scalar, par: Parameters, form: Form) -> tuple[State, Outputs]:
    """Estimates at a sample that cannot be used.  A gap, however long, counts as one sample."""
    band = par.gate_sigmas * par.noise_current
    l = where(_is_awake(state) & (fabs(i) > band), state.x[1] * form.unit(par), par.prior_inductance)
    outputs = _outputs(i, par, state.resistance, l, state.P, form)._replace(innovation_std=par.noise_voltage)
    expected = Gaussian(state.x, state.P)
    return cond(state.lost > 0.0, lambda: state, lambda: _next(state, expected, False, par, form)), outputs


def _filter(state: State, inputs: Inputs, par: Parameters, form: Form) -> tuple[State, Outputs]:
    """Do lines 5 to 16."""
    u, i = inputs
    band = par.gate_sigmas * par.noise_current
    is_outside = fabs(i) > band
    is_high = is_outside & (fabs(state.current) > band)  # line 13

    prior = _prior(state, is_outside, par, form)
    seen = form.seen(prior, inputs, state.current, par)
    updated = cond(is_outside | _is_awake(state) | _takes_noise(u, par), seen.posterior, lambda: prior)

    r = where(is_high, updated.mean[0], state.resistance)  # lines 14 and 15
    l = where(is_high, updated.mean[1] * form.unit(par), par.prior_inductance)
    outputs = _outputs(i, par, r, l, updated.cov, form)._replace(
        quality=where(is_high, 1.0, 0.0), innovation=seen.innovation, innovation_std=deviation(seen.variance)
    )
    return _next(state._replace(resistance=r), updated, is_outside, par, form), outputs


def _see(prior: Gaussian, inputs: Inputs, i_prev: Scalar, par: Parameters) -> Seen:
    """Do lines 8 to 10, in Joseph form: in float32 the printed one spoils r."""
    (u, i), dt = inputs, par.sample_time
    H = vector([i, i / dt, -i_prev / dt])  # (11)
    R = square(par.noise_voltage)  # sigma_v only: (15) is derived, but Algorithm 1 does not use it
    S = H @ (prior.cov @ H) + R
    innovation = u - H @ prior.mean
    return Seen(innovation, S, lambda: condition(prior, vector([innovation]), matrix([H]), vector([R])))


PRINTED = Form(unit=lambda par: 1.0, seen=_see)


def _prior(state: State, is_outside: Scalar, par: Parameters, form: Form) -> Gaussian:
    """Prior of the sample: while the filter sleeps, a noise-only one starts it anew."""
    return cond(
        not_(is_outside | _is_awake(state) | (par.gate_decay <= 0.0)),
        lambda: _at_rest(state.rest_resistance, state.rest_variance, par, form),
        lambda: Gaussian(state.x, state.P),
    )


def _takes_noise(u: Scalar, par: Parameters) -> Scalar:
    """Whether a noise-only sample updates a sleeping filter; not one on which an edge of the voltage fell."""
    is_silent = fabs(u) <= par.gate_sigmas * par.noise_voltage
    return (par.gate_decay <= 0.0) | ((par.gate_update > 0.0) & is_silent)


def _is_awake(state: State) -> Scalar:
    """Whether an operation goes on, or has ended not long ago."""
    return state.awake >= AWAKENING


def _next(state: State, updated: Gaussian, is_outside: Scalar, par: Parameters, form: Form) -> State:
    """Prior of the next sample, lines 11 and 12; and what is known of r while the filter sleeps."""
    dt = par.sample_time
    r_var = square(par.process_resistance_rate * dt)
    F = matrix([[1.0, 0.0, 0.0], [0.0, 2.0, -1.0], [0.0, 1.0, 0.0]])  # (21)
    Q = diagonal([r_var, square(par.process_inductance_acceleration * dt * dt / form.unit(par)), 0.0])
    x, P = F @ updated.mean, predict(updated.cov, F, Q)
    is_awake = _is_awake(state)
    return state._replace(
        x=x,
        P=P,
        awake=_awake(state.awake, is_outside, par),
        rest_resistance=where(is_awake, x[0], state.rest_resistance),
        rest_variance=where(is_awake, P[0, 0], state.rest_variance + r_var),
    )


def _awake(awake: Scalar, is_outside: Scalar, par: Parameters) -> Scalar:
    """Counter of `State`: up by samples outside the noise band, and full when they wake the filter; down by others."""
    full = AWAKENING + par.gate_decay / par.sample_time
    more = where((awake + 1.0 == AWAKENING) | (awake + 1.0 > full), full, awake + 1.0)
    return where(is_outside, more, where(awake > AWAKENING, awake - 1.0, 0.0))


def _outputs(i: Scalar, par: Parameters, r: Scalar, l: Scalar, P: Array, form: Form) -> Outputs:
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
        inductance_std=deviation(P[1, 1]) * form.unit(par),
        innovation=0.0,
        innovation_std=0.0,
        flux=where(has_turns, flux_linkage / N, 0.0),
        reluctance=where(is_usable, N * N / where(is_usable, l, 1.0), 0.0),
        health=1.0,
        health_causes=0.0,
    )


# For hosts that read arrays.


ROWS = ("resistance", "inductance")


class Arrays(NamedTuple):
    """Covariance of the outputs `ROWS` that the filter expects at the next sample."""

    predicted_covariance: Annotated[Array, Covariance(2)]


def arrays(state: State, par: Parameters) -> Arrays:
    """Covariance that the filter carries to the next sample."""
    del par
    return Arrays(state.P[:2, :2])
