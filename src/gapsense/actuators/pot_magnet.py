"""Pot magnet that lifts its armature against gravity, the five-mode plant of [HEKF] Section 4.

Modes: 0 on the lower stop, 1 lifting, 2 in contact with the upper stop, 3 the same without voltage, 4 falling.

    0 -> 1  |i| >= i_on and the net force points up       1 -> 2  s = s_max
    2 -> 3  the voltage sustains less than i_off          3 -> 2  it sustains that again
    3 -> 4  |i| < i_off and the net force points down     4 -> 0  s = 0
    1 -> 0  s = 0: a lift that failed                     4 -> 3  s = s_max: pulled back below i_on
    4 -> 1  |i| >= i_on and the net force points up: energised again while falling

Current and position go on through all of them.  An impact takes the velocity, or leaves the part of it that the
coefficient of restitution tells.  The four transitions at the end are not in print, nor are the conditions on the net
force; the printed end of contact, di/dt = 0, cannot work.

Integrated in flux linkage: lambda' = u - R i with i = lambda (K2 + K3 gap) / K5.  With (14) the force is then
K4 (lambda / K5)^2 wherever the armature is.  Orientation `printed` has gap = s: the force points to where the
inductance falls, which creates energy; `consistent` has gap = s_max - s and does not.
"""

from __future__ import annotations

from functools import partial
from typing import Annotated, NamedTuple

from gapsense.actuators.motion import Contact, hardest, rebound
from gapsense.kernels.integrate import add_integrals, equal_parts, least, next_part, rk4_until
from gapsense.kernels.interface import choice, fixed, input_, output, parameter, ports
from gapsense.kernels.layout import Choice, Scalar, blank
from gapsense.kernels.trace import clip, cond, fabs, loop, not_, square, where

MU_0 = 1.257e-6  # as rounded in [HEKF] Table 1 [H/m]
MICRO_STEPS = 10_000_000  # at most, per communication step
FINENESS = 0.025  # longest micro-step in the smallest time constant of the coil: flux errors below 1e-9
LOWER, LIFTING, CONTACT, UPPER, FALLING = 0.0, 1.0, 2.0, 3.0, 4.0


class Orientation(Choice):
    """Where the gap is: under the upper stop, or above the lower one as in the paper."""

    consistent, printed = range(2)


@ports()
class Parameters(NamedTuple):
    """Table 1, the orientation and the micro-step."""

    orientation: Annotated[Scalar, Orientation] = choice(
        "Gap under the upper stop, or above the lower one as in the paper"
    )
    coil_turns: Scalar = fixed("1", "Number of windings N", 964.0, min=1e-9)
    coil_resistance: Scalar = parameter("Ohm", "Resistance in modes 0 to 2, K6 = R_i + R_m", 114.3, min=1e-9)
    coil_resistance_upper: Scalar = parameter("Ohm", "Resistance in modes 3 and 4, K7 = R_d + R_m", 120.0, min=1e-9)
    core_permeability: Scalar = fixed("1", "Relative permeability mu_r", 200.0, min=1e-9)
    core_length: Scalar = fixed("m", "Average length of the field lines l_1", 22e-3, min=1e-9)
    pole_area: Scalar = fixed("m2", "Area of the flux A", 7.6341e-5, min=1e-12)
    mover_mass: Scalar = fixed("kg", "Mass of the armature m", 0.34, min=1e-9)
    gravity: Scalar = parameter("m/s2", "Gravity g", 9.81, min=1e-9)
    stop_upper: Scalar = fixed("m", "Position of the upper stop s_max; [HEKF] prints 0.5 mm", 0.2e-3, min=1e-9)
    stop_restitution: Scalar = fixed("1", "Speed after an impact over that before it", 0.0, min=0.0, max=0.95)
    current_on: Scalar = parameter("A", "Least current for a lift i_on", 0.1, min=1e-9)
    current_off: Scalar = parameter("A", "Current below which it drops i_off", 0.02, min=1e-9)
    initial_position: Scalar = fixed("m", "Position at the start", 0.0, min=0.0)
    micro_step: Scalar = fixed("s", "Longest step of the integrator", 25e-6, min=1e-7, name="micro_step")


class State(NamedTuple):
    """What is carried from step to step."""

    flux_linkage: Scalar  # lambda [Wb]
    position: Scalar  # s, above the lower stop [m]
    velocity: Scalar  # v [m/s]
    mode: Scalar  # q, 0 to 4
    dissipated_energy: Scalar  # copper and impacts, since the start [J]
    supplied_energy: Scalar  # integral of u i since the start [J]
    created_energy: Scalar  # by the printed orientation, out of nothing, since the start [J]
    impact_speed: Scalar  # of the hardest impact since the armature last left its rest [m/s]


@ports()
class Inputs(NamedTuple):
    """Voltage, and the communication step that ends at `time`."""

    time: Scalar  # [s]
    dt: Scalar  # [s]
    voltage: Scalar = input_("V", "Coil voltage, held during the step", source="drive.voltage_mean", nominal=24.0)


@ports()
class Outputs(NamedTuple):
    """Values at the end of the step."""

    current: Scalar = output("A", "Coil current", nominal=0.2)
    position: Scalar = output("m", "Lift of the armature: 0 at the lower stop", nominal=0.2e-3)
    velocity: Scalar = output("m/s", "Rate of the position", nominal=0.1)
    flux_linkage: Scalar = output("Wb", "Flux linkage", nominal=0.1)
    inductance: Scalar = output("H", "Inductance, flux linkage / current", nominal=0.8)
    force: Scalar = output("N", "Magnetic force, upwards", nominal=3.0)
    mode: Scalar = output(
        "1", "0: at the lower stop, 1: lifting, 2: contact, 3: at the upper stop, 4: falling", min=0.0, max=4.0
    )
    contact: Scalar = output("1", "1 on a stop, else 0", min=0.0, max=1.0)
    dissipated_energy: Scalar = output("J", "Lost in the coil and the impacts since the start", nominal=0.1)
    stored_energy: Scalar = output("J", "Magnetic, potential and kinetic energy", nominal=0.01)
    supplied_energy: Scalar = output("J", "Integral of voltage times current since the start", nominal=0.1)
    created_energy: Scalar = output("J", "What the printed orientation creates out of nothing, since the start")
    impact_speed: Scalar = output("m/s", "Hardest impact since the armature last left its rest", nominal=0.5)


class Magnet(NamedTuple):
    """Constants of a step, with the names of [HEKF] Section 4."""

    u: Scalar
    K2: Scalar
    K3: Scalar
    K4: Scalar
    K5: Scalar
    K6: Scalar
    K7: Scalar
    m: Scalar
    g: Scalar
    s_max: Scalar
    restitution: Scalar
    i_on: Scalar
    i_off: Scalar
    is_printed: Scalar
    micro_step: Scalar  # length of the equal micro-steps [s]


class Moving(NamedTuple):
    """What is integrated in the air; at rest it is the flux linkage alone."""

    lam: Scalar
    s: Scalar
    v: Scalar


class Sums(NamedTuple):
    """Integrals: losses [J], charge [A s], and the energy that the printed orientation creates [J]."""

    heat: Scalar
    charge: Scalar
    created: Scalar


def initial(inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """At rest without flux, between the stops."""
    s = clip(par.initial_position, 0.0, par.stop_upper)
    mode = where(s <= 0.0, LOWER, where(s >= par.stop_upper, UPPER, FALLING))
    state = blank(State, position=s, mode=mode)
    return state, _outputs(state, _magnet(inputs, par))


def step(state: State, inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """One communication step of equal micro-steps, shortened where the mode changes.

    A step of no length changes nothing.
    """
    mag = _magnet(inputs, par)
    at = Moving(state.flux_linkage, state.position, state.velocity)
    sums = Sums(state.dissipated_energy, 0.0, state.created_energy)
    start = (inputs.dt, at, Contact(state.mode, state.impact_speed), sums)
    _, at, contact, sums = loop(MICRO_STEPS, partial(_micro_step, mag), start)
    state = State(
        flux_linkage=at.lam,
        position=at.s,
        velocity=at.v,
        mode=contact.mode,
        dissipated_energy=sums.heat,
        supplied_energy=state.supplied_energy + inputs.voltage * sums.charge,
        created_energy=sums.created,
        impact_speed=contact.impact,
    )
    return state, _outputs(state, mag)


def _magnet(inputs: Inputs, par: Parameters) -> Magnet:
    K3, K5 = 2.0 * par.core_permeability, square(par.coil_turns) * par.core_permeability * MU_0 * par.pole_area
    K6, K7 = par.coil_resistance, par.coil_resistance_upper
    fastest = where(K6 < K7, K7, K6) * (par.core_length + K3 * par.stop_upper) / K5
    return Magnet(
        u=inputs.voltage,
        K2=par.core_length,
        K3=K3,
        K4=par.core_permeability * K5,
        K5=K5,
        K6=K6,
        K7=K7,
        m=par.mover_mass,
        g=par.gravity,
        s_max=par.stop_upper,
        restitution=par.stop_restitution,
        i_on=par.current_on,
        i_off=par.current_off,
        is_printed=par.orientation == Orientation.printed,
        micro_step=equal_parts(inputs.dt, least(par.micro_step, FINENESS / fastest)),
    )


def _micro_step(
    mag: Magnet, left: Scalar, at: Moving, contact: Contact, sums: Sums
) -> tuple[tuple[Scalar, Moving, Contact, Sums], Scalar]:
    """One step of the loop; `left` is what is left of the communication step [s]."""
    dt = next_part(left, mag.micro_step)
    mode = where(left > 0.0, _contact(mag, at.lam, contact.mode), contact.mode)
    contact, is_moving = Contact(mode, contact.impact), (mode == LIFTING) | (mode == FALLING)
    dt, at, contact, part = cond(
        is_moving, lambda: _move(mag, dt, at, contact, is_moving), lambda: _rest(mag, dt, at, contact)
    )
    left = left - dt
    return (left, at, contact, add_integrals(sums, part)), not_(left > 0.0)


def _contact(mag: Magnet, lam: Scalar, mode: Scalar) -> Scalar:
    """Mode at the upper stop, 2 or 3: by the current that the voltage sustains in the direction of the present flux."""
    is_sustained = where(lam < 0.0, -mag.u, mag.u) >= mag.K7 * mag.i_off
    return where((mode == CONTACT) | (mode == UPPER), where(is_sustained, CONTACT, UPPER), mode)


def _move(
    mag: Magnet, dt: Scalar, at: Moving, contact: Contact, is_moving: Scalar
) -> tuple[Scalar, Moving, Contact, Sums]:
    """Step of the moving armature, up to an impact or until it is energised again."""
    is_lifting, R = contact.mode == LIFTING, _resistance(mag, contact.mode)

    def margin(y: Moving) -> Scalar:
        clearance = least(y.s, mag.s_max - y.s) / mag.s_max
        return least(clearance, where(is_lifting, 1.0, -_lift(mag, y.lam, y.s)))

    dt, (lam, s, v), (heat, charge, work), _ = rk4_until(partial(_rates, mag, R), at, dt, margin, is_moving)
    is_below, is_above = s < 0.0, s > mag.s_max
    is_landed, back = is_below | is_above, rebound(v, mag.restitution)
    flying = where(is_lifting | (_lift(mag, lam, s) > 0.0), LIFTING, FALLING)
    resting = where(is_below, LOWER, where(is_lifting, CONTACT, UPPER))
    heat = heat + where(is_landed, _kinetic_energy(v, mag) - _kinetic_energy(back, mag), 0.0)
    created = where(mag.is_printed, 2.0 * work, 0.0)
    impact = where(is_landed, hardest(v, contact.impact), contact.impact)
    contact = Contact(where(is_landed & (back == 0.0), resting, flying), impact)
    return dt, Moving(lam, clip(s, 0.0, mag.s_max), where(is_landed, back, v)), contact, Sums(heat, charge, created)


def _rest(mag: Magnet, dt: Scalar, at: Moving, contact: Contact) -> tuple[Scalar, Moving, Contact, Sums]:
    """Step on a stop, of the flux only, up to the release if there is one."""
    mode = contact.mode
    R, is_lower, is_upper = _resistance(mag, mode), mode == LOWER, mode == UPPER

    def margin(y: tuple[Scalar]) -> Scalar:
        (lam,) = y
        return where(is_lower, -_lift(mag, lam, at.s), where(is_upper, -_drop(mag, lam, at.s), 1.0))

    rate = partial(_resting_rates, mag, R, at.s)
    dt, (lam,), (heat, charge), is_released = rk4_until(rate, (at.lam,), dt, margin)
    mode = where(is_released, where(is_lower, LIFTING, FALLING), mode)
    contact = Contact(mode, where(is_released, 0.0, contact.impact))
    return dt, Moving(lam, at.s, 0.0), contact, Sums(heat, charge, 0.0)


def _rates(mag: Magnet, R: Scalar, y: Moving) -> tuple[Moving, tuple[Scalar, ...]]:
    """(9) in flux linkage and (13); integrands: loss in copper [W], current [A], power of the magnetic force [W]."""
    F_m, i = _force(y.lam, mag), _current(y.lam, y.s, mag)
    return Moving(mag.u - R * i, y.v, F_m / mag.m - mag.g), (R * i * i, i, F_m * y.v)


def _resting_rates(
    mag: Magnet, R: Scalar, s: Scalar, y: tuple[Scalar]
) -> tuple[tuple[Scalar, ...], tuple[Scalar, ...]]:
    """(16), (18), (19); integrands: loss in copper [W] and current [A]."""
    i = _current(y[0], s, mag)
    return (mag.u - R * i,), (R * i * i, i)


def _lift(mag: Magnet, lam: Scalar, s: Scalar) -> Scalar:
    """Positive if the current reaches i_on and the net force points up."""
    weight = mag.m * mag.g
    return least(fabs(_current(lam, s, mag)) / mag.i_on - 1.0, _force(lam, mag) / weight - 1.0)


def _drop(mag: Magnet, lam: Scalar, s: Scalar) -> Scalar:
    """Positive if the current is below i_off and the net force points down."""
    weight = mag.m * mag.g
    return least(1.0 - fabs(_current(lam, s, mag)) / mag.i_off, 1.0 - _force(lam, mag) / weight)


def _resistance(mag: Magnet, mode: Scalar) -> Scalar:
    return where(mode >= UPPER, mag.K7, mag.K6)


def _current(lam: Scalar, s: Scalar, mag: Magnet) -> Scalar:
    """Current lambda / L with L = K5 / (K2 + K3 gap), (10)."""
    return lam * (mag.K2 + mag.K3 * where(mag.is_printed, s, mag.s_max - s)) / mag.K5


def _force(lam: Scalar, mag: Magnet) -> Scalar:
    """F_m = K4 i^2 / (K2 + K3 gap)^2 (14), with i = lambda / L."""
    return mag.K4 * square(lam / mag.K5)


def _kinetic_energy(v: Scalar, mag: Magnet) -> Scalar:
    return 0.5 * mag.m * square(v)


def _outputs(state: State, mag: Magnet) -> Outputs:
    lam, s, v = state.flux_linkage, state.position, state.velocity
    i = _current(lam, s, mag)
    return Outputs(
        current=i,
        position=s,
        velocity=v,
        flux_linkage=lam,
        inductance=mag.K5 / (mag.K2 + mag.K3 * where(mag.is_printed, s, mag.s_max - s)),
        force=_force(lam, mag),
        mode=state.mode,
        contact=where((state.mode == LIFTING) | (state.mode == FALLING), 0.0, 1.0),
        dissipated_energy=state.dissipated_energy,
        stored_energy=0.5 * lam * i + _kinetic_energy(v, mag) + mag.m * mag.g * s,
        supplied_energy=state.supplied_energy,
        created_energy=state.created_energy,
        impact_speed=state.impact_speed,
    )
