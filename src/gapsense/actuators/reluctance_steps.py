"""One micro-step of the reluctance actuator: flux, field and motion, up to the next switch of mode or walls."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

from gapsense.actuators import hysteresis, magnetics, motion
from gapsense.actuators.hysteresis import Core
from gapsense.actuators.magnetics import Gap, LocalGap, SmoothGap
from gapsense.actuators.motion import MOVING, Contact, Mover
from gapsense.kernels.integrate import add_integrals, least, next_part, rk4_until
from gapsense.kernels.layout import Scalar
from gapsense.kernels.trace import cond, fabs, not_, where

REFINEMENT = 256.0  # a micro-step is shortened at most so many times
UNSEEN = 1e-10  # flux, magnetization (in those of saturation) and gap (in strokes) by which a switch may come late


class Actuator(NamedTuple):
    """Constants of a step."""

    voltage: Scalar
    resistance: Scalar
    turns: Scalar
    eddy: Scalar  # k_eddy [S]
    per_mmf: Scalar  # current by magnetomotive force in (7) [1]
    bias: Scalar  # current by the voltage in (7) [A]
    gap: SmoothGap
    core: Core
    mover: Mover
    micro_step: Scalar  # length of the equal micro-steps [s]
    flux_need: Scalar  # steps per second for a reluctance of one, by FLUX_FINENESS [H/s]
    field_need: Scalar  # steps for a change of the field by one, by FIELD_FINENESS [m/A]
    flux_weight: Scalar  # flux of a micro-step in units of the saturated one, per rate [s/Wb]
    excess_weight: Scalar  # 1/M_sat [m/A]
    stroke: Scalar  # [m]


class Electric(NamedTuple):
    """Current, and what drives flux and field."""

    current: Scalar
    flux_rate: Scalar
    excess: Scalar  # M_an - M
    steepness: Scalar  # of M_an


class Circuit(NamedTuple):
    """The magnetic circuit at one instant."""

    gap: Gap
    electric: Electric


class Resting(NamedTuple):
    """What is integrated on a stop."""

    flux: Scalar
    H_e: Scalar


class Moving(NamedTuple):
    """What is integrated while the mover moves."""

    flux: Scalar
    H_e: Scalar
    h: Scalar
    v: Scalar


class Losses(NamedTuple):
    """Integrals."""

    heat: Scalar  # copper, damping and impacts [J]
    eddy: Scalar  # by k_eddy
    work: Scalar  # on the walls, by volume


class Switches(NamedTuple):
    """Direction of the flux, and that of the walls, 0 while they are frozen."""

    direction: Scalar
    walls: Scalar


class Step(NamedTuple):
    """Length of a micro-step, and what is at its end."""

    length: Scalar
    at: Moving
    contact: Contact
    losses: Losses


def micro_step(
    act: Actuator, left: Scalar, at: Moving, gap: Gap, contact: Contact, losses: Losses
) -> tuple[tuple[Scalar, Moving, Gap, Contact, Losses], Scalar]:
    """One step of the loop; `left` is what is left of the communication step [s]."""
    circuit = circuit_at(act, gap, at.flux, at.H_e)
    # direction of the flux; 0 without hysteresis, where it is of no importance
    direction = where(act.core.is_hysteretic, where(circuit.electric.flux_rate < 0.0, -1.0, 1.0), 0.0)
    switches = Switches(direction, hysteresis.moving_walls(direction, circuit.electric.excess))
    dt = _limit_step(act, next_part(left, act.micro_step), circuit, switches.walls)
    is_moving = contact.mode == MOVING

    def move() -> tuple[Step, Gap]:
        done = _move(act, circuit, switches, dt, at, contact, is_moving)
        return done, gap_at(act, done.at.h)

    done, gap = cond(is_moving, move, lambda: (_rest(act, circuit, switches, dt, at, contact), gap))
    left = left - done.length
    return (left, done.at, gap, done.contact, add_integrals(losses, done.losses)), not_(left > 0.0)


def gap_at(act: Actuator, h: Scalar) -> Gap:
    """The gap of length `h`."""
    return Gap(*magnetics.smooth_gap_law(h, act.gap)[:2])


def circuit_at(act: Actuator, gap: Gap, flux: Scalar, H_e: Scalar) -> Circuit:
    """The magnetic circuit and what drives it, in a state."""
    return Circuit(gap, _electric(act, flux, H_e, gap.reluctance))


def _electric(act: Actuator, flux: Scalar, H_e: Scalar, reluctance: Scalar) -> Electric:
    core = act.core
    M = hysteresis.magnetization(flux, H_e, core)
    mmf = reluctance * flux + (H_e - core.coupling * M) * core.length
    M_an, steepness = hysteresis.anhysteretic(H_e, core)
    return make_electric(act, mmf, M_an - M, steepness)


def make_electric(act: Actuator, mmf: Scalar, excess: Scalar, steepness: Scalar) -> Electric:
    """Compute the current by (7) and the rate of the flux by (8), from the static magnetomotive force [A]."""
    i = act.per_mmf * mmf + act.bias
    return Electric(i, (act.voltage - act.resistance * i) / act.turns, excess, steepness)


def _limit_step(act: Actuator, dt: Scalar, circuit: Circuit, walls: Scalar) -> Scalar:
    """Limit the step `dt` where the core saturates: there the flux settles fast and the field runs away."""
    chi = hysteresis.susceptibility(circuit.electric.excess, circuit.electric.steepness, walls, act.core)
    reluctance = circuit.gap.reluctance + hysteresis.differential_reluctance(chi, act.core)
    field_rate = hysteresis.field_rate(circuit.electric.flux_rate, chi, act.core)
    return shorten_step(act, dt, act.flux_need * reluctance + act.field_need * fabs(field_rate))


def shorten_step(act: Actuator, dt: Scalar, need: Scalar) -> Scalar:
    """Shorten the step `dt` where more steps per second are needed."""

    def shorten() -> Scalar:
        fine, finest = 1.0 / need, act.micro_step / REFINEMENT
        longest = where(fine < finest, finest, fine)
        return where(dt < longest, dt, longest)

    return cond(need * dt > 1.0, shorten, lambda: dt)


def magnetic_rates(act: Actuator, walls: Scalar, electric: Electric) -> tuple[Resting, Losses, Electric]:
    """Rates of flux (8) and effective field (10); losses; and what a switch of the walls shows in."""
    i, rate, excess, steepness = electric
    field_rate = hysteresis.field_rate(rate, hysteresis.susceptibility(excess, steepness, walls, act.core), act.core)
    losses = Losses(heat=act.resistance * (i * i), eddy=rate * rate, work=excess * field_rate)
    return Resting(rate, field_rate), losses, electric


def _moving_rates(act: Actuator, law: LocalGap, walls: Scalar, y: Moving) -> tuple[Moving, Losses, Electric]:
    gap = Gap(*magnetics.local_gap_law(y.h, law)[:2])
    return _rates_from(act, walls, y, circuit_at(act, gap, y.flux, y.H_e))


def _rates_from(act: Actuator, walls: Scalar, y: Moving, circuit: Circuit) -> tuple[Moving, Losses, Electric]:
    """As `magnetic_rates`, with velocity and acceleration (11), and with what drag loses."""
    rates, losses, watched = magnetic_rates(act, walls, circuit.electric)
    drag = motion.drag(y.v, act.mover)
    net_force = magnetics.flux_force(y.flux, circuit.gap.slope) + motion.spring_force(y.h, act.mover) - drag
    change = Moving(rates.flux, rates.H_e, y.v, net_force / act.mover.mass)
    return change, losses._replace(heat=losses.heat + drag * y.v), watched


def _resting_rates(act: Actuator, walls: Scalar, reluctance: Scalar, y: Resting) -> tuple[Resting, Losses, Electric]:
    return magnetic_rates(act, walls, _electric(act, y.flux, y.H_e, reluctance))


def switch(act: Actuator, switches: Switches, watched: Electric) -> tuple[Scalar, Scalar]:
    """Margins, negative once the flux turns round and once frozen walls start to move; 1 if they cannot."""
    direction, walls = switches
    turning = where(act.core.is_hysteretic, UNSEEN + direction * watched.flux_rate * act.flux_weight, 1.0)
    thawing = where(walls == direction, 1.0, UNSEEN - direction * watched.excess * act.excess_weight)
    return turning, thawing


def _move(
    act: Actuator, circuit: Circuit, switches: Switches, dt: Scalar, at: Moving, contact: Contact, is_moving: Scalar
) -> Step:
    """Step of the moving mover, up to the first contact or switch if there is one."""
    mover = act.mover
    first = _rates_from(act, switches.walls, at, circuit)
    rates = partial(_moving_rates, act, magnetics.gap_near(at.h, act.gap), switches.walls)

    def margin(y: Moving, watched: Electric) -> Scalar:
        clearance = least(y.h - mover.lower, mover.upper - y.h) / act.stroke
        return least(clearance, least(*switch(act, switches, watched)))

    dt, y, losses, ends = rk4_until(rates, at, dt, margin, is_moving, first)
    done = Step(dt, y, contact, losses)
    return cond(ends, lambda: _stop_mover(act, done), lambda: done)


def _stop_mover(act: Actuator, done: Step) -> Step:
    """End the step where the mover has met a stop."""
    mover, at = act.mover, done.at
    is_below = at.h < mover.lower
    stop = where(is_below, mover.lower, mover.upper)

    def land() -> Step:
        contact = motion.land_mover(at.v, is_below, _net_force(act, at.flux, stop), done.contact, mover)
        losses = done.losses._replace(heat=done.losses.heat + motion.impact_loss(at.v, mover))
        return Step(done.length, at._replace(h=stop, v=motion.rebound(at.v, mover.restitution)), contact, losses)

    return cond(is_below | (at.h > mover.upper), land, lambda: done)


def _rest(act: Actuator, circuit: Circuit, switches: Switches, dt: Scalar, at: Moving, contact: Contact) -> Step:
    """Step on a stop, of the core only, up to the first release or switch if there is one."""
    spring, start = motion.spring_force(at.h, act.mover), Resting(at.flux, at.H_e)
    first = magnetic_rates(act, switches.walls, circuit.electric)
    rates = partial(_resting_rates, act, switches.walls, circuit.gap.reluctance)

    def hold(flux: Scalar) -> Scalar:
        return act.mover.friction - motion.inward(contact.mode, magnetics.flux_force(flux, circuit.gap.slope) + spring)

    def margin(y: Resting, watched: Electric) -> Scalar:
        return least(hold(y.flux), least(*switch(act, switches, watched)))

    dt, (flux, H_e), losses, _ = rk4_until(rates, start, dt, margin, first=first)
    return Step(dt, Moving(flux, H_e, at.h, 0.0), motion.release_mover(hold(flux) < 0.0, contact), losses)


def _net_force(act: Actuator, flux: Scalar, h: Scalar) -> Scalar:
    """Force on the mover at rest [N], (11)."""
    _, slope, _ = magnetics.smooth_gap_law(h, act.gap)
    return magnetics.flux_force(flux, slope) + motion.spring_force(h, act.mover)
