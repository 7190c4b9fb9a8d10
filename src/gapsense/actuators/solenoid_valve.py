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
from gapsense.actuators.magnetics import MU_0, Circuit, Gap
from gapsense.actuators.motion import MOVING, Contact
from gapsense.actuators.valve_steps import MICRO_STEPS, REFINEMENT, Moving, Rest, Sums, Valve, gap_at, micro_step
from gapsense.kernels.integrate import equal_parts
from gapsense.kernels.interface import COLUMN, choice, fixed, input_, output, parameter, ports, table
from gapsense.kernels.layout import Array, Choice, Scalar, Table
from gapsense.kernels.trace import clip, loop, sqrt, square, where


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
class Inputs(NamedTuple):
    """Voltage, and the communication step that ends at `time`."""

    time: Scalar  # [s]
    dt: Scalar  # [s]
    voltage: Scalar = input_("V", "Coil voltage, held during the step", source="drive.voltage_mean", nominal=30.0)


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
    state = State(
        flux_linkage=0.0,
        position=h,
        velocity=0.0,
        mode=mode,
        dissipated_energy=0.0,
        supplied_energy=0.0,
        impact_speed=0.0,
    )
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
