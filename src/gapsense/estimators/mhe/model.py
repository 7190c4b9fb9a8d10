"""Hybrid model with core losses that `Mhe` runs on the measured voltage, and its derivatives by what it learns.

State (lambda, h, z, v): flux linkage, magnetomotive force of the hysteresis over N, position, velocity.  Current (1)

    i = (g_e u + f) / (1 + R g_e),    f = R_g(z) lambda + R_c lambda + b S(m) + h (1 + m^2),    m = lambda / lambda_sat,

with reluctances over N^2, the conductance g_e of the eddy currents, S = m^3 / (1 - m^2), and Dahl's hysteresis (2)
dh/dlambda = (I_h - s h) / L, s = sign(dlambda/dt), L = l_h (1 - 0.9 m^2).  The mover (3), m_z dv/dt = k (z_sp - z) -
c v - R_g'(z) lambda^2 / 2, rests on a stop while the force points into it.  It bounces where its stops are told to.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, NamedTuple

from gapsense.estimators import reduced_model
from gapsense.estimators.readings import RANGE_CURRENT, RANGE_VOLTAGE
from gapsense.estimators.reduced_model import SMALLEST_GAP, GapLaw
from gapsense.kernels.elementary import exp, log, spline
from gapsense.kernels.interface import choice, fixed, option, parameter, ports, same
from gapsense.kernels.layout import Array, Choice, Scalar, Table
from gapsense.kernels.linalg import matrix, vector
from gapsense.kernels.trace import clip, cond, fabs, not_, sqrt, square, where

QUIET_VOLTAGE, QUIET_CURRENT = 6.0, 0.05  # deviations of the noise within which a coil at rest stays as it is
SMALL = 1e-6  # |m| below which a knee is none
FULL = 0.97  # |m| from which S goes on linearly
SHORTENED, SHORTEST = 0.9, 0.1  # L near saturation
# R_c, b and lambda_sat of the law above that is nearest to R_c0 / (1 - |lambda| / lambda_sat) of Froehlich, over R_c0,
# R_c0 lambda_sat and lambda_sat: least squares of the relative error from 2 to 90 % of saturation; at most 10 % stay
CORE, KNEE, SATURATION = 1.1185, 2.9351, 1.0428
QUICK = 1.0  # angle of the oscillation on an elastic stop in a sampling period, from which it is as a hard one
LEAST_RETURN = 2e-3  # of the stroke: a mover that would not come back by more stays where it is
LOST = 2.0 / 3.0  # of what damping and speed make of it: nearly the law of Hunt and Crossley, up to half the speed


class StopLaw(Choice):
    """Stops that turn the speed round at once, or that give way."""

    hard, elastic = range(2)


EKF = same(reduced_model.Parameters)


def prior(what: str, start: float) -> Any:
    """How well something is known before the first window."""
    return parameter("1", f"{what}: relative deviation before the first window", start, min=0.0)


@ports()
class Parameters(NamedTuple):
    """The actuator as a user knows it, how well, and the tuning."""

    sample_time: Scalar = EKF
    coil_resistance: Scalar = EKF
    coil_turns: Scalar = EKF
    mover_mass: Scalar = EKF
    spring_stiffness: Scalar = EKF
    spring_rest: Scalar = EKF
    damping: Scalar = EKF
    stop_lower: Scalar = EKF
    stop_upper: Scalar = EKF
    stop_law: Annotated[Scalar, StopLaw] = choice("Stops")
    stop_restitution: Scalar = fixed("1", "Hard: speed after an impact over that before it", 0.0, min=0.0, max=0.95)
    stop_stiffness: Scalar = fixed("N/m", "Elastic: force by depth", 1e6, min=1e-3)
    stop_damping: Scalar = fixed("s/m", "Elastic: share by which it is larger, by speed inwards", 0.5, min=0.0)
    core_reluctance: Scalar = EKF
    core_saturation: Scalar = EKF
    core_bend: Scalar = EKF
    core_exponent: Scalar = fixed(
        "1", "Power n of a sharper knee b m^n, as `commission` finds it; 0: none", 0.0, min=0.0
    )
    core_sharp_reluctance: Scalar = fixed("1/H", "With core.exponent: core.reluctance", 1e6, min=1e-9)
    core_sharp_bend: Scalar = fixed("1/H", "With core.exponent: core.bend, b N^2 / core.saturation", 1e6, min=1e-9)
    gap_law: Annotated[Scalar, GapLaw] = EKF
    gap_reluctance: Scalar = EKF
    gap_slope: Scalar = EKF
    gap_fringing: Scalar = EKF
    gap_window: Scalar = EKF
    gap_file_gap: Annotated[Array, Table()] = EKF
    gap_file_reluctance: Annotated[Array, Table()] = EKF
    gap_file_spline: Annotated[Array, Table()] = EKF
    noise_current: Scalar = EKF
    range_voltage: Scalar = RANGE_VOLTAGE
    range_current: Scalar = RANGE_CURRENT
    core_eddy: Scalar = parameter("S", "Eddy currents, k_eddy / N^2; a guess, see prior.eddy", 0.5e-3, min=1e-9)  # g_e
    core_hysteresis: Scalar = parameter(
        "A", "Largest current of hysteresis; a guess, see prior.hysteresis", 5e-3, min=1e-9
    )  # I_h
    core_turnover: Scalar = parameter("Wb", "Flux linkage in which hysteresis turns over", 1.8e-3, min=1e-9)  # l_h
    gap_factor: Scalar = parameter("1", "Factor of the gap reluctance", 1.0, min=1e-9)
    gap_bend: Scalar = parameter("1", "Bend of the gap law, zero at both stops", 0.0)
    option_further: Scalar = option("Learn damping, core reluctance and bend of the gap law too", False)
    option_command: Scalar = option("A window ends where the input command changes, not after a landing", False)
    option_mean: Scalar = option("The voltage is the mean since the last sample: that of a held or switched one", False)
    option_zero: Scalar = option("The current that is left after `window.tail` without voltage is an offset", False)
    option_ahead: Scalar = option("R, rest and damping that change steadily are expected to go on doing so", False)
    noise_voltage: Scalar = parameter("V", "Standard deviation of the voltage noise", 0.03, min=0.0)  # sigma_v
    model_error: Scalar = parameter("A", "Standard deviation of the model's error of the current", 1e-3, min=0.0)
    edge: Scalar = parameter(
        "V", "A voltage that changes by more is an edge: the current does not count", 1.0, min=1e-9
    )
    window_tail: Scalar = parameter("s", "Time at rest after a landing until the window ends", 2e-3, min=1e-9)
    window_longest: Scalar = parameter("s", "Longest window; at most 2000 samples", 20e-3, min=1e-9)
    window_pace: Scalar = parameter(
        "1", "Pieces of the work on a window in a step; 0: by the sample time", 0.0, min=0.0, max=64.0
    )
    window_memory: Scalar = parameter(
        "1", "Samples that are kept; a constant of exported C, which has room for no more", 8192.0, min=64.0, max=8192.0
    )
    publish_within: Scalar = parameter("s", "Age beyond which a sample is not published; 0: all are", 0.0, min=0.0)
    prior_resistance: Scalar = prior("Resistance R", 0.15)
    prior_eddy: Scalar = prior("Eddy currents g_e", 0.5)
    prior_gap: Scalar = prior("Factor of the gap reluctance", 0.04)
    prior_knee: Scalar = prior("Knee b of the core", 0.4)
    prior_saturation: Scalar = prior("Flux linkage of saturation", 0.06)
    prior_hysteresis: Scalar = prior("Amplitude I_h of the hysteresis", 1.0)
    prior_mass: Scalar = prior("Mass of the mover", 0.04)
    prior_rest: Scalar = prior("Position without spring force", 0.04)
    prior_damping: Scalar = prior("Viscous damping", 0.1)
    prior_core: Scalar = prior("Reluctance R_c of the core without its knee, over N^2", 0.2)
    prior_bend: Scalar = prior("Bend of the gap law, zero at both stops", 0.1)
    prior_voltage: Scalar = parameter("V", "Offset of the voltage: deviation; 0: none is learnt", 0.0, min=0.0)
    health_limit: Scalar = parameter("1", "Largest misfit; good windows have less than 1", 3.0, min=0.0)


class Gap(NamedTuple):
    """Reluctance of the gap over N^2 as believed, without factor and bend: a table, or a formula with fringing."""

    is_table: Scalar
    knots: Annotated[Array, Table()]  # [m]
    reluctance: Annotated[Array, Table()]  # [1/H]
    curvature: Annotated[Array, Table()]  # [1/(H m^2)]
    scale: Scalar  # 1/N^2
    offset: Scalar
    slope: Scalar
    fringing: Scalar
    window: Scalar
    smallest: Scalar  # between the stops [m]
    largest: Scalar
    bump: Scalar  # see `bump` [1/(H m^2)]


class Device(NamedTuple):
    """What the windows correct."""

    resistance: Scalar  # R [ohm]
    eddy: Scalar  # g_e [S]
    gap: Scalar  # factor of R_g [1]
    knee: Scalar  # b [A]
    saturation: Scalar  # lambda_sat [Wb]
    hysteresis: Scalar  # I_h [A]
    mass: Scalar  # m_z [kg]
    rest: Scalar  # z_sp [m]
    damping: Scalar  # c [N s/m]
    core: Scalar  # R_c [1/H]
    bend: Scalar  # of R_g, zero at both stops [1]


NOTHING = Device(*[0.0] * len(Device._fields))


class Model(NamedTuple):
    """A device, with everything that its model needs."""

    d: Device
    T_s: Scalar
    is_mean: Scalar  # a voltage is the mean since the last sample
    stiffness: Scalar
    length: Scalar  # l_h [Wb]
    lower: Scalar
    upper: Scalar
    gap: Gap
    quiet_voltage: Scalar
    quiet_current: Scalar
    through: Scalar  # 1 / (1 + R g_e)
    load: Scalar  # R / (1 + R g_e) [ohm]
    bounces: Scalar  # whether the mover does
    is_elastic: Scalar  # the stops
    give: Scalar  # what they give way [m/N], or 0
    restitution: Scalar
    stop_damping: Scalar
    exponent: Scalar  # n of another knee, S = m^n; 0: that of (1)


class Point(NamedTuple):
    """The model at a sample."""

    flux_linkage: Scalar
    hysteresis: Scalar  # h
    position: Scalar
    velocity: Scalar
    acceleration: Scalar
    voltage: Scalar  # of the sample
    reluctance: Scalar  # R_g
    slope: Scalar  # R_g'
    mmf: Scalar  # f
    mmf_slope: Scalar  # df/dlambda at constant h


def model(par: Parameters, d: Device) -> Model:
    """The model of a device."""
    m = Model(
        d=d,
        T_s=par.sample_time,
        is_mean=par.option_mean,
        stiffness=par.spring_stiffness,
        length=par.core_turnover,
        lower=par.stop_lower,
        upper=par.stop_upper,
        gap=make_gap(par),
        quiet_voltage=QUIET_VOLTAGE * par.noise_voltage,
        quiet_current=QUIET_CURRENT * par.noise_current,
        through=1.0,
        load=0.0,
        bounces=(par.stop_law > 0.5) | (par.stop_restitution > 0.0),
        is_elastic=par.stop_law > 0.5,
        give=where(par.stop_law > 0.5, 1.0 / par.stop_stiffness, 0.0),
        restitution=par.stop_restitution,
        stop_damping=par.stop_damping,
        exponent=par.core_exponent,
    )
    return with_device(m, d)


def with_device(m: Model, d: Device) -> Model:
    """The model of another device."""
    through = 1.0 / (1.0 + d.resistance * d.eddy)
    return m._replace(d=d, through=through, load=d.resistance * through)


def device(par: Parameters) -> Device:
    """What is believed before the first window; without a bend of its own the core is Froehlich's."""
    scale, is_sharp = 1.0 / square(par.coil_turns), par.core_exponent > 0.0
    has_bend = is_sharp | (par.core_bend > 0.0)
    R_c, lam_s = scale * where(is_sharp, par.core_sharp_reluctance, par.core_reluctance), par.core_saturation
    bend = where(is_sharp, par.core_sharp_bend, par.core_bend)
    return Device(
        resistance=par.coil_resistance,
        eddy=par.core_eddy,
        gap=par.gap_factor,
        knee=where(has_bend, scale * bend, KNEE * R_c) * lam_s,
        saturation=where(has_bend, lam_s, SATURATION * lam_s),
        hysteresis=par.core_hysteresis,
        mass=par.mover_mass,
        rest=par.spring_rest,
        damping=par.damping,
        core=where(has_bend, R_c, CORE * R_c),
        bend=par.gap_bend,
    )


def apply_corrections(d: Device, q: Array) -> Device:
    """The device with corrections q (11,): logarithms of factors, but of core and bend what is added."""
    factors = Device(*(value * exp(change) for value, change in zip(d, q)))
    return factors._replace(core=d.core + q[-2], bend=d.bend + q[-1])


# reluctances


def make_gap(par: Any) -> Gap:
    """The law by the parameters of an estimator or a controller that have the names of those of `Mhe`."""
    scale = 1.0 / square(par.coil_turns)
    law = Gap(
        is_table=par.gap_law == GapLaw.table,
        knots=par.gap_file_gap,
        reluctance=par.gap_file_reluctance,
        curvature=par.gap_file_spline,
        scale=scale,
        offset=par.gap_reluctance * scale,
        slope=par.gap_slope * scale,
        fringing=par.gap_fringing,
        window=par.gap_window,
        smallest=par.stop_lower,
        largest=par.stop_upper,
        bump=0.0,
    )
    rise = gap_law(law.largest, law)[0] - gap_law(law.smallest, law)[0]
    return law._replace(bump=2.0 * rise / square(law.largest - law.smallest))


def gap_law(z: Scalar, law: Gap) -> tuple[Scalar, Scalar, Scalar]:
    """Believed R_g(z) without factor and bend, its first and its second derivative [1/H]."""
    return cond(law.is_table, lambda: _interpolate_gap(z, law), lambda: _fringing(z, law))


def _interpolate_gap(z: Scalar, law: Gap) -> tuple[Scalar, Scalar, Scalar]:
    R, slope, curvature = spline(z, law.knots, law.reluctance, law.curvature)
    return law.scale * R, law.scale * slope, law.scale * curvature


def _fringing(z: Scalar, law: Gap) -> tuple[Scalar, Scalar, Scalar]:
    """R_g0 + R_g0' z / (1 + k z ln(c/z))."""
    z = where(z > SMALLEST_GAP, z, SMALLEST_GAP)
    k, ratio = law.fringing, log(law.window / z)
    w, rise = 1.0 + k * z * ratio, 1.0 + k * z
    slope = law.slope / (w * w)
    curvature = slope * k * (w - 2.0 * rise * (ratio - 1.0)) / w
    return law.offset + law.slope * z / w, slope * rise, curvature


def bump(z: Scalar, law: Gap) -> tuple[Scalar, Scalar, Scalar]:
    """What a bend of 1 adds to R_g: in the middle half of its rise from stop to stop; and the derivatives [1/H]."""
    most = law.bump
    return most * (z - law.smallest) * (law.largest - z), most * (law.smallest + law.largest - 2.0 * z), -2.0 * most


def gap(z: Scalar, law: Gap, factor: Scalar, bend: Scalar) -> tuple[Scalar, Scalar, Scalar]:
    """R_g corrected, its first and its second derivative [1/H]."""
    R, slope, curvature = (factor * a + bend * b for a, b in zip(gap_law(z, law), bump(z, law)))
    return R, slope, curvature


def gap_at(z: Scalar, m: Model) -> tuple[Scalar, Scalar]:
    """R_g of the device, and its derivative."""
    return gap(z, m.gap, m.d.gap, m.d.bend)[:2]


def core(lam: Scalar, d: Device, exponent: Scalar = 0.0) -> tuple[Scalar, Scalar, Scalar]:
    """The share m of saturation, S(m) and S'(m)."""
    m = lam / d.saturation
    size = fabs(m)
    S, slope = cond(exponent > 0.0, lambda: _power(size, exponent), lambda: _knee(size))
    return m, where(m < 0.0, -S, S), slope


def _power(size: Scalar, n: Scalar) -> tuple[Scalar, Scalar]:
    a = where(size > SMALL, size, SMALL)
    S = exp(n * log(a))
    return S, n * S / a


def _knee(size: Scalar) -> tuple[Scalar, Scalar]:
    a = where(size < FULL, size, FULL)
    squared = a * a
    left = 1.0 - squared
    slope = squared * (3.0 - squared) / (left * left)
    return squared * a / left + slope * (size - a), slope


# a sampling period


def point(lam: Scalar, h: Scalar, z: Scalar, v: Scalar, u: Scalar, m: Model) -> Point:
    """The model in a given state."""
    R, slope = gap_at(z, m)
    f, f_lam = magnetomotive(lam, h, R, m)
    return Point(
        flux_linkage=lam,
        hysteresis=h,
        position=z,
        velocity=v,
        acceleration=(pull(z, lam, slope, m) - m.d.damping * v) / m.d.mass,
        voltage=u,
        reluctance=R,
        slope=slope,
        mmf=f,
        mmf_slope=f_lam,
    )


def pull(z: Scalar, lam: Scalar, slope: Scalar, m: Model) -> Scalar:
    """Force of spring and magnet."""
    return m.stiffness * (m.d.rest - z) - 0.5 * slope * square(lam)


def magnetomotive(lam: Scalar, h: Scalar, R: Scalar, m: Model) -> tuple[Scalar, Scalar]:
    """The force f (1) [A] and df/dlambda [1/H]."""
    share, S, slope = core(lam, m.d, m.exponent)
    f = (R + m.d.core) * lam + m.d.knee * S + h * (1.0 + share * share)
    return f, R + m.d.core + (m.d.knee * slope + 2.0 * h * share) / m.d.saturation


def mean_of(before: Scalar, voltage: Scalar, m: Model) -> Scalar:
    """The mean voltage of a sampling period: given as such, or from sample to sample linear."""
    return where(m.is_mean > 0.0, voltage, 0.5 * (before + voltage))


def current(p: Point, mean: Scalar, m: Model) -> Scalar:
    """The current i (1) at a point, for the mean voltage of the sampling period."""
    return (m.d.eddy * mean + p.mmf) * m.through


def is_resting(p: Point, m: Model) -> Scalar:
    """On a stop, with a force that points into it."""
    is_held_down = (p.position <= m.lower) & (p.acceleration <= 0.0)
    is_held = is_held_down | ((p.position >= m.upper) & (p.acceleration >= 0.0))
    return is_held & (not_(m.bounces) | (p.velocity == 0.0))


def is_between(p: Point, m: Model) -> Scalar:
    """Whether the mover is between its stops."""
    return (p.position > m.lower) & (p.position < m.upper)


def is_quiet(p: Point, mean: Scalar, m: Model) -> Scalar:
    """No voltage but noise, and no current: noise turns the hysteresis to and fro, and would demagnetize the core."""
    return (fabs(mean) < m.quiet_voltage) & (fabs(p.mmf) < m.quiet_current)


class Electric(NamedTuple):
    """What drives the flux linkage at a point."""

    current: Scalar
    rate: Scalar  # dlambda/dt
    goal: Scalar  # s I_h
    length: Scalar  # L
    steepness: Scalar  # dh/dlambda
    width: Scalar  # 1 + m^2


def electric(p: Point, mean: Scalar, m: Model) -> Electric:
    """For the mean voltage of the sampling period."""
    i = current(p, mean, m)
    rate = mean - m.d.resistance * i
    is_falling, share = rate < 0.0, p.flux_linkage / m.d.saturation
    squared = share * share
    left = 1.0 - SHORTENED * squared
    length = m.length * where(left > SHORTEST, left, SHORTEST)
    away = m.d.hysteresis + where(is_falling, p.hysteresis, -p.hysteresis)
    goal = where(is_falling, -m.d.hysteresis, m.d.hysteresis)
    return Electric(current=i, rate=rate, goal=goal, length=length, steepness=away / length, width=1.0 + squared)


def gain(p: Point, e: Electric, dt: Scalar, m: Model) -> Scalar:
    """Change of the flux linkage over its rate, by the linearised trapezoidal rule [s]."""
    return dt / (1.0 + 0.5 * dt * m.load * (p.mmf_slope + e.steepness * e.width))


class Bouncing(NamedTuple):
    """A mover that bounces makes currents that the model does not know; the flux linkage is that of the measured."""

    bounces: Scalar = False  # whether it does
    current: Scalar = 0.0  # measured mean in the sampling period


NO_BOUNCE = Bouncing()


def advance(p: Point, voltage: Scalar, m: Model, seen: Bouncing = NO_BOUNCE) -> Point:
    """The next sample, whose voltage is given: (2) exactly, (3) by Verlet's method."""
    mean, rests = mean_of(p.voltage, voltage, m), is_resting(p, m)
    e, stays = electric(p, mean, m), rests & is_quiet(p, mean, m)
    free = p.position + m.T_s * (p.velocity + 0.5 * m.T_s * p.acceleration)
    z, turned_round = _stop(p, free, rests, m)
    change = gain(p, e, m.T_s, m) * (e.rate - 0.5 * m.load * p.slope * p.flux_linkage * (z - p.position))
    change = where(seen.bounces, m.T_s * (mean - m.d.resistance * seen.current), change)
    lam = p.flux_linkage + where(stays, 0.0, change)
    turned = e.goal + (p.hysteresis - e.goal) * exp(-fabs(change) / e.length)
    h = where(stays, p.hysteresis, turned)
    R, slope = cond(rests & (z == p.position), lambda: (p.reluctance, p.slope), lambda: gap_at(z, m))
    f, f_lam = magnetomotive(lam, h, R, m)
    stands, force = rests | not_(z == free), pull(z, lam, slope, m)
    a = (force - where(stands, 0.0, m.d.damping * (p.velocity + m.T_s * p.acceleration))) / m.d.mass
    v = where(stands, turned_round, p.velocity + 0.5 * m.T_s * (p.acceleration + a))
    return Point(
        flux_linkage=lam,
        hysteresis=h,
        position=z,
        velocity=v,
        acceleration=a,
        voltage=voltage,
        reluctance=R,
        slope=slope,
        mmf=f,
        mmf_slope=f_lam,
    )


def _stop(p: Point, free: Scalar, rests: Scalar, m: Model) -> tuple[Scalar, Scalar]:
    """Stop a free motion: position after a sampling period (`free` without stops), and the velocity that is left."""
    within, is_outside = clip(free, m.lower, m.upper), (p.position < m.lower) | (p.position > m.upper)
    meets = m.bounces & (rests | is_outside | not_(within == free))
    return cond(meets, lambda: _turn_round(p, free, rests, m), lambda: (where(rests, p.position, within), 0.0))


def _turn_round(p: Point, free: Scalar, rests: Scalar, m: Model) -> tuple[Scalar, Scalar]:
    """The same on a stop from which the mover comes back: depth and speed are counted into the stop.

    A hard one turns the speed round at the sample.  On an elastic one the mover oscillates about the depth to which the
    force presses it, and loses speed where it leaves: nearly as by the law of Hunt and Crossley.  At rest it is at that
    depth.
    """
    into = where((free < m.lower) | (p.position < m.lower) | (rests & (p.position == m.lower)), -1.0, 1.0)
    stop, push = where(into < 0.0, m.lower, m.upper), into * p.acceleration
    pressed, depth = m.give * m.d.mass * push, into * (p.position - stop)
    share = where(depth < 0.0, (stop - p.position) / where(depth < 0.0, free - p.position, 1.0), 0.0)
    left, speed = (1.0 - share) * m.T_s, into * p.velocity + share * m.T_s * push
    start = where(depth < 0.0, 0.0, depth)
    omega = sqrt(1.0 / where(m.give > 0.0, m.give * m.d.mass, 1.0))
    yields = (m.give > 0.0) & (omega * m.T_s < QUICK)

    half = 0.5 * omega * left
    tan = half + half * half * half / 3.0
    cos, sin = (1.0 - tan * tan) / (1.0 + tan * tan), 2.0 * tan / (1.0 + tan * tan)
    end = pressed + (start - pressed) * cos + speed / omega * sin
    later = speed * cos - (start - pressed) * omega * sin
    stays = yields & (end > 0.0)
    back = _rebound_speed(where(yields, -later, speed), m)
    rise = 2.0 * LEAST_RETURN * (m.upper - m.lower) * fabs(push)
    is_worth = (back > 0.5 * m.T_s * fabs(push)) & (back * back > rise)  # or it is down again with the next sample
    back = where(is_worth, back, 0.0)
    gone = where(yields, -end / where(stays | (start <= end), 1.0, start - end), 0.0)  # share of the time since it left
    away = where(stays, end, -back * gone * left)
    rest = where(pressed > 0.0, pressed, 0.0)
    return stop + into * where(rests, rest, away), where(rests, 0.0, into * where(stays, later, -back))


def _rebound_speed(speed: Scalar, m: Model) -> Scalar:
    """Speed after an impact."""
    return speed * where(m.is_elastic, 1.0 / (1.0 + LOST * m.stop_damping * speed), m.restitution)


# derivatives


def differentiate(
    T: Any, which: Sequence[int], p: Point, mean: Scalar, samples: Scalar, is_still: Scalar, bounces: Scalar, m: Model
) -> tuple[Any, Any]:
    """Derivatives T (k, 4) of the state by some corrections, `samples` later, at p, and those of the current (k,).

    `which` says by which field of `Device` a row is; one more stands for the flux linkage at the start.  On a stop
    position and velocity are given, and while the mover `bounces` the flux linkage changes by R only.
    """
    e, dt = electric(p, mean, m), m.T_s * samples
    step = where((is_still & is_quiet(p, mean, m)) | bounces, 0.0, gain(p, e, dt, m))
    kept = exp(-fabs(step * e.rate) / e.length)
    drive, force = partials(p, e, m)
    measured = where(bounces, -dt * m.d.resistance * e.current, 0.0)
    rise = [*NOTHING._replace(hysteresis=(1.0 - kept) * e.goal), 0.0]
    by_z = p.slope * p.flux_linkage

    def row(k: int, t: Array, z: Scalar, v: Scalar) -> list[Scalar]:
        through = p.mmf_slope * t[0] + 0.5 * by_z * (t[2] + z) + e.width * t[1] + drive[k]
        change = -(step * m.load) * through
        flux_linkage = t[0] + change + (measured if k == 0 else 0.0)
        return [flux_linkage, kept * (t[1] + e.steepness * change) + rise[k], z, v]

    def moving() -> Any:
        _, _, curvature = gap(p.position, m.gap, m.d.gap, m.d.bend)
        stiffness = (m.stiffness + 0.5 * curvature * square(p.flux_linkage)) / m.d.mass
        by_lam, by_v, half, rows = by_z / m.d.mass, m.d.damping / m.d.mass, 0.5 * dt, []
        for k, t in zip(which, T):
            a = force[k] - by_lam * t[0] - stiffness * t[2] - by_v * t[3]
            rows.append(row(k, t, t[2] + dt * (t[3] + half * a), t[3] + dt * a))
        return matrix(rows)

    T = cond(is_still, lambda: matrix([row(k, t, 0.0, 0.0) for k, t in zip(which, T)]), moving)
    drive[0] = -m.d.eddy * m.d.resistance * e.current
    seen = [p.mmf_slope * t[0] + by_z * t[2] + e.width * t[1] + drive[k] for k, t in zip(which, T)]
    return T, m.through * vector(seen)


def partials(p: Point, e: Electric, m: Model) -> tuple[Array, Array]:
    """Of R i - g_e dlambda/dt + f and of the acceleration by the corrections in a given state; (12,), the last 0."""
    d, lam = m.d, p.flux_linkage
    share, S, slope = core(lam, d, m.exponent)
    more, steeper, _ = bump(p.position, m.gap)
    half = -0.5 * lam * lam / d.mass
    drive = NOTHING._replace(
        resistance=e.current,
        eddy=d.eddy * e.rate,
        gap=(p.reluctance - d.bend * more) * lam,
        knee=d.knee * S,
        saturation=-share * (d.knee * slope + 2.0 * p.hysteresis * share),
        core=lam,
        bend=more * lam,
    )
    force = NOTHING._replace(
        gap=half * (p.slope - d.bend * steeper),
        mass=-p.acceleration,
        rest=m.stiffness * d.rest / d.mass,
        damping=-d.damping * p.velocity / d.mass,
        bend=half * steeper,
    )
    return vector([*drive, 0.0]), vector([*force, 0.0])
