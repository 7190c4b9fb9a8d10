"""Extended Kalman filter on the reduced model: position, velocity and flux linkage from voltage, current and contact.

Forward pass of [RTS], Section III-A.  While the mover rests its position is measured without noise, which teaches the
filter the force error; while it moves only the current is.  Outputs are in SI units; the state is normalised.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from gapsense.estimators import readings
from gapsense.estimators.kalman import Gaussian, condition, fix, predict, project
from gapsense.estimators.reduced_model import (
    CURRENT_ERROR,
    FLUX_LINKAGE,
    FORCE_ERROR,
    POSITION,
    POSITION_PREV,
    Held,
    Model,
    Parameters,
    after,
    is_moving,
    limit,
    move,
    normalise_model,
    observation,
    rest,
    stay,
)
from gapsense.estimators.watch import PULL, START, Limits, Seen, Watch, follow, is_far, patient, stationary
from gapsense.kernels.derivative import linearise
from gapsense.kernels.interface import measured, output, part, ports
from gapsense.kernels.layout import Array, Covariance, Scalar, Vector
from gapsense.kernels.linalg import deviation, diagonal, matrix, vector
from gapsense.kernels.trace import clip, cond, fabs, not_, square, where

__all__ = ["Inputs", "Outputs", "Parameters", "State", "initial", "step"]

BEARABLE = 100.0  # largest |lambda| / lambda_sat of an estimate
USUAL = 20e-6  # time in which the process noises have the standard deviations of the parameters: T_s of the paper [s]


class State(NamedTuple):
    """What is carried from sample to sample."""

    x: Annotated[Array, Vector(5)]  # projected posterior estimate
    P: Annotated[Array, Covariance(5)]  # its covariance
    voltage: Scalar  # last voltage that could be read, held until the next sample [V]
    mode: Scalar  # last mode that could be read
    resistance: Scalar  # believed until the next sample [ohm]
    hysteresis: Scalar  # h of `core_losses` [A]
    watch: Watch


@ports()
class Inputs(NamedTuple):
    """Measurements; a lost one is not a number."""

    voltage: Scalar = readings.VOLTAGE
    current: Scalar = readings.CURRENT
    mode: Scalar = measured(
        "1",
        "1: at the lower stop, 2: moving, 3: at the upper stop; anything else, as NaN, counts as lost",
        nominal=2.0,
        start=3.0,
        min=1.0,
        max=3.0,
    )
    resistance: Scalar = readings.RESISTANCE


@ports()
class Estimates(NamedTuple):
    """An estimate in SI units, and its standard deviations."""

    position: Scalar = output("m", "Estimated position", nominal=1e-3)
    velocity: Scalar = output("m/s", "Estimated mean velocity since the last sample", nominal=0.5)
    flux_linkage: Scalar = output("Wb", "Estimated flux linkage", nominal=0.02)
    current_error: Scalar = output("A", "Estimated error of the model's current", nominal=0.1)
    force_error: Scalar = output("N", "Estimated error of the model's force; the normal force at a stop")
    position_std: Scalar = output("m", "Standard deviation in the filter", nominal=1e-4, min=0.0)
    velocity_std: Scalar = output("m/s", "Standard deviation in the filter", nominal=0.1, min=0.0)
    flux_linkage_std: Scalar = output("Wb", "Standard deviation in the filter", nominal=1e-3, min=0.0)
    current_error_std: Scalar = output("A", "Standard deviation in the filter", nominal=0.1, min=0.0)
    force_error_std: Scalar = output("N", "Standard deviation in the filter", min=0.0)


@ports(feedthrough=("current", "mode"))
class Outputs(NamedTuple):
    """Estimates at the sample."""

    estimates: Estimates
    innovation: Scalar = output("A", "Measured minus predicted current", nominal=1e-2)
    innovation_std: Scalar = output("A", "Standard deviation expected of it", nominal=1e-2, min=0.0)
    health: readings.Health = part(feedthrough=Inputs._fields[:3])


class Measured(NamedTuple):
    """What corrects the prediction."""

    current: Scalar
    mode: Scalar
    has_current: Scalar = True
    most: Scalar = 0.0  # innovation that counts as wild, in deviations; 0: none does


class Tuning(NamedTuple):
    """The parameters that are not of the model, under their names."""

    process_flux_linkage: Scalar
    process_current_error: Scalar
    process_force_error: Scalar
    noise_current: Scalar
    option_current_error: Scalar
    option_force_error: Scalar


class Pass(NamedTuple):
    """One sample of the forward pass."""

    filtered: Gaussian  # projected
    innovation: Scalar
    innovation_std: Scalar
    is_used: Scalar  # the current is neither lost nor wild
    hysteresis: Scalar  # h of the core [A]


def initial(inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """At rest on the stop that the mode names (61); a mode that says moving, or is lost, counts as the upper stop."""
    m = normalise_model(par)
    now, _, is_whole = _read(inputs, Held(0.0, 3.0), 0.0, par)
    x = rest(now.mode, par.prior_flux_linkage, m)
    variances = vector([0.0, 0.0, square(par.prior_flux_linkage_std), 0.0, 0.0])
    P = diagonal(variances)
    R = readings.believed_resistance(inputs.resistance, par.coil_resistance)
    state = State(x=x, P=P, voltage=now.voltage, mode=now.mode, resistance=R, hysteresis=0.0, watch=START)
    health = readings.health({readings.LOST: not_(is_whole)})
    return state, Outputs(physical(Gaussian(x, P), m), innovation=0.0, innovation_std=par.noise_current, health=health)


def step(state: State, inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """One sample: prediction, update, projection."""
    m = normalise_model(par)._replace(R=state.resistance)
    before = Held(state.voltage, state.mode, state.hysteresis)
    now, measured, is_whole = _read(inputs, before, state.watch.far, par)
    new = forward(Gaussian(state.x, state.P), before, measured, m, tuning(par))
    x, P = new.filtered
    limits = Limits(par.health_samples, par.health_limit, par.health_current_error)
    watch = follow(state.watch, _signs(new, state, now, m, par), par.range_innovation, limits)
    health = _health(watch, x, not_(new.is_used & is_whole), par)
    outputs = Outputs(physical(new.filtered, m), new.innovation, new.innovation_std, health)
    R = readings.believed_resistance(inputs.resistance, par.coil_resistance)
    return State(
        x=x, P=P, voltage=now.voltage, mode=now.mode, resistance=R, hysteresis=new.hysteresis, watch=watch
    ), outputs


def _read(inputs: Inputs, before: Held, far: Scalar, par: Parameters) -> tuple[Held, Measured, Scalar]:
    """Voltage and mode, with the last good ones for lost ones; the correction; whether all readings are good."""
    has_voltage, has_mode = readings.can_be_read(inputs.voltage, par.range_voltage), readings.is_mode(inputs.mode)
    most = readings.most_current(par.range_current, par.range_voltage, par.coil_resistance)
    has_current = readings.can_be_read(inputs.current, most)
    mode = where(has_mode, inputs.mode, before.mode)
    measured = Measured(where(has_current, inputs.current, 0.0), mode, has_current, patient(par.range_innovation, far))
    now = Held(where(has_voltage, inputs.voltage, before.voltage), mode)
    return now, measured, has_voltage & has_current & has_mode


def _signs(new: Pass, state: State, now: Held, m: Model, par: Parameters) -> Seen:
    """Find signs of bad health in a sample: the current error at rest, a position held at a stop during a motion.

    Two signs tell that the device differs from its parameters. The contact is far from the estimated position, or a
    stop seems to pull at a mover that a spring presses on it or off it. Without a spring nothing is known of the force
    on the stop.
    """
    x, moves, moved = new.filtered.mean, is_moving(now.mode), is_moving(state.mode)
    stop = limit(now.mode)
    pull = where(stop > 0.5, 1.0, -1.0) * x[FORCE_ERROR]
    spring = fabs(m.k_sp * (m.z_sp - stop))
    holds = not_(moves | moved) & (spring > 0.0) & (pull > PULL * spring)
    return Seen(
        innovation=new.innovation,
        innovation_std=new.innovation_std,
        is_used=new.is_used,
        current_error=x[CURRENT_ERROR],
        current_error_std=stationary(par.process_current_error, par.process_current_error_memory, USUAL),
        is_resting=not_(moves),
        is_pressed=moves & ((x[POSITION] <= 0.0) | (x[POSITION] >= 1.0)),
        leaves=where(moves & not_(moved), state.mode, 0.0),
        lands=where(moved & not_(moves), now.mode, 0.0),
        short=fabs(state.x[POSITION] - stop),
        is_other=holds,
    )


def _health(watch: Watch, x: Array, is_lost: Scalar, par: Parameters) -> readings.Health:
    return readings.health(
        {
            readings.INNOVATION: watch.innovation > 0.0,
            readings.CURRENT_ERROR: watch.current_error > 0.0,
            readings.SATURATION: fabs(x[FLUX_LINKAGE]) >= par.core_saturation,
            readings.BOUND: watch.bound > 0.0,
            readings.LOST: is_lost,
            readings.OTHER: watch.other > 0.0,
        }
    )


def tuning(par: Parameters) -> Tuning:
    """The tuning of a component."""
    return Tuning(**{name: getattr(par, name) for name in Tuning._fields})


def forward(before: Gaussian, held: Held, measured: Measured, m: Model, tuned: Tuning) -> Pass:
    """Prediction (32)-(33), update (34)-(36) with H at the prior, projection (39)-(42).

    A mover that rested is known to be on its stop: the zeros of its covariance need no operations.
    """
    Q = process_noise(m, tuned)

    def at_end(x: Array) -> Held:
        return after(held, before.mean[FLUX_LINKAGE], x[FLUX_LINKAGE], m)

    def moved() -> Pass:
        x, F = linearise(move, before.mean, held, m)
        return _update(Gaussian(x, predict(before.cov, F, Q)), at_end(x), measured, m, tuned)

    def stayed() -> Pass:
        known = _fix_on_stop(before, limit(held.mode))
        x, F = linearise(stay, known.mean, held, m)
        return _update(Gaussian(x, predict(known.cov, F, Q)), at_end(x), measured, m, tuned)

    return cond(is_moving(held.mode), moved, stayed)


def _fix_on_stop(estimate: Gaussian, position: Scalar) -> Gaussian:
    """Fix the estimate at rest on a stop: the position is certain, and the position before it does not matter."""
    x, P = estimate.mean.copy(), estimate.cov.copy()
    x[POSITION] = position
    for k in (POSITION, POSITION_PREV):
        P[k, :] = P[:, k] = 0.0
    return Gaussian(x, P)


def _update(prior: Gaussian, held: Held, measured: Measured, m: Model, tuned: Tuning) -> Pass:
    """Correct by the current, and on a stop by its position (27)-(29); a lost or wild current corrects nothing."""
    h, H = linearise(observation, prior.mean, m, held)
    R = square(tuned.noise_current)
    S = H[0] @ (prior.cov @ H[0]) + R
    innovation, std = where(measured.has_current, measured.current - h[0], 0.0), deviation(S)
    is_used = measured.has_current & not_(is_far(innovation, std, measured.most))

    def given(known: Gaussian, innovation: Scalar) -> Gaussian:
        return cond(is_used, lambda: condition(known, vector([innovation]), H, vector([R])), lambda: known)

    def resting() -> Gaussian:
        known = fix(prior, POSITION, limit(measured.mode))
        return given(known, innovation - H[0] @ (known.mean - prior.mean))

    posterior = cond(is_moving(measured.mode), lambda: given(prior, innovation), resting)
    return Pass(
        filtered=reachable(project(posterior, POSITION, 0.0, 1.0), m),
        innovation=innovation,
        innovation_std=std,
        is_used=is_used,
        hysteresis=held.hysteresis,
    )


def reachable(estimate: Gaussian, m: Model) -> Gaussian:
    """The estimate, its flux linkage limited so that nothing overflows; the prediction then limits it further.

    Where the position is nearly certain, a projection may move the others anywhere.
    """
    x, most = estimate.mean, BEARABLE * m.lam_sat

    def limited() -> Array:
        y = x.copy()
        y[FLUX_LINKAGE] = clip(x[FLUX_LINKAGE], -most, most)
        return y

    return Gaussian(cond(fabs(x[FLUX_LINKAGE]) <= most, lambda: x, limited), estimate.cov)


def process_noise(m: Model, tuned: Tuning) -> Array:
    """Q over a sampling period: none on the positions; without e_i or e_F that state stays zero (64), (65)."""
    current_error = where(tuned.option_current_error > 0.0, square(tuned.process_current_error), 0.0)
    force_error = where(tuned.option_force_error > 0.0, square(tuned.process_force_error * m.l_z), 0.0)
    periods = m.T_s / USUAL
    variances = [square(tuned.process_flux_linkage), current_error, force_error]
    return diagonal([0.0, 0.0, *(periods * variance for variance in variances)])


def physical(estimate: Gaussian, m: Model) -> Estimates:
    """The estimate in SI units; velocity by (23)."""
    x, P = estimate
    v_var = P[POSITION, POSITION] - 2.0 * P[POSITION, POSITION_PREV] + P[POSITION_PREV, POSITION_PREV]
    speed = m.l_z / m.T_s
    return Estimates(
        position=m.z_min + m.l_z * x[POSITION],
        velocity=(x[POSITION] - x[POSITION_PREV]) * speed,
        flux_linkage=x[FLUX_LINKAGE],
        current_error=x[CURRENT_ERROR],
        force_error=x[FORCE_ERROR] / m.l_z,
        position_std=m.l_z * deviation(P[POSITION, POSITION]),
        velocity_std=speed * deviation(v_var),
        flux_linkage_std=deviation(P[FLUX_LINKAGE, FLUX_LINKAGE]),
        current_error_std=deviation(P[CURRENT_ERROR, CURRENT_ERROR]),
        force_error_std=deviation(P[FORCE_ERROR, FORCE_ERROR]) / m.l_z,
    )


# For hosts that read arrays.


ROWS = ("position", "velocity", "flux_linkage", "current_error", "force_error")


class Arrays(NamedTuple):
    """Covariance of the outputs `ROWS`, in SI units."""

    covariance: Annotated[Array, Covariance(5)]


def arrays(state: State, par: Parameters) -> Arrays:
    """Covariance of the normalised state, scaled on both sides; velocity by (23)."""
    m = normalise_model(par)

    def scaled(P: Array) -> Array:
        speed = (P[POSITION] - P[POSITION_PREV]) * (m.l_z / m.T_s)
        return matrix([m.l_z * P[POSITION], speed, P[FLUX_LINKAGE], P[CURRENT_ERROR], P[FORCE_ERROR] / m.l_z])

    return Arrays(scaled(scaled(state.P).T))
