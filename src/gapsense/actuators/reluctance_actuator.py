"""Reluctance actuator with eddy currents, hysteresis and a fringing gap: the complete model of [RTS] Section II-A.

Flux, effective field of the core (see `hysteresis`), position and velocity are integrated in micro-steps. The current
is an algebraic output. A micro-step is smooth: it ends where the mover meets or leaves a stop, and where the domain
walls of the core start or stop to move. The voltage is held during the communication step.
"""

from __future__ import annotations

from functools import partial
from typing import Annotated, Any, NamedTuple

from gapsense.actuators import hysteresis, magnetics, motion
from gapsense.actuators.hysteresis import Core, make_core
from gapsense.actuators.magnetics import Gap, SmoothGap
from gapsense.actuators.motion import MOVING, Contact, Mover
from gapsense.actuators.reluctance_steps import Actuator, Losses, Moving, circuit_at, gap_at, micro_step
from gapsense.kernels.integrate import equal_parts
from gapsense.kernels.interface import COLUMN, choice, fixed, option, output, parameter, ports, table
from gapsense.kernels.layout import Array, Choice, Scalar, Table, blank
from gapsense.kernels.trace import clip, fabs, loop, square, where

MICRO_STEPS = 10_000_000  # at most, per communication step
FLUX_FINENESS = 0.05  # micro-step at most, in time constants of the flux
FIELD_FINENESS = 0.2  # and change of the effective field in it at most, in units of kappa or a
HIGHEST_INDUCTANCE = 10.0  # |flux linkage / current| at most, in inductances of the unmagnetized actuator
Inputs = magnetics.Inputs


class GapLaw(Choice):
    """Where the reluctance of the gap comes from: a formula with fringing, or a table."""

    fringing, table = range(2)


@ports()
class Parameters(NamedTuple):
    """Table I, the gap laws, what is switched on, and the micro-step."""

    coil_resistance: Scalar = parameter("Ohm", "Resistance R", 48.0, min=1e-9)
    coil_turns: Scalar = parameter("1", "Number of turns N", 1200.0, min=1e-9)
    hysteresis: Scalar = option("Hysteresis of the core; off: its anhysteretic curve", True)
    saturation: Scalar = option("Saturation of the core; off: its slope is that at zero", True)  # 0: no saturation
    eddy_currents: Scalar = option("Eddy currents in the core", True, name="eddy_currents")  # 0: none
    core_length: Scalar = fixed("m", "Length of the flux path l_c", 0.055, min=1e-9)
    core_area: Scalar = fixed("m2", "Cross section A_c", 1.26e-5, min=1e-12)
    core_magnetization: Scalar = fixed("A/m", "Saturation magnetization M_sat", 1.45e6, min=1.0)
    core_shape: Scalar = fixed("A/m", "Shape of the anhysteretic curve a = b/mu0", 1949.6, min=1e-3)
    core_coupling: Scalar = fixed("1", "Coupling of the domains alpha", 3.66e-3, min=0.0, max=0.9)
    core_pinning: Scalar = fixed("A/m", "Pinning of the walls kappa", 942.0, min=1e-3)
    core_reversibility: Scalar = fixed("1", "Reversible share of the magnetization c", 0.736, min=0.0, max=0.999)
    core_eddy_conductance: Scalar = parameter("S", "Eddy current per rate of flux, k_eddy", 1630.0, min=0.0)
    gap_law: Annotated[Scalar, GapLaw] = choice("Reluctance of the gap")
    gap_reluctance: Scalar = fixed("1/H", "Fringing law: reluctance without gap, R_g0", 0.0, min=0.0)
    gap_slope: Scalar = fixed("1/(H.m)", "Fringing law: reluctance per gap without fringing, R_gp", 4.7e10, min=0.0)
    gap_fringing: Scalar = fixed("1/m", "Fringing law: strength k_f", 300.0, min=0.0)
    gap_window: Scalar = fixed("m", "Fringing law: reach c_f; no fringing in larger gaps", 9.73e-3, min=1e-9)
    gap_file_gap: Annotated[Array, Table()] = table(
        "Table: CSV file with the columns gap [m], reluctance [1/H], both rising; interpolated by a cubic spline",
        ("rising:gap [m]", "rising:reluctance [1/H]", "spline:reluctance"),
        "fringing_29.csv",
    )
    gap_file_reluctance: Annotated[Array, Table()] = COLUMN
    gap_file_spline: Annotated[Array, Table()] = COLUMN
    mover_mass: Scalar = parameter("kg", "Mass of the mover m", 1.6e-3, min=1e-9)
    spring_stiffness: Scalar = parameter("N/m", "Stiffness k_sp", 61.8, min=0.0)
    spring_rest: Scalar = parameter("m", "Gap without spring force, z_sp", 0.0192)
    damping: Scalar = parameter("N.s/m", "Viscous damping c_f", 0.8, min=0.0)
    friction: Scalar = parameter("N", "Dry friction, at rest and in motion", 0.0, min=0.0)
    stop_lower: Scalar = parameter("m", "Smallest gap z_min", 0.4e-3, min=0.0)
    stop_upper: Scalar = parameter("m", "Largest gap z_max", 1.4e-3, min=1e-9)
    stop_restitution: Scalar = fixed("1", "Speed after an impact over that before it", 0.0, min=0.0, max=0.95)
    initial_position: Scalar = fixed("m", "Gap at the start", 1.4e-3, min=0.0)
    micro_step: Scalar = fixed("s", "Longest step of the integrator", 10e-6, min=1e-7, name="micro_step")


class State(NamedTuple):
    """What is carried from step to step; flux and effective field are the memory of the core."""

    flux: Scalar  # phi [Wb]
    effective_field: Scalar  # H_e [A/m]
    position: Scalar  # z, the gap [m]
    velocity: Scalar  # [m/s]
    mode: Scalar  # q, 1: smallest gap, 2: moving, 3: largest gap
    heat: Scalar  # copper, damping and impacts, since the start [J]
    eddy_energy: Scalar  # lost to eddy currents since the start [J]
    wall_work: Scalar  # done on the walls since the start, lost or stored [J]
    supplied_energy: Scalar  # integral of u i since the start [J]
    impact_speed: Scalar  # of the hardest impact since the mover last left its rest [m/s]


@ports()
class Outputs(NamedTuple):
    """Values at the end of the step."""

    current: Scalar = output("A", "Coil current; at a jump of the voltage, that before it", nominal=0.6)
    position: Scalar = output("m", "Gap: the smallest is closed", nominal=1e-3)
    velocity: Scalar = output("m/s", "Rate of the gap", nominal=0.5)
    flux_linkage: Scalar = output("Wb", "Flux linkage", nominal=0.02)
    inductance: Scalar = output(
        "H", "Flux linkage / current, limited to 10 times that of the demagnetized coil", nominal=0.05
    )
    force: Scalar = output("N", "Magnetic force; negative: it closes the gap")
    mode: Scalar = output("1", "1: at the lower stop, 2: moving, 3: at the upper stop", min=1.0, max=3.0)
    contact: Scalar = output("1", "1 on a stop, else 0", min=0.0, max=1.0)
    core_field: Scalar = output("A/m", "Magnetic field strength in the core, H_c", nominal=1e3)
    flux_density: Scalar = output("T", "Flux density in the core, B_c")
    dissipated_energy: Scalar = output("J", "Lost in coil, core, damping and impacts since the start", nominal=0.1)
    eddy_energy: Scalar = output("J", "Part of it lost to eddy currents", nominal=1e-3)
    hysteresis_energy: Scalar = output("J", "Part of it lost to hysteresis", nominal=1e-3)
    stored_energy: Scalar = output("J", "Magnetic, elastic and kinetic energy", nominal=0.01)
    supplied_energy: Scalar = output("J", "Integral of voltage times current since the start", nominal=0.1)
    impact_speed: Scalar = output("m/s", "Hardest impact since the mover last left its rest", nominal=0.5)


def initial(inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """At rest and unmagnetized inside the stops, before any voltage."""
    act = make_actuator(inputs._replace(voltage=0.0), par)
    h = clip(par.initial_position, par.stop_lower, par.stop_upper)
    mode = motion.leaving(motion.resting_mode(h, act.mover), motion.spring_force(h, act.mover), par.friction)
    state = blank(State, position=h, mode=mode)
    return state, _outputs(state, act, gap_at(act, h))


def step(state: State, inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """One communication step of equal micro-steps, shortened where something switches or the core saturates.

    A step of no length changes nothing.
    """
    act = make_actuator(inputs, par)
    at = Moving(state.flux, state.effective_field, state.position, state.velocity)
    start = (inputs.dt, at, gap_at(act, at.h), Contact(state.mode, state.impact_speed), Losses(state.heat, 0.0, 0.0))
    _, at, gap, contact, losses = loop(MICRO_STEPS, partial(micro_step, act), start)
    charge = (inputs.voltage * inputs.dt - act.turns * (at.flux - state.flux)) / act.resistance  # (1), integrated
    state = State(
        flux=at.flux,
        effective_field=hysteresis.settle_field(at.flux, at.H_e, act.core),
        position=at.h,
        velocity=at.v,
        mode=contact.mode,
        heat=losses.heat,
        eddy_energy=state.eddy_energy + act.eddy * losses.eddy,
        wall_work=state.wall_work + where(act.core.is_hysteretic, act.core.volume, 0.0) * losses.work,
        supplied_energy=state.supplied_energy + inputs.voltage * charge,
        impact_speed=contact.impact,
    )
    return state, _outputs(state, act, gap)


def make_actuator(inputs: Inputs, par: Parameters) -> Actuator:
    """Constants of a communication step."""
    return actuator_of(inputs, par, _gap(par), make_core(par, par.saturation > 0.5), motion.mover_of(par, par.friction))


def actuator_of(inputs: Any, par: Any, gap: Any, core: Core, mover: Mover) -> Actuator:
    """Constants of a communication step of a plant whose parameters have these names."""
    micro_step = equal_parts(inputs.dt, par.micro_step)
    eddy = where(par.eddy_currents > 0.5, par.core_eddy_conductance, 0.0)
    total = square(par.coil_turns) + par.coil_resistance * eddy
    finest = where(core.is_hysteretic & (par.core_pinning < core.shape), par.core_pinning, core.shape)
    return Actuator(
        voltage=inputs.voltage,
        resistance=par.coil_resistance,
        turns=par.coil_turns,
        eddy=eddy,
        per_mmf=par.coil_turns / total,
        bias=eddy / total * inputs.voltage,
        gap=gap,
        core=core,
        mover=mover,
        micro_step=micro_step,
        flux_need=par.coil_resistance / total / FLUX_FINENESS,
        field_need=1.0 / (FIELD_FINENESS * finest),
        flux_weight=core.per_flux / par.core_magnetization * micro_step,
        excess_weight=1.0 / par.core_magnetization,
        stroke=par.stop_upper - par.stop_lower,
    )


def _gap(par: Parameters) -> SmoothGap:
    return SmoothGap(
        is_table=par.gap_law == GapLaw.table,
        closed=par.gap_reluctance,
        unfringed=par.gap_slope,
        fringing=par.gap_fringing,
        window=par.gap_window,
        knots=par.gap_file_gap,
        reluctance=par.gap_file_reluctance,
        curvature=par.gap_file_spline,
    )


def _outputs(state: State, act: Actuator, gap: Gap) -> Outputs:
    flux, H_e, h, v = state.flux, state.effective_field, state.position, state.velocity
    core, mover, i = act.core, act.mover, circuit_at(act, gap, flux, H_e).electric.current
    M, lam = hysteresis.magnetization(flux, H_e, core), act.turns * flux
    stored, walls = hysteresis.energies(flux, H_e, core)
    lost = state.wall_work - walls
    mechanical = motion.elastic_energy(h, mover) + motion.kinetic_energy(v, mover)
    unmagnetized = gap.reluctance + hysteresis.differential_reluctance(core.slope / 3.0, core)
    return Outputs(
        current=i,
        position=h,
        velocity=v,
        flux_linkage=lam,
        inductance=_inductance(lam, i, square(act.turns) / unmagnetized),
        force=magnetics.flux_force(flux, gap.slope),
        mode=state.mode,
        contact=where(state.mode == MOVING, 0.0, 1.0),
        core_field=H_e - core.coupling * M,
        flux_density=magnetics.MU_0 * core.per_flux * flux,
        dissipated_energy=state.heat + state.eddy_energy + lost,
        eddy_energy=state.eddy_energy,
        hysteresis_energy=lost,
        stored_energy=0.5 * square(flux) * gap.reluctance + stored + mechanical,
        supplied_energy=state.supplied_energy,
        impact_speed=state.impact_speed,
    )


def _inductance(lam: Scalar, i: Scalar, unmagnetized: Scalar) -> Scalar:
    """Flux linkage / current, limited where the remanence has no or a reversed current; that at rest without flux."""
    highest = HIGHEST_INDUCTANCE * unmagnetized
    is_limited = fabs(lam) >= highest * fabs(i)
    limited = where(lam * i < 0.0, -highest, highest)
    return where(lam == 0.0, unmagnetized, where(is_limited, limited, lam / where(is_limited, 1.0, i)))
