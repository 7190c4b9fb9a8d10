"""Port table of the pot magnet."""

from gapsense.fmi.ports import Component, Limit, choice, fixed, input_, output, parameter

# Terms of R / L with the armature at the lower stop, over mu_0 and, for the gap, over 2: below 0.48e6 / s each.
CORE = (("core.length", 1), ("coil.turns", -2), ("core.permeability", -1), ("pole.area", -1))
GAP = (("stop.upper", 1), ("coil.turns", -2), ("pole.area", -1))
FAST = "the coil would settle within microseconds, and be integrated in steps of nanoseconds"
RESISTANCES = ("coil.resistance", "coil.resistance_upper")

COMPONENT = Component(
    name="PotMagnet",
    description="Pot magnet that lifts its armature against gravity, with five modes",
    kernel="gapsense.actuators.pot_magnet",
    stop_time=0.2,
    step_size=100e-6,
    limits=tuple(Limit((*term, (R, 1)), below, FAST) for R in RESISTANCES for term, below in ((CORE, 0.6), (GAP, 0.3))),
    ports=(
        input_("voltage", "V", "Coil voltage, held during the step", nominal=24.0, source="drive.voltage_mean"),
        output("current", "A", "Coil current", nominal=0.2),
        output("position", "m", "Lift of the armature: 0 at the lower stop", nominal=0.2e-3),
        output("velocity", "m/s", "Rate of the position", nominal=0.1),
        output("flux_linkage", "Wb", "Flux linkage", nominal=0.1),
        output("inductance", "H", "Inductance, flux linkage / current", nominal=0.8),
        output("force", "N", "Magnetic force, upwards", nominal=3.0),
        output(
            "mode",
            "1",
            "0: at the lower stop, 1: lifting, 2: contact, 3: at the upper stop, 4: falling",
            min=0.0,
            max=4.0,
        ),
        output("contact", "1", "1 on a stop, else 0", min=0.0, max=1.0),
        output("dissipated_energy", "J", "Lost in the coil and the impacts since the start", nominal=0.1),
        output("stored_energy", "J", "Magnetic, potential and kinetic energy", nominal=0.01),
        output("supplied_energy", "J", "Integral of voltage times current since the start", nominal=0.1),
        output("created_energy", "J", "What the printed orientation creates out of nothing, since the start"),
        output("impact_speed", "m/s", "Hardest impact since the armature last left its rest", nominal=0.5),
        choice(
            "orientation", "Gap under the upper stop, or above the lower one as in the paper", ("consistent", "printed")
        ),
        fixed("coil.turns", "1", "Number of windings N", 964.0, min=1e-9),
        parameter("coil.resistance", "Ohm", "Resistance in modes 0 to 2, K6 = R_i + R_m", 114.3, min=1e-9),
        parameter("coil.resistance_upper", "Ohm", "Resistance in modes 3 and 4, K7 = R_d + R_m", 120.0, min=1e-9),
        fixed("core.permeability", "1", "Relative permeability mu_r", 200.0, min=1e-9),
        fixed("core.length", "m", "Average length of the field lines l_1", 22e-3, min=1e-9),
        fixed("pole.area", "m2", "Area of the flux A", 7.6341e-5, min=1e-12),
        fixed("mover.mass", "kg", "Mass of the armature m", 0.34, min=1e-9),
        parameter("gravity", "m/s2", "Gravity g", 9.81, min=1e-9),
        fixed("stop.upper", "m", "Position of the upper stop s_max; [HEKF] prints 0.5 mm", 0.2e-3, min=1e-9),
        fixed("stop.restitution", "1", "Speed after an impact over that before it", 0.0, min=0.0, max=0.95),
        parameter("current.on", "A", "Least current for a lift i_on", 0.1, min=1e-9),
        parameter("current.off", "A", "Current below which it drops i_off", 0.02, min=1e-9),
        fixed("initial.position", "m", "Position at the start", 0.0, min=0.0),
        fixed("micro_step", "s", "Longest step of the integrator", 25e-6, min=1e-7),
    ),
)
