"""Solenoid valve with magnetic saturation, the plant of [SEMERA] Section III-A.

Flux linkage, position and velocity are integrated in micro-steps; the current is an algebraic output.  Contact and
release are located inside the micro-step.  The voltage is held during the communication step.  `micro_step` must
resolve the motion (12.5 us are ample for a mover that travels for a millisecond); where the flux is faster, steps are
shortened by themselves.  Table lookups have kinks and limit the accuracy to about 1e-7 of the flux linkage, and their
two columns agree only as well as the table is fine: the energy balance of a table closes no better than that.
"""

from __future__ import annotations

from functools import partial
from typing import Annotated, NamedTuple

from gapsense.actuators import magnetics, motion
from gapsense.actuators.magnetics import MU_0, Circuit
from gapsense.actuators.motion import CLOSED, MOVING, OPEN, Mover
from gapsense.integrate import crossing, equal_parts, next_part, rk4, rk4_until
from gapsense.records import Array, Choice, Scalar, Table
from gapsense.trace import clip, cond, loop, not_, sqrt, square, where

MICRO_STEPS = 10_000_000  # at most, per communication step
FINENESS = 0.025  # micro-step at most, in time constants of the flux: flux errors below 1e-9 where the core saturates
REFINEMENT = 256.0  # a micro-step is shortened at most so many times, enough for tenfold overvoltage


class GapLaw(Choice):
    """Reluctance of the gap: linear, with fringing, or from a table."""

    linear, fringing, table = range(3)


class Parameters(NamedTuple):
    """Table I, the other gap laws and the micro-step."""

    coil_resistance: Scalar  # r [ohm]
    coil_turns: Scalar  # N [1]
    gap_law: Annotated[Scalar, GapLaw]
    gap_slope: Scalar  # k_air, linear law [1/(H m)]
    gap_area: Scalar  # A, fringing law [m^2]
    gap_window: Scalar  # G, fringing law [m]
    gap_file_gap: Annotated[Array, Table()]  # increasing, at least two [m]
    gap_file_reluctance: Annotated[Array, Table()]  # [1/H]
    gap_file_slope: Annotated[Array, Table()]  # its derivative by the gap [1/(H m)]
    core_reluctance: Scalar  # R_iron0 [1/H]
    core_saturation: Scalar  # lambda_sat [Wb]
    mover_mass: Scalar  # m [kg]
    spring_stiffness: Scalar  # k_s [N/m]
    spring_rest: Scalar  # h_s [m]
    damping: Scalar  # c [N s/m]
    stop_lower: Scalar  # h_min [m]
    stop_upper: Scalar  # h_max [m]
    initial_position: Scalar  # [m]
    micro_step: Scalar  # longest step of the integrator [s]


class State(NamedTuple):
    """What is carried from step to step."""

    flux_linkage: Scalar  # lambda [Wb]
    position: Scalar  # h, the gap [m]
    velocity: Scalar  # [m/s]
    mode: Scalar  # 1: smallest gap, 2: moving, 3: largest gap
    dissipated_energy: Scalar  # copper, damping and impacts, since the start [J]
    supplied_energy: Scalar  # integral of u i since the start [J]


class Inputs(NamedTuple):
    """Voltage, and the communication step that ends at `time`."""

    time: Scalar  # [s]
    dt: Scalar  # [s]
    voltage: Scalar  # u, held during the step [V]


class Outputs(NamedTuple):
    """Values at the end of the step."""

    current: Scalar
    position: Scalar
    velocity: Scalar
    flux_linkage: Scalar
    inductance: Scalar  # apparent, lambda / i = N^2 / R
    force: Scalar  # magnetic, negative: it closes the gap
    mode: Scalar
    contact: Scalar  # 1 on a stop, else 0
    dissipated_energy: Scalar
    stored_energy: Scalar  # magnetic, elastic and kinetic
    supplied_energy: Scalar


class Valve(NamedTuple):
    """Constants of a step."""

    resistance: Scalar
    voltage: Scalar
    circuit: Circuit
    mover: Mover
    micro_step: Scalar  # length of the equal micro-steps [s]
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


class Settled(NamedTuple):
    """A micro-step at rest that left the flux as it was: one more of that length from there does exactly the same."""

    dt: Scalar  # 0 if there was none just before
    part: Sums  # what it added to the sums


def initial(inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """At rest without flux, inside the stops."""
    valve = _valve(inputs, par)
    h = clip(par.initial_position, par.stop_lower, par.stop_upper)
    mode = motion.leaving(motion.resting_mode(h, valve.mover), motion.spring_force(h, valve.mover))
    state = State(0.0, h, 0.0, mode, 0.0, 0.0)
    return state, _outputs(state, valve)


def step(state: State, inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """One communication step of equal micro-steps, shortened where the mover meets or leaves a stop.

    A step of no length changes nothing.
    """
    valve = _valve(inputs, par)
    at, sums = Moving(state.flux_linkage, state.position, state.velocity), Sums(state.dissipated_energy, 0.0)
    start = (inputs.dt, at, state.mode, sums, Settled(0.0, Sums(0.0, 0.0)))
    _, at, mode, sums, _ = loop(MICRO_STEPS, partial(_micro_step, valve), start)
    state = State(
        flux_linkage=at.lam,
        position=at.h,
        velocity=at.v,
        mode=mode,
        dissipated_energy=sums.losses,
        supplied_energy=state.supplied_energy + inputs.voltage * sums.charge,
    )
    return state, _outputs(state, valve)


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
    mover = Mover(par.mover_mass, par.spring_stiffness, par.spring_rest, par.damping, par.stop_lower, par.stop_upper)
    open_reluctance, _ = magnetics.gap_law(par.stop_upper, circuit)
    return Valve(
        resistance=par.coil_resistance,
        voltage=inputs.voltage,
        circuit=circuit,
        mover=mover,
        micro_step=equal_parts(inputs.dt, par.micro_step),
        open_square=open_reluctance * par.core_reluctance,
        rate_scale=par.core_reluctance * square(par.coil_turns),
    )


def _micro_step(
    valve: Valve, left: Scalar, at: Moving, mode: Scalar, sums: Sums, settled: Settled
) -> tuple[tuple[Scalar, Moving, Scalar, Sums, Settled], Scalar]:
    """One step of the loop; `left` is what is left of the communication step [s]."""
    dt = _limited(valve, next_part(left, valve.micro_step), at.lam)
    is_moving = mode == MOVING

    def anew() -> tuple[Scalar, Moving, Scalar, Sums, Settled]:
        length, then, mode_then, part = cond(
            is_moving, lambda: _move(valve, dt, at, is_moving), lambda: _rest(valve, dt, at, mode)
        )
        is_settled = not_(is_moving) & (then.lam == at.lam) & (mode_then == mode)
        return length, then, mode_then, part, Settled(where(is_settled, dt, 0.0), part)

    # a flux that settles stops changing at all, and micro-steps are many where it settles fast
    again = (dt, at, mode, settled.part, settled)
    length, at, mode, part, settled = cond(dt == settled.dt, lambda: again, anew)
    left = left - length
    return (left, at, mode, Sums(sums.losses + part.losses, sums.charge + part.charge), settled), not_(left > 0.0)


def _limited(valve: Valve, dt: Scalar, lam: Scalar) -> Scalar:
    """Step `dt`, or less where the core saturates.

    By (51) with (50) the flux has the rate r/N^2 (R_air + R_iron^2 / R_iron0) [1/s], which grows a hundredfold in
    saturation; the explicit method would lose its accuracy there, and far in saturation its stability.  Beyond the
    limit of shortening, the constant reluctance of the core above 0.999 of saturation keeps the flux bounded.
    """
    rate = valve.resistance * (valve.open_square + square(magnetics.core_law(lam, valve.circuit)))  # times the scale

    def shortened() -> Scalar:
        fine, finest = FINENESS * valve.rate_scale / rate, valve.micro_step / REFINEMENT
        longest = where(fine < finest, finest, fine)
        return where(dt < longest, dt, longest)

    return cond(rate * dt > FINENESS * valve.rate_scale, shortened, lambda: dt)


def _move(valve: Valve, dt: Scalar, at: Moving, is_moving: Scalar) -> tuple[Scalar, Moving, Scalar, Sums]:
    """Step of the moving mover, up to the contact if there is one."""
    mover, after = valve.mover, partial(rk4, partial(_moving_rates, valve), at)
    y, sums = after(dt)
    is_below = y.h < mover.lower

    def land() -> tuple[Scalar, Moving, Scalar, Sums]:
        def distance(length: Scalar) -> Scalar:
            return motion.clearance(after(length)[0].h, is_below, mover)

        ends = (motion.clearance(at.h, is_below, mover), motion.clearance(y.h, is_below, mover))
        length = crossing(distance, dt, *ends)
        then, sums = after(length)
        stop = where(is_below, mover.lower, mover.upper)
        mode = motion.leaving(where(is_below, CLOSED, OPEN), _net_force(valve, then.lam, stop))
        losses = sums.losses + motion.kinetic_energy(then.v, mover)
        return length, Moving(then.lam, stop, 0.0), mode, Sums(losses, sums.charge)

    # `is_moving` spares many runs at once the search for a contact in those that rest: they compute both branches
    return cond(is_moving & (is_below | (y.h > mover.upper)), land, lambda: (dt, y, MOVING, sums))


def _rest(valve: Valve, dt: Scalar, at: Moving, mode: Scalar) -> tuple[Scalar, Moving, Scalar, Sums]:
    """Step on a stop, of the flux only, up to the release if there is one."""
    gap_reluctance, slope = magnetics.gap_law(at.h, valve.circuit)
    spring = motion.spring_force(at.h, valve.mover)

    def margin(y: tuple[Scalar]) -> Scalar:
        return -motion.inward(mode, magnetics.force(y[0], slope, valve.circuit) + spring)

    rate = partial(_resting_rates, valve, gap_reluctance)
    dt, (lam,), sums, is_released = rk4_until(rate, (at.lam,), dt, margin)
    return dt, Moving(lam, at.h, 0.0), where(is_released, MOVING, mode), sums


def _moving_rates(valve: Valve, y: Moving) -> tuple[Moving, Sums]:
    """(51) and (52); integrands: losses in copper and damper [W], and the current [A]."""
    c, mover = valve.circuit, valve.mover
    gap_reluctance, slope = magnetics.gap_law(y.h, c)
    i = magnetics.current(y.lam, gap_reluctance + magnetics.core_law(y.lam, c), c)
    drop = valve.resistance * i
    drag = mover.damping * y.v
    acceleration = (magnetics.force(y.lam, slope, c) + motion.spring_force(y.h, mover) - drag) / mover.mass
    return Moving(valve.voltage - drop, y.v, acceleration), Sums(drop * i + drag * y.v, i)


def _resting_rates(valve: Valve, gap_reluctance: Scalar, y: tuple[Scalar]) -> tuple[tuple[Scalar], Sums]:
    """(51) at a fixed gap; integrands as above."""
    c = valve.circuit
    i = magnetics.current(y[0], gap_reluctance + magnetics.core_law(y[0], c), c)
    drop = valve.resistance * i
    return (valve.voltage - drop,), Sums(drop * i, i)


def _net_force(valve: Valve, lam: Scalar, h: Scalar) -> Scalar:
    """Force on the mover at rest [N], (52)."""
    _, slope = magnetics.gap_law(h, valve.circuit)
    return magnetics.force(lam, slope, valve.circuit) + motion.spring_force(h, valve.mover)


def _outputs(state: State, valve: Valve) -> Outputs:
    lam, h = state.flux_linkage, state.position
    c, mover = valve.circuit, valve.mover
    gap_reluctance, slope = magnetics.gap_law(h, c)
    R = gap_reluctance + magnetics.core_law(lam, c)
    mechanical = motion.elastic_energy(h, mover) + motion.kinetic_energy(state.velocity, mover)
    return Outputs(
        current=magnetics.current(lam, R, c),
        position=h,
        velocity=state.velocity,
        flux_linkage=lam,
        inductance=square(c.turns) / R,
        force=magnetics.force(lam, slope, c),
        mode=state.mode,
        contact=where(state.mode == MOVING, 0.0, 1.0),
        dissipated_energy=state.dissipated_energy,
        stored_energy=magnetics.energy(lam, gap_reluctance, c) + mechanical,
        supplied_energy=state.supplied_energy,
    )
