"""One micro-step of the actuator from a table: flux, core and motion, up to the next switch.

Inside a micro-step everything is smooth. It ends where

- the mover meets a stop, leaves an elastic one, or turns round;
- dry friction brings the mover to rest, or no longer holds it: it acts against the motion, and at rest it balances the
  other forces, so the mover never creeps;
- the flux turns round, or the walls of a hysteretic core start to move, as in `reluctance_steps`.

A hard stop turns the speed round at once, with a coefficient of restitution. An elastic one has the force
k d (1 + b dd/dt) at the depth d (Hunt and Crossley). The force starts from zero and never pulls.
"""

from __future__ import annotations

from functools import partial
from typing import Any, NamedTuple

from gapsense.actuators import hysteresis, motion
from gapsense.actuators.hysteresis import Core
from gapsense.actuators.motion import CLOSED, MOVING, OPEN
from gapsense.actuators.reluctance_steps import (
    Actuator,
    Electric,
    Losses,
    Switches,
    magnetic_rates,
    make_electric,
    shorten_step,
    switch,
)
from gapsense.actuators.surface import Patch, Surface, surface, surface_patch
from gapsense.kernels.integrate import add_integrals, least, next_part, rk4_until
from gapsense.kernels.layout import Array, Scalar
from gapsense.kernels.trace import cond, fabs, load, locate, not_, sqrt, square, where

SWITCH_SCALE = 1e-8  # of the margins of the core: a settled flux is 1e-10 from turning, and would hide a stop ahead
STOP_FINENESS = 0.1  # micro-step on an elastic stop at most, in reciprocal angular frequencies of the mover there


class Device(NamedTuple):
    """Constants of a step."""

    act: Actuator  # without a gap law
    map: Surface  # current over gap and flux linkage, in its place
    calm: Core  # the core without hysteresis
    push: Scalar  # of preload and gravity [N]
    friction: Scalar  # dry [N]
    is_table: Scalar  # the spring
    spring_gap: Array  # rising [m]
    spring_force: Array  # [N]
    spring_integral: Array  # [J]
    is_elastic: Scalar  # the stops
    stiffness: Scalar  # of the stops [N/m]
    damping: Scalar  # of the stops [s/m]
    stop_need: Scalar  # steps per second on an elastic stop, by STOP_FINENESS


class Continuous(NamedTuple):
    """What is integrated."""

    flux: Scalar  # phi [Wb]
    field: Scalar  # effective field H_e of the core with hysteresis [A/m]
    calm_field: Scalar  # that of the core without [A/m]
    position: Scalar  # the gap [m]
    velocity: Scalar  # [m/s]


class Contact(NamedTuple):
    """Discrete states of the mover."""

    mode: Scalar  # 1: on the lower stop, 2: on none, 3: on the upper one
    sliding: Scalar  # direction of the motion, 0 at rest
    stop: Scalar  # the mode of the stop that it touched last, 2 if none
    impact: Scalar  # hardest on it since it came from elsewhere [m/s]


class Magnet(NamedTuple):
    """What the table says."""

    current: Scalar  # static [A]
    force: Scalar  # [N]
    slope: Scalar  # of the current by the flux linkage [1/H]
    energy: Scalar  # of the field [J]


class Magnetic(NamedTuple):
    """Static magnetomotive force of the core beyond the table [A], and how its fields change."""

    mmf: Scalar
    excess: Scalar  # M_an - M
    steepness: Scalar  # of M_an
    calm_steepness: Scalar


def device_of(par: Any, act: Actuator, map: Surface) -> Device:
    """Constants of a step of a plant with these parameters."""
    mass, is_elastic = act.mover.mass, par.stop_law > 0.5
    return Device(
        act=act,
        map=map,
        calm=act.core._replace(reversible_slope=act.core.slope, reversible=1.0, is_hysteretic=False),
        push=par.spring_preload + mass * par.gravity,
        friction=par.friction,
        is_table=par.spring_law > 0.5,
        spring_gap=par.spring_file_gap,
        spring_force=par.spring_file_force,
        spring_integral=par.spring_file_integral,
        is_elastic=is_elastic,
        stiffness=where(is_elastic, par.stop_stiffness, 0.0),
        damping=par.stop_damping,
        stop_need=sqrt(par.stop_stiffness / mass) / STOP_FINENESS,
    )


def micro_step(
    dev: Device, left: Scalar, at: Continuous, contact: Contact, losses: Losses
) -> tuple[tuple[Scalar, Continuous, Contact, Losses], Scalar]:
    """One step of the loop; `left` is what is left of the communication step [s]."""
    act, patch = dev.act, patch_at(dev, at)
    electric = electric_at(dev, patch, at)
    # direction of the flux; 0 without hysteresis, where it is of no importance
    direction = where(act.core.is_hysteretic, where(electric.flux_rate < 0.0, -1.0, 1.0), 0.0)
    switches = Switches(direction, hysteresis.moving_walls(direction, electric.excess))
    dt = _limit_step(dev, next_part(left, act.micro_step), patch, switches.walls, electric, contact.mode, at)
    rates = partial(_rates, dev, patch, switches.walls, contact)
    dt, at, done, ends = rk4_until(rates, at, dt, partial(_margin, dev, patch, switches, contact))
    losses = add_integrals(losses, done)
    at, contact, lost = cond(ends, lambda: _switch_contact(dev, at, contact), lambda: (at, contact, 0.0))
    left = left - dt
    return (left, at, contact, losses._replace(heat=losses.heat + lost)), not_(left > 0.0)


def patch_at(dev: Device, at: Continuous) -> Patch:
    """The table around a state; it holds through a micro-step, since it goes on smoothly beyond its edges."""
    return surface_patch(at.position, fabs(dev.act.turns * at.flux), dev.map)


def magnet_at(dev: Device, patch: Patch, at: Continuous) -> Magnet:
    """Static current, force and energy of a state; the current is odd in the flux."""
    level = surface(at.position, fabs(dev.act.turns * at.flux), patch)
    return Magnet(where(at.flux < 0.0, -level.value, level.value), -level.tilt, level.slope, level.integral)


def electric_at(dev: Device, patch: Patch, at: Continuous) -> Electric:
    """Current by (7) and rate of the flux by (8), in a state."""
    return _electric(dev, magnet_at(dev, patch, at), _core(dev, at))


def _electric(dev: Device, magnet: Magnet, core: Magnetic) -> Electric:
    return make_electric(dev.act, dev.act.turns * magnet.current + core.mmf, core.excess, core.steepness)


def _core(dev: Device, at: Continuous) -> Magnetic:
    """The core with hysteresis, less that without, which is in the table."""
    core = dev.act.core

    def hysteretic() -> Magnetic:
        M = hysteresis.magnetization(at.flux, at.field, core)
        calm = hysteresis.magnetization(at.flux, at.calm_field, core)
        field = at.field - at.calm_field - core.coupling * (M - calm)
        M_an, steepness = hysteresis.anhysteretic(at.field, core)
        return Magnetic(field * core.length, M_an - M, steepness, hysteresis.anhysteretic(at.calm_field, core)[1])

    return cond(core.is_hysteretic, hysteretic, lambda: Magnetic(0.0, 0.0, 0.0, 0.0))


def core_energies(dev: Device, at: Continuous) -> tuple[Scalar, Scalar]:
    """Energy of the walls, and that stored in the core, the former included, beyond the table [J]."""

    def hysteretic() -> tuple[Scalar, Scalar]:
        stored, walls = hysteresis.energies(at.flux, at.field, dev.act.core)
        return walls, stored - hysteresis.energies(at.flux, at.calm_field, dev.calm)[0]

    return cond(dev.act.core.is_hysteretic, hysteretic, lambda: (0.0, 0.0))


def _limit_step(
    dev: Device, dt: Scalar, patch: Patch, walls: Scalar, electric: Electric, mode: Scalar, at: Continuous
) -> Scalar:
    """Limit the step `dt` where the flux, the field of the core or an elastic stop is fast."""
    act, magnet = dev.act, magnet_at(dev, patch, at)
    reluctance = square(act.turns) * magnet.slope
    chi = hysteresis.susceptibility(electric.excess, electric.steepness, walls, act.core)
    field_rate = hysteresis.field_rate(electric.flux_rate, chi, act.core)
    damped = dev.stiffness * dev.damping * _depth(dev, mode, at.position) / act.mover.mass
    magnetic = act.flux_need * reluctance + where(act.core.is_hysteretic, act.field_need, 0.0) * fabs(field_rate)
    is_stiff = dev.is_elastic & (mode != MOVING)
    stiffened = dev.stop_need * sqrt(1.0 + dev.damping * fabs(at.velocity))  # its force rises so much faster
    return shorten_step(act, dt, magnetic + where(is_stiff, stiffened + damped, 0.0))


def _rates(dev: Device, patch: Patch, walls: Scalar, contact: Contact, at: Continuous) -> tuple[Continuous, Losses]:
    """Rates of all states, and what is lost."""
    act, mover, v = dev.act, dev.act.mover, at.velocity
    magnet, core = magnet_at(dev, patch, at), _core(dev, at)
    magnetic, losses, _ = magnetic_rates(act, walls, _electric(dev, magnet, core))
    elastic, stop = _stop_forces(dev, contact.mode, at)
    drag = mover.damping * v + dev.friction * contact.sliding
    acceleration = (magnet.force + push(dev, at.position) + stop - drag) / mover.mass
    is_moving = contact.sliding != 0.0
    calm_rate = hysteresis.field_rate(magnetic.flux, act.core.slope * core.calm_steepness, act.core)
    change = Continuous(
        flux=magnetic.flux,
        field=where(act.core.is_hysteretic, magnetic.H_e, 0.0),
        calm_field=where(act.core.is_hysteretic, calm_rate, 0.0),
        position=where(is_moving, v, 0.0),
        velocity=where(is_moving, acceleration, 0.0),
    )
    return change, losses._replace(heat=losses.heat + where(is_moving, (drag - stop + elastic) * v, 0.0))


def push(dev: Device, h: Scalar) -> Scalar:
    """Force of spring, preload and gravity [N]."""
    return dev.push + cond(dev.is_table, lambda: _spring(dev, h)[0], lambda: motion.spring_force(h, dev.act.mover))


def _spring(dev: Device, h: Scalar) -> tuple[Scalar, Scalar]:
    """Force of a spring by table [N], and its energy above that at the first row [J]."""
    k = locate(dev.spring_gap, h)
    left, force = load(dev.spring_gap, k), load(dev.spring_force, k)
    slope = (load(dev.spring_force, k, 1) - force) / (load(dev.spring_gap, k, 1) - left)
    t = h - left
    return force + slope * t, -(load(dev.spring_integral, k) + t * (force + 0.5 * slope * t))


def _depth(dev: Device, mode: Scalar, h: Scalar) -> Scalar:
    """How far the mover has pushed an elastic stop back [m]; 0 on none."""
    mover = dev.act.mover
    return where(mode == CLOSED, mover.lower - h, where(mode == OPEN, h - mover.upper, 0.0))


def _stop_forces(dev: Device, mode: Scalar, at: Continuous) -> tuple[Scalar, Scalar]:
    """Force of an elastic stop, without and with what it loses [N]."""
    outward = mode - MOVING
    elastic = dev.stiffness * _depth(dev, mode, at.position)
    more = 1.0 + dev.damping * outward * at.velocity
    return -outward * elastic, -outward * elastic * where(more > 0.0, more, 0.0)


def sunk(dev: Device, mode: Scalar, h: Scalar) -> tuple[Scalar, Scalar]:
    """Mode of a mover that lies on a stop, and how far the force presses it into an elastic one [m]."""
    load = (mode - MOVING) * push(dev, h)
    depth = where(dev.is_elastic & (load > 0.0), load / where(dev.is_elastic, dev.stiffness, 1.0), 0.0)
    return where(dev.is_elastic & (depth == 0.0), MOVING, mode), depth


def mechanical_energy(dev: Device, mode: Scalar, at: Continuous) -> Scalar:
    """Energy of motion, spring, preload, height and elastic stops [J]."""
    h, mover = at.position, dev.act.mover
    spring = cond(dev.is_table, lambda: _spring(dev, h)[1], lambda: motion.elastic_energy(h, mover))
    stop = 0.5 * dev.stiffness * square(_depth(dev, mode, h))
    return motion.kinetic_energy(at.velocity, mover) + spring + stop - dev.push * h


def _net_force(dev: Device, at: Continuous, mode: Scalar) -> Scalar:
    """Force on the mover at rest, but for dry friction and hard stops [N]."""
    patch = patch_at(dev, at)
    return magnet_at(dev, patch, at).force + push(dev, at.position) + _stop_forces(dev, mode, at)[0]


def _hold(dev: Device, mode: Scalar, net_force: Scalar) -> Scalar:
    """By how much friction, and a hard stop, hold the mover at rest [N]; negative: they do not."""
    is_held = not_(dev.is_elastic) & (mode != MOVING)
    return dev.friction - where(is_held, motion.inward(mode, net_force), fabs(net_force))


def settle_contact(dev: Device, at: Continuous, contact: Contact) -> Contact:
    """Settle the contact of a mover whose speed is zero: at rest, or about to move."""
    net_force = _net_force(dev, at, contact.mode)
    is_released = _hold(dev, contact.mode, net_force) < 0.0
    leaves = is_released & not_(dev.is_elastic) & (contact.mode != MOVING)
    return Contact(
        mode=where(leaves, MOVING, contact.mode),
        sliding=where(is_released, where(net_force < 0.0, -1.0, 1.0), 0.0),
        stop=contact.stop,
        impact=where(leaves, 0.0, contact.impact),
    )


def _place(dev: Device, mode: Scalar, h: Scalar) -> Scalar:
    """Distance to the nearer stop, or depth in an elastic one [m]."""
    mover = dev.act.mover
    return where(mode == MOVING, least(h - mover.lower, mover.upper - h), _depth(dev, mode, h))


def _margin(dev: Device, patch: Patch, switches: Switches, contact: Contact, at: Continuous) -> Scalar:
    """Negative where the step must end."""
    core = dev.act.core

    def moving() -> Scalar:
        return least(_place(dev, contact.mode, at.position) / dev.act.stroke, contact.sliding * at.velocity)

    def resting() -> Scalar:
        force = magnet_at(dev, patch, at).force + push(dev, at.position)
        return _hold(dev, contact.mode, force + _stop_forces(dev, contact.mode, at)[0])

    mechanical = cond(contact.sliding != 0.0, moving, resting)
    return cond(
        core.is_hysteretic,
        lambda: least(mechanical, least(*switch(dev.act, switches, electric_at(dev, patch, at))) / SWITCH_SCALE),
        lambda: mechanical,
    )


def _switch_contact(dev: Device, at: Continuous, contact: Contact) -> tuple[Continuous, Contact, Scalar]:
    """Switch the contact where a step has ended: state, contact and loss [J]."""
    is_moving = contact.sliding != 0.0
    has_met = is_moving & (_place(dev, contact.mode, at.position) < 0.0)
    has_stopped = not_(is_moving) | (contact.sliding * at.velocity < 0.0)

    def come_to_rest() -> tuple[Continuous, Contact, Scalar]:
        still = at._replace(velocity=0.0)
        return still, settle_contact(dev, still, contact), motion.kinetic_energy(at.velocity, dev.act.mover)

    def met() -> tuple[Continuous, Contact, Scalar]:
        return cond(
            dev.is_elastic, lambda: (at, _touch_stop(dev, at, contact), 0.0), lambda: _land_on_stop(dev, at, contact)
        )

    return cond(has_met, met, lambda: cond(has_stopped, come_to_rest, lambda: (at, contact, 0.0)))


def _touch_stop(dev: Device, at: Continuous, contact: Contact) -> Contact:
    """Switch the contact where an elastic stop is met, or left."""
    return cond(contact.mode == MOVING, lambda: _hit(dev, at, contact), lambda: contact._replace(mode=MOVING))


def _land_on_stop(dev: Device, at: Continuous, contact: Contact) -> tuple[Continuous, Contact, Scalar]:
    """Land on a hard stop: the mover goes back with what is left of its speed, or stays."""
    mover, hit = dev.act.mover, _hit(dev, at, contact)
    back = motion.rebound(at.velocity, mover.restitution)
    there = at._replace(position=where(hit.mode == CLOSED, mover.lower, mover.upper), velocity=back)
    now = cond(
        back == 0.0,
        lambda: settle_contact(dev, there, hit)._replace(impact=hit.impact),
        lambda: hit._replace(mode=MOVING, sliding=where(back < 0.0, -1.0, 1.0)),
    )
    return there, now, motion.impact_loss(at.velocity, mover)


def _hit(dev: Device, at: Continuous, before: Contact) -> Contact:
    """Contact on the nearer stop, with the impact noted."""
    stop = where(at.position < 0.5 * (dev.act.mover.lower + dev.act.mover.upper), CLOSED, OPEN)
    hardest = motion.hardest(at.velocity, where(before.stop == stop, before.impact, 0.0))
    return Contact(mode=stop, sliding=before.sliding, stop=stop, impact=hardest)
