"""Hybrid extended Kalman filter: current, position, velocity and mode of a pot magnet from its voltage and current.

[HEKF].  The state is x = (i, s, v); the mode q is that of an automaton which the estimate drives, and has no gain.  On
a stop only the current is uncertain; while the armature moves, all three are.  A sampling interval is predicted in
pieces: on a stop up to the release, in the air up to the landing, the state there in sub-steps.  The covariance is
reset where the armature leaves or meets a stop.

Modes: 0 lower stop, 1 lifting, 2 contact, 3 upper stop without voltage, 4 falling.  Transitions as in the plant,
including those that are not in print (1 -> 0, 4 -> 1, 3 -> 2, 4 -> 3).
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from gapsense.estimators import readings
from gapsense.estimators.kalman import Gaussian, condition, normalise, predict, project
from gapsense.estimators.watch import (
    EDGE,
    WILD,
    Limits,
    Now,
    Usual,
    compare_with_usual,
    count,
    is_far,
    leaves,
    nothing_known,
    patient,
)
from gapsense.kernels.derivative import linearise
from gapsense.kernels.interface import choice, fixed, measured, output, parameter, ports, same, sample_time
from gapsense.kernels.layout import Array, Choice, Covariance, Scalar, Vector, flat, record
from gapsense.kernels.linalg import deviation, diagonal, matrix, vector
from gapsense.kernels.trace import clip, cond, fabs, floor, loop, not_, sqrt, square, where

MU_0 = 1.257e-6  # as rounded in [HEKF] Table 1 [H/m]
LOWER, LIFTING, CONTACT, UPPER, FALLING = 0.0, 1.0, 2.0, 3.0, 4.0
CURRENT, POSITION = range(2)
PIECES, SUB_STEPS = 200, 64  # of a sampling interval, and of a piece of it in the air, at most
H = (1.0, 0.0, 0.0)  # (3)
ALIKE = 4.0  # variance in that of noise up to which operations count as alike but for noise: with 8 short ones are told
EVIDENT = 32.0  # as in `ukf`; with 16 those are told that are shorter than all before


class Orientation(Choice):
    """Where the gap is: under the upper stop, or above the lower one as in the paper."""

    consistent, printed = range(2)


class Tuned(Choice):
    """Noise for wrong parameters, the noise of the paper, or no correction at all: the open loop."""

    robust, paper, none = range(3)


@ports()
class Parameters(NamedTuple):
    """The magnet as the filter believes it to be, and the tuning."""

    sample_time: Scalar = sample_time(100e-6)  # T_s
    orientation: Annotated[Scalar, Orientation] = choice(
        "Gap under the upper stop, or above the lower one as in the paper"
    )
    tuning: Annotated[Scalar, Tuned] = choice("Noise of the parameters, that of the paper, or no correction")
    coil_turns: Scalar = fixed("1", "Number of windings N", 964.0, min=1e-9)
    coil_resistance: Scalar = parameter("Ohm", "Resistance in modes 0 to 2, K6 = R_i + R_m", 114.3, min=1e-9)
    coil_resistance_upper: Scalar = parameter("Ohm", "Resistance in modes 3 and 4, K7 = R_d + R_m", 120.0, min=1e-9)
    core_permeability: Scalar = parameter("1", "Relative permeability mu_r", 200.0, min=1e-9)
    core_length: Scalar = parameter("m", "Average length of the field lines l_1", 22e-3, min=1e-9)
    pole_area: Scalar = parameter("m2", "Area of the flux A", 7.6341e-5, min=1e-12)
    mover_mass: Scalar = parameter("kg", "Mass of the armature m", 0.34, min=1e-9)
    gravity: Scalar = parameter("m/s2", "Gravity g", 9.81, min=1e-9)
    stop_upper: Scalar = fixed("m", "Position of the upper stop s_max; [HEKF] prints 0.5 mm", 0.2e-3, min=1e-9)
    current_on: Scalar = parameter("A", "Least current for a lift i_on", 0.1, min=1e-9)
    current_off: Scalar = parameter("A", "Current below which it drops i_off", 0.02, min=1e-9)
    sub_steps: Scalar = fixed("1", "Steps of a sampling interval in the air", 2.0, min=1.0, max=64.0, name="sub_steps")
    landing_band: Scalar = parameter("1", "Share of s_max within which an approach counts as a landing", 0.03, min=0.0)
    noise_current: Scalar = parameter("A", "Standard deviation of the current noise", 1e-3, min=1e-12)  # sigma_i
    noise_sensor: Scalar = parameter(
        "A", "That of the sensor alone, where `noise.current` has an error of the model, too; 0: the same", 0.0, min=0.0
    )
    noise_voltage: Scalar = parameter(
        "V", "Standard deviation of the voltage noise, beyond which health looks for edges", 30e-3, min=0.0
    )
    process_current: Scalar = parameter(
        "A", "Standard deviation of its process noise per sample, on a stop", 3e-4, min=0.0
    )
    process_current_moving: Scalar = parameter("A", "Standard deviation of the same in the air", 1e-3, min=0.0)
    process_position: Scalar = parameter("m", "Standard deviation of its process noise per sample", 1e-7, min=0.0)
    process_velocity: Scalar = parameter("m/s", "Standard deviation of its process noise per sample", 3e-4, min=0.0)
    release_position_std: Scalar = parameter("m", "Standard deviation after leaving a stop", 1e-6, min=0.0)
    release_velocity_std: Scalar = parameter("m/s", "Standard deviation after leaving a stop", 1e-3, min=0.0)
    prior_current: Scalar = parameter("A", "Current at the start", 0.0)  # i_0
    prior_current_std: Scalar = parameter("A", "Its standard deviation", 1e-3, min=0.0)
    prior_position: Scalar = fixed("m", "Stop at the start: the upper one from half of s_max on", 0.0, min=0.0)
    range_voltage: Scalar = readings.RANGE_VOLTAGE
    range_current: Scalar = readings.RANGE_CURRENT
    range_innovation: Scalar = readings.RANGE_INNOVATION
    health_samples: Scalar = parameter("1", "Samples over which the innovations are averaged", 50.0, min=1.0)
    health_limit: Scalar = parameter("1", "Largest mean of the squared normalised innovation", 25.0, min=0.0)


class Alone(NamedTuple):
    """The model without the filter, which no current corrects: what `health` is judged by."""

    x_alone: Annotated[Array, Vector(3)]  # (i, s, v)
    mode_alone: Scalar  # q


class State(NamedTuple):
    """What is carried from sample to sample."""

    x: Annotated[Array, Vector(3)]  # (i, s, v)
    P: Annotated[Array, Covariance(3)]
    mode: Scalar  # q
    voltage: Scalar  # last voltage that could be read, held until the next sample [V]
    far: Scalar  # samples in a row with a wild innovation
    alone: Alone
    usual: Usual


@ports()
class Inputs(NamedTuple):
    """Measurements; a lost one is not a number."""

    voltage: Scalar = measured("V", "Measured coil voltage; NaN where it was lost", nominal=24.0)
    current: Scalar = measured("A", "Measured coil current; NaN where it was lost", nominal=0.2)


HEALTH = same(readings.Health, feedthrough=Inputs._fields)


@ports(feedthrough=("current",))
class Outputs(NamedTuple):
    """Estimates at the sample."""

    current_estimated: Scalar = output("A", "Estimated current", nominal=0.2)
    position: Scalar = output("m", "Estimated lift: 0 at the lower stop", nominal=0.2e-3)
    velocity: Scalar = output("m/s", "Estimated rate of the position", nominal=0.1)
    mode: Scalar = output(
        "1", "0: at the lower stop, 1: lifting, 2: contact, 3: at the upper stop, 4: falling", min=0.0, max=4.0
    )
    current_std: Scalar = output("A", "Standard deviation in the filter", nominal=1e-3, min=0.0)
    position_std: Scalar = output("m", "Standard deviation in the filter", nominal=1e-5, min=0.0)
    velocity_std: Scalar = output("m/s", "Standard deviation in the filter", nominal=1e-2, min=0.0)
    innovation: Scalar = output("A", "Measured minus predicted current", nominal=1e-3)
    innovation_std: Scalar = output("A", "Standard deviation expected of it", nominal=1e-3, min=0.0, feedthrough=())
    health: Scalar = HEALTH
    health_causes: Scalar = HEALTH


class Model(NamedTuple):
    """Constants of [HEKF] Section 4; K2 + K3 gap is written path + slope s, for either orientation."""

    path: Scalar
    slope: Scalar
    K5: Scalar
    K6: Scalar
    K7: Scalar
    lift: Scalar  # K4 / m
    g: Scalar
    s_max: Scalar
    i_on: Scalar
    i_off: Scalar
    T_s: Scalar


class Tuning(NamedTuple):
    """Variances per sample, and how an interval is predicted."""

    R: Scalar  # R_zeta
    rest: Scalar  # of the current, on a stop
    Q: tuple[Scalar, ...]  # R_w in the air
    release: tuple[Scalar, Scalar]  # of position and velocity after leaving a stop
    sub_steps: Scalar  # of a piece in the air
    band: Scalar  # [m]
    is_open_loop: Scalar


PUBLISHED = Tuning(0.01, 1.0, Q=(1.0, 1e-10, 1e-10), release=(0.0, 0.0), sub_steps=1.0, band=0.0, is_open_loop=False)


class Held(NamedTuple):
    """What is constant during a piece of an interval."""

    u: Scalar
    R: Scalar
    s: Scalar  # position at rest
    dt: Scalar


class Hybrid(NamedTuple):
    """Estimate and mode."""

    x: Annotated[Array, Vector(3)]
    P: Annotated[Array, Covariance(3)]
    q: Scalar


def initial(inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """At rest on a stop."""
    is_upper = par.prior_position >= 0.5 * par.stop_upper
    x = vector([par.prior_current, where(is_upper, par.stop_upper, 0.0), 0.0])
    estimate = Hybrid(x, diagonal([square(par.prior_current_std), 0.0, 0.0]), where(is_upper, UPPER, LOWER))
    now, _, is_whole = _read(inputs, 0.0, par)
    alone = Alone(estimate.x, estimate.q)
    x, P, q = estimate
    state = State(x=x, P=P, mode=q, voltage=now.voltage, far=0.0, alone=alone, usual=nothing_known())
    std = deviation(estimate.P[CURRENT, CURRENT] + tuning(par).R)
    return state, _outputs(estimate, 0.0, std, readings.health({readings.LOST: not_(is_whole)}))


def step(state: State, inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """One sample: prediction over the interval with the voltage at its start, correction, landing."""
    mod, tun = model(par), tuning(par)
    prior = ahead(Hybrid(state.x, state.P, state.mode), state.voltage, mod, tun)
    alone = _alone(state.alone, state.voltage, mod, tun)
    now, has_current, is_whole = _read(inputs, state.voltage, par)
    innovation = where(has_current, now.current - prior.x[CURRENT], 0.0)
    std = deviation(prior.P[CURRENT, CURRENT] + tun.R)
    is_used = has_current & not_(is_far(innovation, std, patient(par.range_innovation, state.far)))
    posterior = cond(is_used & not_(tun.is_open_loop), lambda: _correct(prior, innovation, mod, tun), lambda: prior)
    far = count(state.far, is_far(innovation, std, par.range_innovation))
    noise = where(par.noise_sensor > 0.0, par.noise_sensor, par.noise_current)
    seen = Now(
        innovation=normalise(innovation, std),
        error=(now.current - alone.x_alone[CURRENT]) / noise,
        is_used=is_used,
        leaves=leaves(state.alone.x_alone[POSITION], alone.x_alone[POSITION], 0.0, mod.s_max),
        is_edge=readings.is_edge(now.voltage - state.voltage, EDGE, par.noise_voltage),
        voltage=now.voltage,
        voltage_before=state.voltage,
    )
    usual = compare_with_usual(state.usual, seen, Limits(par.health_samples, par.health_limit, 0.0), ALIKE, EVIDENT)
    health = readings.health(
        {
            readings.INNOVATION: (usual.innovation > 0.0) | is_far(innovation, std, WILD),
            readings.LOST: not_(is_used & is_whole),
            readings.OTHER: usual.other > 0.0,
        }
    )
    x, P, q = posterior
    state = State(x=x, P=P, mode=q, voltage=now.voltage, far=far, alone=alone, usual=usual)
    return state, _outputs(posterior, innovation, std, health)


def _alone(before: Alone, u: Scalar, mod: Model, tun: Tuning) -> Alone:
    """The model alone one sampling interval later."""
    after = ahead(Hybrid(before.x_alone, diagonal([0.0] * 3), before.mode_alone), u, mod, tun)
    return Alone(after.x, after.q)


def _read(inputs: Inputs, voltage: Scalar, par: Parameters) -> tuple[Inputs, Scalar, Scalar]:
    """The sample, with the voltage before for a lost one; whether it has a current, and whether nothing is lost."""
    has_voltage = readings.can_be_read(inputs.voltage, par.range_voltage)
    most = readings.most_current(par.range_current, par.range_voltage, par.coil_resistance)
    has_current = readings.can_be_read(inputs.current, most)
    now = Inputs(where(has_voltage, inputs.voltage, voltage), where(has_current, inputs.current, 0.0))
    return now, has_current, has_voltage & has_current


def model(par: Parameters) -> Model:
    """Constants from physical parameters."""
    K3, K5 = 2.0 * par.core_permeability, square(par.coil_turns) * par.core_permeability * MU_0 * par.pole_area
    is_printed = par.orientation == Orientation.printed
    return Model(
        path=where(is_printed, par.core_length, par.core_length + K3 * par.stop_upper),
        slope=where(is_printed, K3, -K3),
        K5=K5,
        K6=par.coil_resistance,
        K7=par.coil_resistance_upper,
        lift=par.core_permeability * K5 / par.mover_mass,
        g=par.gravity,
        s_max=par.stop_upper,
        i_on=par.current_on,
        i_off=par.current_off,
        T_s=par.sample_time,
    )


def tuning(par: Parameters) -> Tuning:
    """The tuning of the parameters, or the published one, (21): P(0) = 0, no band, no sub-steps."""
    own = Tuning(
        R=square(par.noise_current),
        rest=square(par.process_current),
        Q=(square(par.process_current_moving), square(par.process_position), square(par.process_velocity)),
        release=(square(par.release_position_std), square(par.release_velocity_std)),
        sub_steps=where(par.sub_steps > 1.0, floor(par.sub_steps), 1.0),
        band=par.landing_band * par.stop_upper,
        is_open_loop=par.tuning == Tuned.none,
    )
    return cond(par.tuning == Tuned.paper, lambda: PUBLISHED, lambda: own)


def ahead(estimate: Hybrid, u: Scalar, mod: Model, tun: Tuning) -> Hybrid:
    """The estimate one sampling interval later: (4), (5) with F P F', in pieces within which the mode stays."""
    is_above = is_resting(estimate.q) & (estimate.q > LOWER)
    q = cond(is_above, lambda: _contact(estimate.x[CURRENT], u, mod), lambda: estimate.q)

    def piece(left: Scalar, entries: list[Scalar]) -> tuple[tuple[Scalar, list[Scalar]], Scalar]:
        before = record(Hybrid, entries)
        given = (before, u, left, mod, tun)
        dt, after = cond(is_resting(before.q), lambda: _rest(*given), lambda: _move(*given))
        left = left - dt
        return (left, flat(after)), not_(left > 1e-6 * mod.T_s)

    _, end = loop(PIECES, piece, (mod.T_s, flat(estimate._replace(q=q))))
    return record(Hybrid, end)  # type: ignore[no-any-return]


def is_resting(q: Scalar) -> Scalar:
    """Modes 0, 2 and 3."""
    return not_((q == LIFTING) | (q == FALLING))


def _contact(i: Scalar, u: Scalar, mod: Model) -> Scalar:
    """Mode at the upper stop: 2 if the voltage sustains i_off in the direction of the current, else 3."""
    return where(where(i < 0.0, -u, u) >= mod.K7 * mod.i_off, CONTACT, UPPER)


def _rest(before: Hybrid, u: Scalar, left: Scalar, mod: Model, tun: Tuning) -> tuple[Scalar, Hybrid]:
    """The rest of the interval on a stop, or its part up to the release; only the current is uncertain."""
    x, P, q = before
    s, R = x[POSITION], where(q > 2.5, mod.K7, mod.K6)
    start = vector([x[CURRENT]])
    end, F = linearise(resting, start, Held(u, R, s, left), mod)
    P_end = predict(matrix([[P[CURRENT, CURRENT]]]), F, matrix([[tun.rest * (left / mod.T_s)]]))[0, 0]
    share, is_released = _release(q, fabs(start[0]), fabs(end[0]), s, mod)

    def released() -> tuple[Scalar, Hybrid]:  # linear up to the release: the interval is short beside L / R
        i, P_ii = (a + share * (b - a) for a, b in ((start[0], end[0]), (P[CURRENT, CURRENT], P_end)))
        air = where(q < 0.5, LIFTING, FALLING)
        return share * left, Hybrid(vector([i, s, 0.0]), diagonal([P_ii, *tun.release]), air)

    held = Hybrid(vector([end[0], s, 0.0]), diagonal([P_end, 0.0, 0.0]), q)
    return cond(is_released, released, lambda: (left, held))


def _release(q: Scalar, start: Scalar, end: Scalar, s: Scalar, mod: Model) -> tuple[Scalar, Scalar]:
    """Share of the time up to the release, and whether there is one; `start` and `end` are the currents.

    At a given position the net force changes its sign at one current: a lift needs that and i_on, a drop less than
    that and less than i_off.
    """
    balance = sqrt(mod.g / mod.lift) * (mod.path + mod.slope * s)
    up, down = where(balance > mod.i_on, balance, mod.i_on), where(balance < mod.i_off, balance, mod.i_off)
    is_lower = q < 0.5
    missing = where(is_lower, up - start, start - down)
    change = where(is_lower, end - start, start - end)
    is_released = (is_lower | (q > 2.5)) & (change > missing)
    share = missing / where(change > missing, where(change > 0.0, change, 1.0), 1.0)
    return clip(share, 0.0, 1.0), is_released


def _move(before: Hybrid, u: Scalar, left: Scalar, mod: Model, tun: Tuning) -> tuple[Scalar, Hybrid]:
    """The rest of the interval in the air, or its part up to the landing: x in sub-steps, P in one.

    F is for all that is left: of P a landing keeps the variance of the current alone.
    """
    (i, s, v), P, q = before
    held = Held(u, where(q > 2.5, mod.K7, mod.K6), 0.0, left / tun.sub_steps)

    def sub_step(k: Scalar, y: Array) -> tuple[tuple[Scalar, Array], Scalar]:
        y = moving(y, held, mod)
        is_up, is_down = _meets(y[1], y[2], q, mod, tun)
        return (k + 1.0, y), (k + 1.0 >= tun.sub_steps) | is_up | is_down

    steps, (psi, s, v) = loop(SUB_STEPS, sub_step, (0.0, vector([i / (mod.path + mod.slope * s), s, v])))
    dt = steps * held.dt
    _, F = linearise(extrapolate, before.x, held._replace(dt=left), mod)
    P = predict(P, F, diagonal([variance * (dt / mod.T_s) for variance in tun.Q]))
    s = clip(s, 0.0, mod.s_max)
    i = psi * (mod.path + mod.slope * s)
    is_pulled = (q > 2.5) & (fabs(i) >= mod.i_on) & (mod.lift * square(psi) > mod.g)
    return dt, _land(Hybrid(vector([i, s, v]), P, where(is_pulled, LIFTING, q)), mod, tun)


def _meets(s: Scalar, v: Scalar, q: Scalar, mod: Model, tun: Tuning) -> tuple[Scalar, Scalar]:
    """Whether the armature meets the upper and the lower stop: within the band, exactly at the one it has left."""
    is_falling = q > 2.5
    highest, lowest = mod.s_max - where(is_falling, 0.0, tun.band), where(is_falling, tun.band, 0.0)
    return (v > 0.0) & (s >= highest), (v < 0.0) & (s <= lowest)


def _land(estimate: Hybrid, mod: Model, tun: Tuning) -> Hybrid:
    """Put the armature on the stop that it meets, with its flux linkage: the landing is late, or early."""
    (i, s, v), P, q = estimate
    is_up, is_down = _meets(s, v, q, mod, tun)

    def landed() -> Hybrid:
        stop, mode = where(is_up, mod.s_max, 0.0), where(is_up, where(q > 2.5, UPPER, CONTACT), LOWER)
        i_stop = i / (mod.path + mod.slope * s) * (mod.path + mod.slope * stop)
        return Hybrid(vector([i_stop, stop, 0.0]), diagonal([P[CURRENT, CURRENT], 0.0, 0.0]), mode)

    return cond(is_up | is_down, landed, lambda: estimate)


def resting(x: Array, held: Held, mod: Model) -> Array:
    """Current after `dt` on a stop, (16), (18), (19): 1 - a / (1 + a/2 + a^2/12) is exp(-a), to order 4 and stable."""
    i, rate = x[0], held.dt * (mod.path + mod.slope * held.s) / mod.K5  # dt / L
    a = held.R * rate
    return vector([i + rate * (held.u - held.R * i) / (1.0 + a * (0.5 + a / 12.0))])


def moving(y: Array, held: Held, mod: Model) -> Array:
    """(psi, s, v) after `dt` in the air, by the midpoint rule."""
    return y + held.dt * rates(y + 0.5 * held.dt * rates(y, held, mod), held, mod)


def extrapolate(x: Array, held: Held, mod: Model) -> Array:
    """Advance (i, s, v) by `dt` in the air by (4), an Euler step in flux linkage; for the Jacobian of (5)."""
    i, s, v = x
    y = vector([i / (mod.path + mod.slope * s), s, v])
    psi, s, v = y + held.dt * rates(y, held, mod)
    return vector([psi * (mod.path + mod.slope * s), s, v])


def rates(y: Array, held: Held, mod: Model) -> Array:
    """d/dt (psi, s, v) in the air, (17), (20), in flux linkage, which has no motional term.

    psi = i / (K2 + K3 gap) is the flux linkage over K5, by (10); the force (13), (14) depends on it alone.
    """
    psi, s, v = y
    i = psi * (mod.path + mod.slope * s)
    return vector([(held.u - held.R * i) / mod.K5, v, mod.lift * square(psi) - mod.g])


def _correct(prior: Hybrid, innovation: Scalar, mod: Model, tun: Tuning) -> Hybrid:
    """Correct by (6) to (8) in Joseph form; in the air the position is then projected between the stops."""
    x, P, q = prior

    def on_a_stop() -> Hybrid:
        known = Gaussian(x[:1], matrix([[P[CURRENT, CURRENT]]]))
        (i,), P_i = condition(known, vector([innovation]), matrix([[1.0]]), vector([tun.R]))
        return Hybrid(vector([i, x[POSITION], 0.0]), diagonal([P_i[0, 0], 0.0, 0.0]), q)

    def in_the_air() -> Hybrid:
        posterior = condition(Gaussian(x, P), vector([innovation]), matrix([H]), vector([tun.R]))
        return _land(Hybrid(*project(posterior, POSITION, 0.0, mod.s_max), q), mod, tun)

    return cond(is_resting(q), on_a_stop, in_the_air)


def _outputs(estimate: Hybrid, innovation: Scalar, innovation_std: Scalar, health: readings.Health) -> Outputs:
    i, s, v = estimate.x
    i_std, s_std, v_std = map(deviation, estimate.P.diagonal())
    return Outputs(
        current_estimated=i,
        position=s,
        velocity=v,
        mode=estimate.q,
        current_std=i_std,
        position_std=s_std,
        velocity_std=v_std,
        innovation=innovation,
        innovation_std=innovation_std,
        **health._asdict(),
    )


# For hosts that read arrays.


ROWS = ("current_estimated", "position", "velocity")


class Arrays(NamedTuple):
    """Covariance of the outputs `ROWS`."""

    covariance: Annotated[Array, Covariance(3)]


def arrays(state: State, par: Parameters) -> Arrays:
    """Covariance of the state."""
    del par
    return Arrays(state.P)
