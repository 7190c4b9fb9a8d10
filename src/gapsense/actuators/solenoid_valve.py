"""Solenoid valve with magnetic saturation, the plant of [SEMERA] Section III-A.

Flux linkage, position and velocity are integrated in micro-steps; the current is an algebraic output.  Contact and
release are located inside the micro-step.  The voltage is held during the communication step.  `micro_step` must
resolve the motion (12.5 us are ample for a mover that travels for a millisecond); where the flux is faster, steps are
shortened by themselves.  Table lookups have kinks and limit the accuracy to about 1e-7 of the flux linkage. Their two
columns agree only as well as the table is fine, so the energy balance of a table closes no better than that.
"""

from __future__ import annotations

from functools import partial
from typing import Annotated, NamedTuple

from gapsense.actuators import magnetics, motion
from gapsense.actuators.magnetics import MU_0, Circuit, Gap
from gapsense.actuators.motion import MOVING, Contact, Mover
from gapsense.kernels.integrate import add_integrals, crossing, equal_parts, least, next_part, rk4, rk4_until
from gapsense.kernels.interface import COLUMN, choice, fixed, output, parameter, ports, table
from gapsense.kernels.layout import Array, Choice, Scalar, Table, blank
from gapsense.kernels.trace import clip, cond, loop, not_, sqrt, square, where

MICRO_STEPS = 10_000_000  # at most, per communication step
FINENESS = 0.025  # micro-step at most, in time constants of the flux: flux errors below 1e-9 where the core saturates
REFINEMENT = 256.0  # a micro-step is shortened at most so many times, enough for tenfold overvoltage
Inputs = magnetics.Inputs


class GapLaw(Choice):
    """Reluctance of the gap: linear, with fringing, or from a table."""

    linear, fringing, table = range(3)


@ports()
class Parameters(NamedTuple):
    """Table I, the other gap laws and the micro-step."""

    coil_resistance: Scalar = parameter("Ohm", "Resistance r", 76.0, min=1e-9)
    coil_turns: Scalar = fixed("1", "Number of turns N", 1200.0, min=1e-9)
    gap_law: Annotated[Scalar, GapLaw] = choice("Reluctance of the gap")
    gap_slope: Scalar = fixed("1/(H.m)", "Linear law: reluctance per gap, k_air", 2.7e10, min=0.0)
    gap_area: Scalar = fixed("m2", "Fringing law: pole area A", 1.75e-5, min=1e-12)
    gap_window: Scalar = fixed("m", "Fringing law: height of the winding window G", 10e-3, min=1e-9)
    gap_file_gap: Annotated[Array, Table()] = table(
        "Table: CSV file with the columns gap [m], reluctance [1/H], slope [1/(H.m)]",
        ("gap [m]", "reluctance [1/H]", "slope [1/(H.m)]"),
        "fringing_19.csv",
    )
    gap_file_reluctance: Annotated[Array, Table()] = COLUMN
    gap_file_slope: Annotated[Array, Table()] = COLUMN
    core_reluctance: Scalar = fixed("1/H", "Reluctance of the core without flux, R_iron0", 3.25e6, min=1e-9)
    core_saturation: Scalar = fixed("Wb", "Flux linkage of saturation, lambda_sat", 0.024, min=1e-12)
    mover_mass: Scalar = fixed("kg", "Mass of the mover m", 1.6e-3, min=1e-9)
    spring_stiffness: Scalar = parameter("N/m", "Stiffness k_s", 37.0, min=0.0)
    spring_rest: Scalar = parameter("m", "Gap without spring force, h_s", 22.5e-3)
    damping: Scalar = parameter("N.s/m", "Viscous damping c", 0.4, min=0.0)
    stop_lower: Scalar = fixed("m", "Smallest gap h_min", 0.0, min=0.0)
    stop_upper: Scalar = fixed("m", "Largest gap h_max", 0.9e-3, min=1e-9)
    stop_restitution: Scalar = fixed("1", "Speed after an impact over that before it", 0.0, min=0.0, max=0.95)
    initial_position: Scalar = fixed("m", "Gap at the start", 0.9e-3, min=0.0)
    micro_step: Scalar = fixed("s", "Longest step of the integrator", 12.5e-6, min=1e-7, name="micro_step")


class State(NamedTuple):
    """What is carried from step to step."""

    flux_linkage: Scalar  # lambda [Wb]
    position: Scalar  # h, the gap [m]
    velocity: Scalar  # [m/s]
    mode: Scalar  # 1: smallest gap, 2: moving, 3: largest gap
    dissipated_energy: Scalar  # copper, damping and impacts, since the start [J]
    supplied_energy: Scalar  # integral of u i since the start [J]
    impact_speed: Scalar  # of the hardest impact since the mover last left its rest [m/s]


@ports()
class Outputs(NamedTuple):
    """Values at the end of the step."""

    current: Scalar = output("A", "Coil current", nominal=0.4)
    position: Scalar = output("m", "Gap: 0 is closed", nominal=1e-3)
    velocity: Scalar = output("m/s", "Rate of the gap", nominal=0.5)
    flux_linkage: Scalar = output("Wb", "Flux linkage", nominal=0.02)
    inductance: Scalar = output("H", "Apparent inductance, flux linkage / current", nominal=0.1)
    force: Scalar = output("N", "Magnetic force; negative: it closes the gap")
    mode: Scalar = output("1", "1: at the lower stop, 2: moving, 3: at the upper stop", min=1.0, max=3.0)
    contact: Scalar = output("1", "1 on a stop, else 0", min=0.0, max=1.0)
    dissipated_energy: Scalar = output(
        "J", "Lost in the coil, the damping and the impacts since the start", nominal=0.1
    )
    stored_energy: Scalar = output("J", "Magnetic, elastic and kinetic energy", nominal=10e-3)
    supplied_energy: Scalar = output("J", "Integral of voltage times current since the start", nominal=0.1)
    impact_speed: Scalar = output("m/s", "Hardest impact since the mover last left its rest", nominal=0.5)


def initial(inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """At rest without flux, inside the stops."""
    valve = _valve(inputs, par)
    h = clip(par.initial_position, par.stop_lower, par.stop_upper)
    mode = motion.leaving(motion.resting_mode(h, valve.mover), motion.spring_force(h, valve.mover))
    state = blank(State, position=h, mode=mode)
    return state, _outputs(state, valve, gap_at(valve, h))


def step(state: State, inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """One communication step of equal micro-steps, shortened where the mover meets or leaves a stop.

    A step of no length changes nothing.
    """
    valve = _valve(inputs, par)
    at, sums = Moving(state.flux_linkage, state.position, state.velocity), Sums(state.dissipated_energy, 0.0)
    start = (
        Rest(inputs.dt, float(MICRO_STEPS)),
        at,
        gap_at(valve, at.h),
        Contact(state.mode, state.impact_speed),
        sums,
    )
    _, at, gap, contact, sums = loop(MICRO_STEPS, partial(micro_step, valve), start)
    state = State(
        flux_linkage=at.lam,
        position=at.h,
        velocity=at.v,
        mode=contact.mode,
        dissipated_energy=sums.losses,
        supplied_energy=state.supplied_energy + inputs.voltage * sums.charge,
        impact_speed=contact.impact,
    )
    return state, _outputs(state, valve, gap)


def _valve(inputs: Inputs, par: Parameters) -> Valve:
    circuit = Circuit(
        turns=par.coil_turns,
        is_table=par.gap_law == GapLaw.table,
        is_fringing=par.gap_law == GapLaw.fringing,
        slope=par.gap_slope,
        unfringed=1.0 / (MU_0 * par.gap_area),
        fringing=1.0 / sqrt(par.gap_area),
        window=2.0 * par.gap_window,
        table_gap=par.gap_file_gap,
        table_reluctance=par.gap_file_reluctance,
        table_slope=par.gap_file_slope,
        core_reluctance=par.core_reluctance,
        core_saturation=par.core_saturation,
    )
    open_reluctance, _ = magnetics.gap_law(par.stop_upper, circuit)
    micro_step = equal_parts(inputs.dt, par.micro_step)
    return Valve(
        resistance=par.coil_resistance,
        voltage=inputs.voltage,
        circuit=circuit,
        mover=motion.mover_of(par),
        micro_step=micro_step,
        finest=micro_step / REFINEMENT,
        open_square=open_reluctance * par.core_reluctance,
        rate_scale=par.core_reluctance * square(par.coil_turns),
    )


def _outputs(state: State, valve: Valve, gap: Gap) -> Outputs:
    lam, h = state.flux_linkage, state.position
    c, mover = valve.circuit, valve.mover
    R = gap.reluctance + magnetics.core_law(lam, c)
    mechanical = motion.elastic_energy(h, mover) + motion.kinetic_energy(state.velocity, mover)
    return Outputs(
        current=magnetics.current(lam, R, c),
        position=h,
        velocity=state.velocity,
        flux_linkage=lam,
        inductance=square(c.turns) / R,
        force=magnetics.force(lam, gap.slope, c),
        mode=state.mode,
        contact=where(state.mode == MOVING, 0.0, 1.0),
        dissipated_energy=state.dissipated_energy,
        stored_energy=magnetics.energy(lam, gap.reluctance, c) + mechanical,
        supplied_energy=state.supplied_energy,
        impact_speed=state.impact_speed,
    )


# One micro-step: flux and motion, up to the next contact or release.


class Valve(NamedTuple):
    """Constants of a step."""

    resistance: Scalar
    voltage: Scalar
    circuit: Circuit
    mover: Mover
    micro_step: Scalar  # length of the equal micro-steps [s]
    finest: Scalar  # shortest one that the limit asks for [s]
    open_square: Scalar  # R_open R_iron0, the share of the largest gap in the rate of the flux [1/H^2]
    rate_scale: Scalar  # N^2 R_iron0 [1/H]


class Moving(NamedTuple):
    """What is integrated while the mover moves; at rest it is the flux linkage alone."""

    lam: Scalar
    h: Scalar
    v: Scalar


class Sums(NamedTuple):
    """Integrals: losses [J] and charge [A s]."""

    losses: Scalar
    charge: Scalar


class Step(NamedTuple):
    """Length of a micro-step, what is at its end, and what it adds to the sums."""

    length: Scalar
    at: Moving
    contact: Contact
    part: Sums


class Limit(NamedTuple):
    """Of the length of a micro-step, at some flux."""

    rate: Scalar  # of the flux, in units of `rate_scale` / N^2 s^-1
    longest: Scalar  # where the rate asks for a limit [s]


class Rest(NamedTuple):
    """What is left of the communication step."""

    time: Scalar  # [s]
    steps: Scalar  # how many micro-steps it may still take


def micro_step(
    valve: Valve, left: Rest, at: Moving, gap: Gap, contact: Contact, sums: Sums
) -> tuple[tuple[Rest, Moving, Gap, Contact, Sums], Scalar]:
    """One micro-step, or all that follow if they are equal."""
    limit, is_moving = _limit(valve, at.lam), contact.mode == MOVING
    dt = _limit_step(valve, left.time, limit)

    def move() -> tuple[Step, Gap]:
        done = _move(valve, gap, dt, at, contact, is_moving)
        return done, gap_at(valve, done.at.h)

    done, gap = cond(is_moving, move, lambda: (_rest(valve, gap, dt, at, contact), gap))
    left, sums = _less(left, done), add_integrals(sums, done.part)
    is_settled = not_(is_moving) & (done.at.lam == at.lam) & (done.contact.mode == contact.mode)
    left, sums = cond(is_settled, lambda: _repeat_steps(valve, limit, done, left, sums), lambda: (left, sums))
    return (left, done.at, gap, done.contact, sums), not_(_goes_on(left))


def _repeat_steps(valve: Valve, limit: Limit, done: Step, left: Rest, sums: Sums) -> tuple[Rest, Sums]:
    """Repeat a micro-step of equal length, for each does the same once the flux has settled; time left and sums."""

    def is_equal(left: Rest) -> Scalar:
        return _goes_on(left) & (_limit_step(valve, left.time, limit) == done.length)

    def again(left: Rest, sums: Sums) -> tuple[tuple[Rest, Sums], Scalar]:
        left = _less(left, done)
        return (left, add_integrals(sums, done.part)), not_(is_equal(left))

    return cond(is_equal(left), lambda: loop(MICRO_STEPS, again, (left, sums)), lambda: (left, sums))


def _less(left: Rest, done: Step) -> Rest:
    return Rest(left.time - done.length, left.steps - 1.0)


def _goes_on(left: Rest) -> Scalar:
    return (left.time > 0.0) & (left.steps > 0.0)


def gap_at(valve: Valve, h: Scalar) -> Gap:
    """The gap of length `h`."""
    return Gap(*magnetics.gap_law(h, valve.circuit))


def _limit(valve: Valve, lam: Scalar) -> Limit:
    """Limit of a micro-step where the core saturates.

    By (51) with (50) the rate of the flux is r/N^2 (R_air + R_iron^2 / R_iron0) [1/s]. It grows a hundredfold in
    saturation, where the explicit method would lose its accuracy and, farther on, its stability. Beyond the limit of
    shortening, the core has a constant reluctance above 0.999 of saturation, which bounds the flux.
    """
    rate = valve.resistance * (valve.open_square + square(magnetics.core_law(lam, valve.circuit)))  # times the scale
    fine = FINENESS * valve.rate_scale / rate
    return Limit(rate, where(fine < valve.finest, valve.finest, fine))


def _limit_step(valve: Valve, left: Scalar, limit: Limit) -> Scalar:
    """Limit the next part of what is left of a step."""
    dt = next_part(left, valve.micro_step)
    return where(limit.rate * dt > FINENESS * valve.rate_scale, least(dt, limit.longest), dt)


def _move(valve: Valve, gap: Gap, dt: Scalar, at: Moving, contact: Contact, is_moving: Scalar) -> Step:
    """Step of the moving mover, up to the contact if there is one."""
    mover, first = valve.mover, _rates_in(gap, valve, at)
    after = partial(rk4, partial(_moving_rates, valve), at, first=first)
    y, sums = after(dt)
    is_below = y.h < mover.lower

    def land() -> Step:
        def distance(length: Scalar) -> Scalar:
            return motion.clearance(after(length)[0].h, is_below, mover)

        ends = (motion.clearance(at.h, is_below, mover), motion.clearance(y.h, is_below, mover))
        length = crossing(distance, dt, *ends)
        then, sums = after(length)
        stop = where(is_below, mover.lower, mover.upper)
        now = motion.land_mover(then.v, is_below, _net_force(valve, then.lam, stop), contact, mover)
        losses = sums.losses + motion.impact_loss(then.v, mover)
        return Step(
            length, Moving(then.lam, stop, motion.rebound(then.v, mover.restitution)), now, Sums(losses, sums.charge)
        )

    # `is_moving` spares many runs at once the search for a contact in those that rest: they compute both branches
    return cond(is_moving & (is_below | (y.h > mover.upper)), land, lambda: Step(dt, y, contact, sums))


def _rest(valve: Valve, gap: Gap, dt: Scalar, at: Moving, contact: Contact) -> Step:
    """Step on a stop, of the flux only, up to the release if there is one."""
    spring = motion.spring_force(at.h, valve.mover)

    def margin(y: tuple[Scalar]) -> Scalar:
        return -motion.inward(contact.mode, magnetics.force(y[0], gap.slope, valve.circuit) + spring)

    rate = partial(_resting_rates, valve, gap.reluctance)
    dt, (lam,), sums, is_released = rk4_until(rate, (at.lam,), dt, margin)
    return Step(dt, Moving(lam, at.h, 0.0), motion.release_mover(is_released, contact), sums)


def _moving_rates(valve: Valve, y: Moving) -> tuple[Moving, Sums]:
    return _rates_in(gap_at(valve, y.h), valve, y)


def _rates_in(gap: Gap, valve: Valve, y: Moving) -> tuple[Moving, Sums]:
    """(51) and (52); integrands: losses in copper and damper [W], and the current [A]."""
    c, mover = valve.circuit, valve.mover
    i = magnetics.current(y.lam, gap.reluctance + magnetics.core_law(y.lam, c), c)
    drop = valve.resistance * i
    drag = mover.damping * y.v
    acceleration = (magnetics.force(y.lam, gap.slope, c) + motion.spring_force(y.h, mover) - drag) / mover.mass
    return Moving(valve.voltage - drop, y.v, acceleration), Sums(drop * i + drag * y.v, i)


def _resting_rates(valve: Valve, gap_reluctance: Scalar, y: tuple[Scalar]) -> tuple[tuple[Scalar], Sums]:
    """(51) at a fixed gap; integrands as above."""
    c = valve.circuit
    i = magnetics.current(y[0], gap_reluctance + magnetics.core_law(y[0], c), c)
    drop = valve.resistance * i
    return (valve.voltage - drop,), Sums(drop * i, i)


def _net_force(valve: Valve, lam: Scalar, h: Scalar) -> Scalar:
    """Force on the mover at rest [N], (52)."""
    return magnetics.force(lam, gap_at(valve, h).slope, valve.circuit) + motion.spring_force(h, valve.mover)
