"""Reluctance actuator of another physics: hysteresis of play elements, two poles of eddy currents, the same mover.

No estimator is based on it, so it serves as a test of what was tuned on `reluctance_actuator`. The static magnetomotive
force is that of a fringing gap and of a core after Froehlich. The current has two more parts:

- three elements that follow the flux linkage up to a limit each (stop operators, the complements of plays): independent
  of the rate, with closed minor loops;
- two eddy currents, dj/dt = (g dlambda/dt - j) / tau: a fast and a slow pole.
"""

from __future__ import annotations

from functools import partial
from typing import Annotated, Any, NamedTuple

from gapsense.actuators import magnetics, motion, reluctance_actuator
from gapsense.actuators.magnetics import Circuit
from gapsense.actuators.motion import MOVING, Contact, Mover
from gapsense.kernels.integrate import equal_parts, least, next_part, rk4_until
from gapsense.kernels.interface import fixed, output, parameter, ports, same
from gapsense.kernels.layout import Array, Scalar, Vector, blank
from gapsense.kernels.linalg import total, vector
from gapsense.kernels.trace import clip, cond, loop, not_, square, where, where_each

MICRO_STEPS = 10_000_000  # at most, per communication step
FINENESS, REFINEMENT = 0.05, 256.0  # micro-step in time constants of the flux; it is shortened at most so many times
ELEMENTS = (1.0 / 3.0, 2.0 / 3.0, 1.0)  # limits of the elements, relative to the widest


# ports of `ReluctanceActuator`
KNOWN = same(reluctance_actuator.Parameters)
OUTPUT = same(reluctance_actuator.Outputs)
Inputs = magnetics.Inputs


@ports()
class Parameters(NamedTuple):
    """Coil, core with its losses, gap, and mover."""

    coil_resistance: Scalar = KNOWN
    coil_turns: Scalar = KNOWN
    core_reluctance: Scalar = fixed("1/H", "Reluctance of the core without flux", 2.01888e6, min=1e-9)
    core_saturation: Scalar = fixed("Wb", "Flux linkage of saturation", 24.71e-3, min=1e-12)
    hysteresis_amplitude: Scalar = parameter("A", "Current of all play elements at their limits", 15e-3, min=0.0)
    hysteresis_reach: Scalar = fixed("Wb", "Flux linkage from zero to the limit of the widest", 3e-3, min=1e-12)
    eddy_fast: Scalar = parameter("S", "Fast eddy current per rate of the flux linkage", 0.7e-3, min=0.0)
    eddy_fast_time: Scalar = fixed("s", "Its time constant", 50e-6, min=10e-6)
    eddy_slow: Scalar = parameter("S", "Slow eddy current per rate of the flux linkage", 0.5e-3, min=0.0)
    eddy_slow_time: Scalar = fixed("s", "Its time constant", 0.5e-3, min=10e-6)
    gap_slope: Scalar = KNOWN
    gap_fringing: Scalar = KNOWN
    gap_window: Scalar = KNOWN
    mover_mass: Scalar = KNOWN
    spring_stiffness: Scalar = KNOWN
    spring_rest: Scalar = KNOWN
    damping: Scalar = KNOWN
    stop_lower: Scalar = KNOWN
    stop_upper: Scalar = KNOWN
    stop_restitution: Scalar = KNOWN
    initial_position: Scalar = KNOWN
    micro_step: Scalar = fixed("s", "Longest step of the integrator", 5e-6, min=1e-7, max=10e-6, name="micro_step")


class Continuous(NamedTuple):
    """What is integrated."""

    flux_linkage: Scalar  # [Wb]
    fast: Scalar  # eddy current of the fast pole, seen from the coil [A]
    slow: Scalar  # [A]
    position: Scalar  # [m]
    velocity: Scalar  # [m/s]


class State(NamedTuple):
    """What is carried from step to step."""

    at: Continuous
    elements: Annotated[Array, Vector(3)]  # flux linkage by which each element is stretched [Wb]
    contact: Contact


@ports()
class Outputs(NamedTuple):
    """Values at the end of the step."""

    current: Scalar = OUTPUT
    position: Scalar = OUTPUT
    velocity: Scalar = OUTPUT
    flux_linkage: Scalar = OUTPUT
    force: Scalar = OUTPUT
    mode: Scalar = OUTPUT
    contact: Scalar = OUTPUT
    eddy_current: Scalar = output("A", "Part of the current that eddy currents need", nominal=1e-2)
    hysteresis_current: Scalar = output("A", "Part of the current that the play elements need", nominal=1e-2)
    impact_speed: Scalar = OUTPUT


class Actuator(NamedTuple):
    """Constants of a communication step."""

    par: Parameters
    voltage: Scalar
    circuit: Circuit
    mover: Mover
    micro_step: Scalar
    open_reluctance: Scalar  # of the largest gap [1/H]


def initial(inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """At rest without flux, inside the stops."""
    act = _actuator(inputs, par)
    h = clip(par.initial_position, par.stop_lower, par.stop_upper)
    mode = motion.leaving(motion.resting_mode(h, act.mover), motion.spring_force(h, act.mover))
    state = blank(State, at=blank(Continuous, position=h), contact=Contact(mode, 0.0))
    return state, _outputs(state, act)


def step(state: State, inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """One communication step of equal micro-steps, shortened where the core saturates and at contact and release."""
    act = _actuator(inputs, par)
    _, *new = loop(MICRO_STEPS, partial(_micro_step, act), (inputs.dt, *state))
    state = State(*new)
    return state, _outputs(state, act)


def _actuator(inputs: Inputs, par: Parameters) -> Actuator:
    circuit = Circuit(
        turns=par.coil_turns,
        unfringed=par.gap_slope,
        fringing=par.gap_fringing,
        window=par.gap_window,
        core_reluctance=par.core_reluctance,
        core_saturation=par.core_saturation,
    )
    mover = motion.mover_of(par)
    open_reluctance, _ = magnetics.gap_law(par.stop_upper, circuit)
    return Actuator(
        par=par,
        voltage=inputs.voltage,
        circuit=circuit,
        mover=mover,
        micro_step=equal_parts(inputs.dt, par.micro_step),
        open_reluctance=open_reluctance,
    )


def _micro_step(
    act: Actuator, left: Scalar, at: Continuous, elements: Array, contact: Contact
) -> tuple[tuple[Any, ...], Scalar]:
    """One step of the loop; `left` is what is left of the communication step [s]."""
    dt = _limit_step(act, next_part(left, act.micro_step), at.flux_linkage)
    rates, margin = partial(_rates, act, at.flux_linkage, elements, contact.mode), partial(_margin, act, contact.mode)
    dt, new, _, ends = rk4_until(rates, at, dt, margin)
    stretched = _stretch_elements(act, elements, new.flux_linkage - at.flux_linkage)
    new, contact = cond(ends, lambda: _switch_contact(act, new, contact), lambda: (new, contact))
    left = left - dt
    return (left, new, stretched, contact), not_(left > 0.0)


def _limit_step(act: Actuator, dt: Scalar, lam: Scalar) -> Scalar:
    """Limit the step `dt` where the core saturates, as in `solenoid_valve`."""
    core = magnetics.core_law(lam, act.circuit)
    steepness = act.open_reluctance + square(core) / act.par.core_reluctance
    fine = FINENESS * square(act.par.coil_turns) / (act.par.coil_resistance * steepness)
    finest = act.micro_step / REFINEMENT
    return least(dt, where(fine < finest, finest, fine))


def _rates(act: Actuator, start: Scalar, elements: Array, mode: Scalar, y: Continuous) -> tuple[Continuous, tuple[()]]:
    """Rates of all states; the elements have followed the flux linkage from the `start` of the micro-step."""
    par, mover = act.par, act.mover
    reluctance, slope = magnetics.gap_law(y.position, act.circuit)
    i = _current(act, y, reluctance, _stretch_elements(act, elements, y.flux_linkage - start))
    drive = act.voltage - par.coil_resistance * i
    force = magnetics.force(y.flux_linkage, slope, act.circuit) + motion.spring_force(y.position, mover)
    is_moving = mode == MOVING
    rates = Continuous(
        flux_linkage=drive,
        fast=(par.eddy_fast * drive - y.fast) / par.eddy_fast_time,
        slow=(par.eddy_slow * drive - y.slow) / par.eddy_slow_time,
        position=where(is_moving, y.velocity, 0.0),
        velocity=where(is_moving, (force - motion.drag(y.velocity, mover)) / mover.mass, 0.0),
    )
    return rates, ()


def _margin(act: Actuator, mode: Scalar, y: Continuous) -> Scalar:
    """Distance to the nearer stop in motion, the force that holds the mover at rest; negative where that ends."""
    clearance = least(y.position - act.mover.lower, act.mover.upper - y.position)
    return where(mode == MOVING, clearance, -motion.inward(mode, _net_force(act, y)))


def _switch_contact(act: Actuator, y: Continuous, contact: Contact) -> tuple[Continuous, Contact]:
    """Let the mover land, if it moved; release it, if it rested."""
    mover, is_moving = act.mover, contact.mode == MOVING
    is_below = y.position < 0.5 * (mover.lower + mover.upper)
    back = where(is_moving, motion.rebound(y.velocity, mover.restitution), 0.0)
    at = y._replace(position=where(is_below, mover.lower, mover.upper), velocity=back)
    landed = motion.land_mover(y.velocity, is_below, _net_force(act, at), contact, mover)
    free = motion.release_mover(True, contact)
    return at, where_each(is_moving, landed, free)


def _stretch_elements(act: Actuator, elements: Array, change: Scalar) -> Array:
    """Stretch the elements by a change of the flux linkage."""
    limits = [share * act.par.hysteresis_reach for share in ELEMENTS]
    return vector([clip(element + change, -limit, limit) for element, limit in zip(elements, limits)])


def _current(act: Actuator, y: Continuous, reluctance: Scalar, elements: Array) -> Scalar:
    """Current of the coil [A]."""
    core = magnetics.core_law(y.flux_linkage, act.circuit)
    static = magnetics.current(y.flux_linkage, reluctance + core, act.circuit)
    return static + _hysteresis(act, elements) + y.fast + y.slow


def _hysteresis(act: Actuator, elements: Array) -> Scalar:
    """Current of the stretched elements [A]."""
    weight = act.par.hysteresis_amplitude / (len(ELEMENTS) * act.par.hysteresis_reach)
    return weight * total(element / share for element, share in zip(elements, ELEMENTS))


def _net_force(act: Actuator, y: Continuous) -> Scalar:
    """Force on the mover at rest [N]."""
    _, slope = magnetics.gap_law(y.position, act.circuit)
    return magnetics.force(y.flux_linkage, slope, act.circuit) + motion.spring_force(y.position, act.mover)


def _outputs(state: State, act: Actuator) -> Outputs:
    at = state.at
    reluctance, slope = magnetics.gap_law(at.position, act.circuit)
    return Outputs(
        current=_current(act, at, reluctance, state.elements),
        position=at.position,
        velocity=at.velocity,
        flux_linkage=at.flux_linkage,
        force=magnetics.force(at.flux_linkage, slope, act.circuit),
        mode=state.contact.mode,
        contact=where(state.contact.mode == MOVING, 0.0, 1.0),
        eddy_current=at.fast + at.slow,
        hysteresis_current=_hysteresis(act, state.elements),
        impact_speed=state.contact.impact,
    )
