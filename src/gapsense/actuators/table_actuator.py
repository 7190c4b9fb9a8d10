"""Actuator from a table of the current over gap and flux linkage, as finite elements or measurements give it.

The table is a tensor spline i(lambda, h). Its integral over the flux linkage is the energy W(lambda, h) of the field,
and the force is -dW/dh. So current and force come from one potential, also between the rows, and the energy balance
closes.

Eddy currents and hysteresis are added as in `ReluctanceActuator`: the magnetomotive force of its core, minus that of
the same core without hysteresis, which is in the table already. For mover and stops see `table_steps`.
"""

from __future__ import annotations

from functools import partial
from typing import Annotated, Any, NamedTuple

from gapsense.actuators import hysteresis, magnetics, motion, reluctance_actuator, table_steps
from gapsense.actuators.motion import MOVING
from gapsense.actuators.reluctance_actuator import MICRO_STEPS, actuator_of
from gapsense.actuators.reluctance_steps import Losses
from gapsense.actuators.surface import Surface
from gapsense.actuators.table_steps import Contact, Continuous, Device, device_of, micro_step
from gapsense.kernels.interface import COLUMN, choice, fixed, option, output, parameter, ports, same, table
from gapsense.kernels.layout import Array, Choice, Scalar, Table, blank
from gapsense.kernels.trace import clip, loop, where

# ports of `ReluctanceActuator`
KNOWN = same(reluctance_actuator.Parameters)
OUTPUT = same(reluctance_actuator.Outputs)
Inputs = magnetics.Inputs


class SpringLaw(Choice):
    """Force of the spring: by stiffness, or by table."""

    linear, table = range(2)


class StopLaw(Choice):
    """Stops that turn the speed round at once, or that give way."""

    hard, elastic = range(2)


@ports()
class Parameters(NamedTuple):
    """Coil, table, losses of the core, mover and stops."""

    coil_resistance: Scalar = KNOWN
    coil_turns: Scalar = KNOWN
    map_file_gap: Annotated[Array, Table()] = table(
        "CSV file with the columns gap [m], flux_linkage [Wb], current [A]: for each gap, from the smallest on, the"
        " static current at the same flux linkages, from 0 on",
        (
            "gap [m]",
            "axis:flux_linkage [Wb]",
            "current [A]",
            "bend:current",
            "energy:current",
            "current_curve:current",
            "bend_curve:current",
            "energy_curve:current",
        ),
        "map.csv",
    )
    map_file_axis: Annotated[Array, Table()] = COLUMN
    map_file_current: Annotated[Array, Table()] = COLUMN
    map_file_bend: Annotated[Array, Table()] = COLUMN
    map_file_energy: Annotated[Array, Table()] = COLUMN
    map_file_current_curve: Annotated[Array, Table()] = COLUMN
    map_file_bend_curve: Annotated[Array, Table()] = COLUMN
    map_file_energy_curve: Annotated[Array, Table()] = COLUMN
    eddy_currents: Scalar = KNOWN
    core_eddy_conductance: Scalar = KNOWN
    hysteresis: Scalar = option("Hysteresis of the core, besides the table, which has none", False)
    core_length: Scalar = KNOWN
    core_area: Scalar = KNOWN
    core_magnetization: Scalar = KNOWN
    core_shape: Scalar = KNOWN
    core_coupling: Scalar = KNOWN
    core_pinning: Scalar = KNOWN
    core_reversibility: Scalar = KNOWN
    mover_mass: Scalar = KNOWN
    mover_load: Scalar = parameter("kg", "Mass of the load that moves with it", 0.0, min=0.0)
    gravity: Scalar = parameter("m/s2", "Acceleration of gravity along the gap; positive: it opens the gap", 0.0)
    spring_law: Annotated[Scalar, SpringLaw] = choice("Force of the spring")
    spring_stiffness: Scalar = KNOWN
    spring_rest: Scalar = KNOWN
    spring_preload: Scalar = parameter("N", "Constant force besides the spring; positive: it opens the gap", 0.0)
    spring_file_gap: Annotated[Array, Table()] = table(
        "Table: CSV file with the columns gap [m], force [N], positive: it opens the gap; straight between the rows",
        ("rising:gap [m]", "force [N]", "integral:force"),
        "spring.csv",
    )
    spring_file_force: Annotated[Array, Table()] = COLUMN
    spring_file_integral: Annotated[Array, Table()] = COLUMN
    damping: Scalar = KNOWN
    friction: Scalar = parameter("N", "Dry friction; what is less holds the mover, wherever it is", 0.0, min=0.0)
    stop_lower: Scalar = KNOWN
    stop_upper: Scalar = KNOWN
    stop_law: Annotated[Scalar, StopLaw] = choice("Stops")
    stop_restitution: Scalar = fixed("1", "Hard: speed after an impact over that before it", 0.0, min=0.0, max=0.95)
    stop_stiffness: Scalar = fixed("N/m", "Elastic: force by depth", 1e6, min=1e-3)
    stop_damping: Scalar = fixed("s/m", "Elastic: share by which it is larger, by speed inwards", 0.5, min=0.0)
    initial_position: Scalar = KNOWN
    micro_step: Scalar = fixed("s", "Longest step of the integrator", 10e-6, min=1e-7, name="micro_step")


class State(NamedTuple):
    """What is carried from step to step."""

    at: Continuous
    contact: Contact
    heat: Scalar  # copper, damping, friction and impacts, since the start [J]
    eddy_energy: Scalar  # lost to eddy currents since the start [J]
    wall_work: Scalar  # done on the walls since the start, lost or stored [J]
    supplied_energy: Scalar  # integral of u i since the start [J]


@ports()
class Outputs(NamedTuple):
    """Values at the end of the step."""

    current: Scalar = OUTPUT
    position: Scalar = OUTPUT
    velocity: Scalar = OUTPUT
    flux_linkage: Scalar = OUTPUT
    inductance: Scalar = output("H", "Flux linkage / static current, of the table", nominal=0.05)
    force: Scalar = OUTPUT
    spring_force: Scalar = output("N", "Force of spring, preload and gravity; positive: it opens the gap")
    mode: Scalar = OUTPUT
    contact: Scalar = OUTPUT
    dissipated_energy: Scalar = output(
        "J", "Lost in coil, core, damping, friction and impacts since the start", nominal=0.1
    )
    eddy_energy: Scalar = OUTPUT
    hysteresis_energy: Scalar = OUTPUT
    stored_energy: Scalar = output("J", "Magnetic, elastic, kinetic energy, and that of height", nominal=0.01)
    supplied_energy: Scalar = OUTPUT
    impact_speed: Scalar = output("m/s", "Hardest impact on the stop since the mover came to it", nominal=0.5)


def initial(inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """At rest without flux inside the stops, before any voltage; held, or about to be driven away."""
    dev = device(inputs._replace(voltage=0.0), par)
    h = clip(par.initial_position, par.stop_lower, par.stop_upper)
    mode, depth = table_steps.sunk(dev, motion.resting_mode(h, dev.act.mover), h)
    at = blank(Continuous, position=h + (mode - MOVING) * depth)
    contact = table_steps.settle_contact(dev, at, blank(Contact, mode=mode, stop=mode))
    state = blank(State, at=at, contact=contact)
    return state, _outputs(state, dev)


def step(state: State, inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """One communication step of equal micro-steps, shortened where something switches or is fast.

    A step of no length changes nothing.
    """
    dev = device(inputs, par)
    act, flux = dev.act, state.at.flux
    start = (inputs.dt, state.at, state.contact, Losses(state.heat, 0.0, 0.0))
    _, at, contact, losses = loop(MICRO_STEPS, partial(micro_step, dev), start)
    charge = (inputs.voltage * inputs.dt - act.turns * (at.flux - flux)) / act.resistance  # (1), integrated
    state = State(
        at=at._replace(calm_field=hysteresis.settle_field(at.flux, at.calm_field, dev.calm)),
        contact=contact,
        heat=losses.heat,
        eddy_energy=state.eddy_energy + act.eddy * losses.eddy,
        wall_work=state.wall_work + where(act.core.is_hysteretic, act.core.volume, 0.0) * losses.work,
        supplied_energy=state.supplied_energy + inputs.voltage * charge,
    )
    return state, _outputs(state, dev)


def device(inputs: Any, par: Parameters) -> Device:
    """Constants of a communication step."""
    mover = motion.mover_of(par)
    mover = mover._replace(mass=par.mover_mass + par.mover_load)
    return device_of(par, actuator_of(inputs, par, None, hysteresis.make_core(par), mover), _map(par))


def _map(par: Parameters) -> Surface:
    return Surface(
        places=par.map_file_gap,
        axis=par.map_file_axis,
        values=par.map_file_current,
        bends=par.map_file_bend,
        integrals=par.map_file_energy,
        curves=par.map_file_current_curve,
        bend_curves=par.map_file_bend_curve,
        integral_curves=par.map_file_energy_curve,
    )


def _outputs(state: State, dev: Device) -> Outputs:
    at, act, mode = state.at, dev.act, state.contact.mode
    patch = table_steps.patch_at(dev, at)
    magnet, electric = table_steps.magnet_at(dev, patch, at), table_steps.electric_at(dev, patch, at)
    walls, core = table_steps.core_energies(dev, at)
    lost = state.wall_work - walls
    mechanical = table_steps.mechanical_energy(dev, mode, at)
    lam = act.turns * at.flux
    is_unmagnetized = magnet.current == 0.0
    return Outputs(
        current=electric.current,
        position=at.position,
        velocity=at.velocity,
        flux_linkage=lam,
        inductance=where(is_unmagnetized, 1.0 / magnet.slope, lam / where(is_unmagnetized, 1.0, magnet.current)),
        force=magnet.force,
        spring_force=table_steps.push(dev, at.position),
        mode=mode,
        contact=where(mode == MOVING, 0.0, 1.0),
        dissipated_energy=state.heat + state.eddy_energy + lost,
        eddy_energy=state.eddy_energy,
        hysteresis_energy=lost,
        stored_energy=magnet.energy + core + mechanical,
        supplied_energy=state.supplied_energy,
        impact_speed=state.contact.impact,
    )
