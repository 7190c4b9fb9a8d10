"""Bounded unscented Kalman filter of [UKF]: position and flux linkage of a solenoid valve from voltage and current.

There is no contact sensor.  The stops are in the model: positions are clipped in the sigma points before the
transition, after it, once more with the process noise added, and in the corrected state.  The unbounded filter, the
extended one and the open loop are there to compare with.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from functools import reduce
from operator import and_
from typing import Annotated, NamedTuple

import numpy as np

from gapsense.estimators import ekf, readings
from gapsense.estimators.kalman import Gaussian, normalise, predict
from gapsense.estimators.valve_model import (
    CURRENT_ERROR,
    FLUX_LINKAGE,
    POSITION,
    POSITION_PREV,
    Filter,
    Held,
    Model,
    Noise,
    Parameters,
    Tuned,
    after,
    bound_positions,
    model,
    model_current,
    observation,
    segment,
    transition,
)
from gapsense.estimators.watch import EDGE, WILD, Limits, Now, Usual, compare_with_usual, is_far, leaves, nothing_known
from gapsense.kernels.derivative import linearise
from gapsense.kernels.interface import output, ports, same
from gapsense.kernels.layout import Array, Covariance, Scalar, Vector
from gapsense.kernels.linalg import deviation, diagonal, ldl, matrix, nonnegative, outer, pivot, total, vector
from gapsense.kernels.trace import clip, cond, fabs, not_, sqrt, square, where

ALIKE = 8.0  # variance in that of noise up to which healthy operations count as alike but for noise
EVIDENT = 16.0  # -log of the probability of means that are not as usual, beyond what is allowed, that tells a fault


class Pair(NamedTuple):
    """Two points centre + even + odd and centre + even - odd."""

    odd: Array
    even: Array


def columns(P: Array, spread: Scalar, order: Sequence[int] | None = None) -> list[Array]:
    """Columns (n,) of a square root of `spread` P, from its factors L D L'; one without information is zero.

    Parameters
    ----------
    P : (n, n) array
        Covariance, which may be singular.
    spread : scalar
        n + kappa, positive.
    order : sequence of int, optional
        Order in which the components are eliminated.  The column with index k leaves the first k of them where they
        are, so that one in which a function is costly should come first: fewer points then differ in it.
    """
    order = order or range(len(P))
    L, D = ldl(matrix([[P[i, j] for j in order] for i in order]))
    made = []
    for column, d in zip(L.T, D):
        made.append(vector([0.0] * len(P)))
        made[-1][list(order)] = column * sqrt(where(d < math.inf, d, 0.0) * spread)
    return made


def pair(centre: Iterable[Scalar], up: Iterable[Scalar], down: Iterable[Scalar]) -> Pair:
    """The pair of points `up` and `down` around `centre`."""
    parts = [_parts(*values) for values in zip(centre, up, down)]
    return Pair(*(vector(values) for values in zip(*parts)))


def _parts(centre: Scalar, up: Scalar, down: Scalar) -> tuple[Scalar, Scalar]:
    if up is centre and down is centre:
        return 0.0, 0.0
    return 0.5 * (up - down), 0.5 * (up + down) - centre


def moments(centre: Array, pairs: Sequence[Pair], spread: Scalar) -> Gaussian:
    """Weighted mean and covariance of the points, exact up to the third power of what made them from a Gaussian.

    With b the sum of weighted offsets: mean centre + b, covariance sum w (odd odd' + even even') - b b'.
    """
    weight = 1.0 / spread
    b = weight * total(even for _, even in pairs)
    n = len(centre)
    cov = matrix([[0.0] * n for _ in range(n)])
    for i in range(n):
        for j in range(i, n):
            products = total(odd[i] * odd[j] + even[i] * even[j] for odd, even in pairs)
            cov[i, j] = cov[j, i] = weight * products - b[i] * b[j]
    return Gaussian(centre + b, cov)


def condition_on_last(joint: Gaussian, innovation: Scalar, R: Scalar) -> Gaussian:
    """Estimate of all but the last component, given that this was measured with noise of variance `R`.

    K = P_xy / (P_yy + R), mean x + K innovation, covariance P - K (P_yy + R) K'.  [UKF] Algorithm 3, with minus.
    """
    x, P, c = joint.mean[:-1], joint.cov[:-1, :-1], joint.cov[:-1, -1]
    K = c / pivot(joint.cov[-1, -1] + R)
    n = len(x)
    cov = matrix([[P[i, j] - K[min(i, j)] * c[max(i, j)] for j in range(n)] for i in range(n)])
    return Gaussian(x + K * innovation, cov)


__all__ = ["Inputs", "Outputs", "Parameters", "State", "initial", "step"]

ORDER = (POSITION, FLUX_LINKAGE, POSITION_PREV, CURRENT_ERROR)  # the gap table is costly: few points differ in it
UNCLIPPED = [FLUX_LINKAGE, POSITION_PREV, CURRENT_ERROR]
EVERYWHERE = 1e9  # position bound of the unbounded filter [m]
LARGEST_FLUX = 2.0  # of an estimate, in lambda_sat
ROUGH = 1e-6  # part of a variance that may come out negative by rounding; beyond, the covariance is lost
LEAST_SHARE = 1e-8  # part of a variance: if a measurement leaves less, rounding shows in the correlations


class Alone(NamedTuple):
    """The model without the filter, which no current corrects: what `health` is judged by."""

    x_alone: Annotated[Array, Vector(4)]  # (33)
    hysteresis_alone: Scalar  # h of `core_losses` [A]


class State(NamedTuple):
    """What is carried from sample to sample."""

    x: Annotated[Array, Vector(4)]  # corrected estimate (33)
    P: Annotated[Array, Covariance(4)]  # its covariance
    voltage: Scalar  # last voltage that could be read [V]
    resistance: Scalar  # believed until the next sample [ohm]
    hysteresis: Scalar  # h of `core_losses` [A]
    alone: Alone
    usual: Usual


@ports()
class Inputs(NamedTuple):
    """Measurements; a lost one is not a number."""

    voltage: Scalar = readings.VOLTAGE
    current: Scalar = readings.CURRENT
    resistance: Scalar = readings.RESISTANCE


EKF = same(ekf.Outputs)


@ports(feedthrough=("voltage", "current"))
class Outputs(NamedTuple):
    """Estimates at the sample."""

    position: Scalar = EKF
    velocity: Scalar = EKF
    flux_linkage: Scalar = EKF
    current_error: Scalar = output("A", "Estimated: model's current minus the true one", nominal=0.1)
    position_std: Scalar = EKF
    velocity_std: Scalar = EKF
    flux_linkage_std: Scalar = EKF
    current_error_std: Scalar = EKF
    innovation: Scalar = EKF
    innovation_std: Scalar = EKF
    health: Scalar = readings.HEALTH
    health_causes: Scalar = readings.HEALTH


class Tuning(NamedTuple):
    """Process noise, standard deviations per sample, and the memory of the current error."""

    flux_linkage: Scalar  # [Wb]
    position: Scalar  # [m]
    current_error: Scalar  # [A]
    memory: Scalar  # [1]
    limit: Scalar  # largest innovation that counts, in standard deviations [1]


# PAPER is what [UKF] IV-A prescribes: the errors that the discretised model makes along the simulated valve, rms over
# the cycle, and hardly a current error, because the simulated one has none.  If such a filter is a few of its small
# deviations short of the stop when the plunger lands, it reads the rise of the current as a reversal.  ROBUST has the
# process noise that wrong parameters make, and a large innovation counts as 1.2 deviations. So an innovation that
# lasts, as with a wrong model, moves the estimate no faster than the force does, and an outlier does no harm.  It was
# chosen at 24, 30 and 36 V, so that no landing is lost with errors of 8 and 10 % either: with 24 uWb, or a limit of
# 1.5, some are.
ROBUST = Tuning(flux_linkage=16e-6, position=60e-9, current_error=1e-6, memory=0.99, limit=1.2)
PAPER = Tuning(flux_linkage=0.4e-6, position=0.3e-9, current_error=10e-6, memory=0.99, limit=1e9)


def initial(inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """At rest, the position and the flux linkage as the prior says."""
    estimate = Gaussian(_start(par), _at_rest(par.prior_position_std, par.prior_flux_linkage_std, par))
    (voltage, _), is_whole = _read(inputs, 0.0, par)
    R = readings.believed_resistance(inputs.resistance, par.coil_resistance)
    state = State(
        x=estimate.mean,
        P=estimate.cov,
        voltage=voltage,
        resistance=R,
        hysteresis=0.0,
        alone=Alone(estimate.mean, 0.0),
        usual=nothing_known(),
    )
    return state, _outputs(estimate, 0.0, par.noise_current, readings.health({readings.LOST: not_(is_whole)}), par)


def step(state: State, inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """One sample: prediction, correction, repair of what went wrong."""
    (voltage, has_current), is_whole = _read(inputs, state.voltage, par)
    mean = state.voltage + 0.5 * par.option_voltage * (voltage - state.voltage)
    m = _model(par, state.resistance)
    joint, hysteresis = _predict(Gaussian(state.x, state.P), Held(mean, 0.0, state.hysteresis), m, par)
    innovation = where(has_current, inputs.current - joint.mean[-1], 0.0)
    S = deviation(joint.cov[-1, -1] + square(par.noise_current))
    most = _tuning(par).limit * S
    limited = clip(innovation, -most, most)
    estimate, is_sound = _sound(
        _correct(joint, limited, has_current & (par.option_filter != Filter.open_loop), par), joint, m, par
    )
    S, innovation = where(is_sound, S, par.noise_current), where(is_sound, innovation, 0.0)
    alone, expected = _alone(state.alone, mean, m, par)
    now = Now(
        innovation=normalise(innovation, S),
        error=(where(has_current, inputs.current, expected) - expected) / par.noise_current,
        is_used=has_current & is_sound,
        leaves=leaves(state.alone.x_alone[POSITION], alone.x_alone[POSITION], par.stop_lower, par.stop_upper),
        is_edge=readings.is_edge(voltage - state.voltage, EDGE, par.noise_voltage),
        voltage=voltage,
        voltage_before=state.voltage,
    )
    usual = compare_with_usual(state.usual, now, Limits(par.health_samples, par.health_limit, 0.0), ALIKE, EVIDENT)
    health = readings.health(
        {
            readings.INNOVATION: (usual.innovation > 0.0) | is_far(innovation, S, WILD),
            readings.SATURATION: fabs(estimate.mean[FLUX_LINKAGE]) >= par.core_saturation,
            readings.LOST: not_(is_whole),
            readings.RESTARTED: not_(is_sound),
            readings.OTHER: usual.other > 0.0,
        }
    )
    hysteresis = where(is_sound, hysteresis, 0.0)
    R = readings.believed_resistance(inputs.resistance, par.coil_resistance)
    state = State(
        x=estimate.mean, P=estimate.cov, voltage=voltage, resistance=R, hysteresis=hysteresis, alone=alone, usual=usual
    )
    return state, _outputs(estimate, innovation, S, health, par)


def _alone(before: Alone, voltage: Scalar, m: Model, par: Parameters) -> tuple[Alone, Scalar]:
    """The model alone a sample later, between the stops with any filter, and its current [A]."""
    m = m._replace(low=par.stop_lower, high=par.stop_upper)
    old, largest = before.x_alone, LARGEST_FLUX * par.core_saturation
    held = Held(voltage, 0.0, before.hysteresis_alone)
    x = transition(old, held, segment(old[POSITION], par), m)
    held = after(held, old[FLUX_LINKAGE], x[FLUX_LINKAGE], m)
    x[FLUX_LINKAGE] = clip(x[FLUX_LINKAGE], -largest, largest)
    x = vector([where(_is_finite(value), value, start) for value, start in zip(x, _start(par))])
    return Alone(x, held.hysteresis), observation(x, held, segment(x[POSITION], par), m)[0]


def _read(inputs: Inputs, voltage: Scalar, par: Parameters) -> tuple[tuple[Scalar, Scalar], Scalar]:
    """Voltage, the previous one if it is lost; whether there is a current; whether nothing is lost."""
    has_voltage = readings.can_be_read(inputs.voltage, par.range_voltage)
    most = readings.most_current(par.range_current, par.range_voltage, par.coil_resistance)
    has_current = readings.can_be_read(inputs.current, most)
    return (where(has_voltage, inputs.voltage, voltage), has_current), has_voltage & has_current


def _model(par: Parameters, resistance: Scalar) -> Model:
    is_unbounded = par.option_filter == Filter.unbounded_ukf
    low, high = where(is_unbounded, -EVERYWHERE, par.stop_lower), where(is_unbounded, EVERYWHERE, par.stop_upper)
    return model(par, resistance, _tuning(par).memory, low, high)


def _predict(before: Gaussian, held: Held, m: Model, par: Parameters) -> tuple[Gaussian, Scalar]:
    """Predict state and current, before the current is measured: mean (5,) and covariance (5, 5); and hysteresis."""
    noise = _process_noise(par)
    return cond(
        (par.option_filter == Filter.bounded_ekf) | (par.option_filter == Filter.open_loop),
        lambda: _linearise(before, held, m, noise, par),
        lambda: cond(
            par.option_noise == Noise.augmented,
            lambda: _augment(before, held, m, noise, par),
            lambda: _additive(before, held, m, noise, par),
        ),
    )


def _correct(joint: Gaussian, innovation: Scalar, is_measured: Scalar, par: Parameters) -> Gaussian:
    """Correct the state by the current; without one it stays as predicted."""
    return cond(
        is_measured,
        lambda: condition_on_last(joint, innovation, square(par.noise_current)),
        lambda: Gaussian(joint.mean[:-1], joint.cov[:-1, :-1]),
    )


def _additive(before: Gaussian, held: Held, m: Model, noise: Array, par: Parameters) -> tuple[Gaussian, Scalar]:
    """Algorithm 2, then the process noise added, and Algorithm 3 on points drawn again."""

    def moved(x: Array) -> Array:
        x = bound_positions(x, m)
        return transition(x, held, segment(x[POSITION], par), m)

    x, pairs = moved(before.mean), []
    then = after(held, before.mean[FLUX_LINKAGE], x[FLUX_LINKAGE], m)
    for k, c in enumerate(columns(before.cov, par.sigma_spread, ORDER)):
        up = moved(before.mean + c)
        odd, even = pair(x, up, moved(before.mean - c))
        odd[CURRENT_ERROR], even[CURRENT_ERROR] = m.memory * c[CURRENT_ERROR], 0.0  # it is linear
        if ORDER[k] == CURRENT_ERROR:  # and so is the flux linkage, where nothing else differs
            odd[FLUX_LINKAGE], even[FLUX_LINKAGE] = up[FLUX_LINKAGE] - x[FLUX_LINKAGE], 0.0
        pairs.append(Pair(odd, even))
    x, P = moments(x, pairs, par.sigma_spread)
    return _observe(Gaussian(x, P + diagonal(noise)), then, m, par), then.hysteresis


def _observe(prior: Gaussian, held: Held, m: Model, par: Parameters) -> Gaussian:
    """State and current together, from points with the position clipped once more: w_z stays in the bounds."""

    def seen(x: Array) -> Array:
        z = clip(x[POSITION], m.low, m.high)
        return vector([z, model_current(z, x[FLUX_LINKAGE], held, segment(z, par), m)])

    centre, pairs = seen(prior.mean), []
    for c in columns(prior.cov, par.sigma_spread, ORDER):
        (odd_z, odd_i), (even_z, even_i) = pair(centre, seen(prior.mean + c), seen(prior.mean - c))
        odd, even = vector([*c, odd_i - c[CURRENT_ERROR]]), vector([0.0, 0.0, 0.0, 0.0, even_i])
        odd[POSITION], even[POSITION] = odd_z, even_z
        pairs.append(Pair(odd, even))
    x = vector([*prior.mean, centre[1] - prior.mean[CURRENT_ERROR]])
    x[POSITION] = centre[0]
    joint = moments(x, pairs, par.sigma_spread)
    unclipped = np.ix_(UNCLIPPED, UNCLIPPED)
    joint.cov[unclipped] = prior.cov[unclipped]  # as it came out again
    return joint


def _augment(before: Gaussian, held: Held, m: Model, noise: Array, par: Parameters) -> tuple[Gaussian, Scalar]:
    """Do algorithms 2 and 3 on one set of points in the space of the state and w_phi, w_z, w_i."""
    x = bound_positions(before.mean, m)
    lam_next = transition(x, held, segment(x[POSITION], par), m)[FLUX_LINKAGE]
    then = after(held, x[FLUX_LINKAGE], lam_next, m)
    n = len(before.mean)
    cov = diagonal([0.0] * n + [noise[k] for k in range(n) if k != POSITION_PREV])
    cov[:n, :n] = before.cov

    def moved(x: Array) -> Array:
        state, (w_phi, w_z, w_i) = bound_positions(x[:n], m), x[n:]
        state = transition(state, held._replace(push=w_z), segment(state[POSITION], par), m)
        state = state + vector([w_phi, 0.0, 0.0, w_i])
        return vector([*state, *observation(state, then, segment(state[POSITION], par), m)])

    mean, spread = vector([*before.mean, 0.0, 0.0, 0.0]), par.sigma_spread
    centre = moved(mean)
    drawn = columns(cov, spread, (*ORDER, n, n + 1, n + 2))
    joint = moments(centre, [pair(centre, moved(mean + c), moved(mean - c)) for c in drawn], spread)
    return joint, then.hysteresis


def _linearise(before: Gaussian, held: Held, m: Model, noise: Array, par: Parameters) -> tuple[Gaussian, Scalar]:
    """Linearise as in the extended filter; while the position is clipped, its derivatives are zero."""
    x, F = linearise(transition, before.mean, held, segment(before.mean[POSITION], par), m)
    then = after(held, before.mean[FLUX_LINKAGE], x[FLUX_LINKAGE], m)
    P = predict(before.cov, F, diagonal(noise))
    h, H = linearise(observation, x, then, segment(x[POSITION], par), m)
    c = P @ H[0]
    rows = [[*row, y] for row, y in zip(P, c)]
    return Gaussian(vector([*x, *h]), matrix([*rows, [*c, H[0] @ c]])), then.hysteresis


def _tuning(par: Parameters) -> Tuning:
    own = Tuning(*(getattr(par, f"process_{name}") for name in Tuning._fields))
    given = cond(par.option_tuning == Tuned.own, lambda: own, lambda: PAPER)
    return cond(par.option_tuning == Tuned.robust, lambda: ROBUST, lambda: given)


def _process_noise(par: Parameters) -> Array:
    """Variances of (34); that of w_phi holds the voltage noise too."""
    t = _tuning(par)
    current_error = where(par.option_current_error > 0.5, square(t.current_error), 0.0)
    flux_linkage = square(t.flux_linkage) + square(par.sample_time * par.noise_voltage)
    return vector([flux_linkage, square(t.position), 0.0, current_error])


def _sound(estimate: Gaussian, joint: Gaussian, m: Model, par: Parameters) -> tuple[Gaussian, Scalar]:
    """The estimate inside its bounds; uncertain again in all states if numbers or variances are lost."""
    x, P = estimate
    n = len(x)
    is_sound = _is_finite(total(P[i, j] for i in range(n) for j in range(i, n)) + total(x))
    for k in range(n):
        is_sound = is_sound & (P[k, k] >= -ROUGH * joint.cov[k, k])

    def restarted() -> Gaussian:
        is_finite = _is_finite(total(x))
        start = [where(is_finite, a, b) for a, b in zip(x, _start(par))]
        stroke = par.stop_upper - par.stop_lower
        return Gaussian(vector(start), _at_rest(0.5 * stroke, 0.5 * par.core_saturation, par))

    x, P = cond(is_sound, lambda: Gaussian(x, _positive(P, joint.cov)), restarted)
    largest = LARGEST_FLUX * par.core_saturation
    x = bound_positions(x, m)
    x[FLUX_LINKAGE] = clip(x[FLUX_LINKAGE], -largest, largest)
    return Gaussian(x, P), is_sound


def _positive(P: Array, prior: Array) -> Array:
    """The covariance, rebuilt from its columns if a variance has become so small that rounding may spoil it."""
    is_fine = reduce(and_, (P[k, k] >= LEAST_SHARE * prior[k, k] for k in range(len(P))))
    P = nonnegative(P)
    return cond(is_fine, lambda: P, lambda: total(outer(c, c) for c in columns(P, 1.0, ORDER)))


def _start(par: Parameters) -> Array:
    z = clip(par.prior_position, par.stop_lower, par.stop_upper)
    return vector([par.prior_flux_linkage, z, z, 0.0])


def _at_rest(z_std: Scalar, lam_std: Scalar, par: Parameters) -> Array:
    """Covariance where the position is uncertain and the velocity is zero."""
    has_error = par.option_current_error > 0.5
    P = diagonal([square(lam_std), 0.0, 0.0, where(has_error, square(par.prior_current_error_std), 0.0)])
    P[POSITION : POSITION_PREV + 1, POSITION : POSITION_PREV + 1] = square(z_std)
    return P


def _outputs(
    estimate: Gaussian, innovation: Scalar, innovation_std: Scalar, health: readings.Health, par: Parameters
) -> Outputs:
    x, P = estimate
    v_var = P[POSITION, POSITION] - 2.0 * P[POSITION, POSITION_PREV] + P[POSITION_PREV, POSITION_PREV]
    return Outputs(
        position=x[POSITION],
        velocity=(x[POSITION] - x[POSITION_PREV]) / par.sample_time,
        flux_linkage=x[FLUX_LINKAGE],
        current_error=x[CURRENT_ERROR],
        position_std=deviation(P[POSITION, POSITION]),
        velocity_std=deviation(v_var) / par.sample_time,
        flux_linkage_std=deviation(P[FLUX_LINKAGE, FLUX_LINKAGE]),
        current_error_std=deviation(P[CURRENT_ERROR, CURRENT_ERROR]),
        innovation=innovation,
        innovation_std=innovation_std,
        **health._asdict(),
    )


def _is_finite(value: Scalar) -> Scalar:
    return value - value == 0.0


# For hosts that read arrays.


ROWS = ("position", "velocity", "flux_linkage", "current_error")


class Arrays(NamedTuple):
    """Covariance of the outputs `ROWS`."""

    covariance: Annotated[Array, Covariance(4)]


def arrays(state: State, par: Parameters) -> Arrays:
    """Covariance of the state, with the velocity in place of the previous position."""

    def shown(P: Array) -> Array:
        velocity = (P[POSITION] - P[POSITION_PREV]) / par.sample_time
        return matrix([P[POSITION], velocity, P[FLUX_LINKAGE], P[CURRENT_ERROR]])

    return Arrays(shown(shown(state.P).T))
