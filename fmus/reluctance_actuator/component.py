"""Port table of the reluctance actuator."""

from gapsense.fmi.ports import Component, Limit, choice, fixed, input_, option, output, parameter, table

UNSTABLE = (
    "at 3 the anhysteretic curve of the core is vertical (alpha M_sat / (3 a) = 1), beyond it the model is unstable"
)
STIFF = "beyond it friction brings the mover to rest faster than the micro-steps can follow"

COMPONENT = Component(
    name="ReluctanceActuator",
    description="Reluctance actuator with eddy currents, hysteresis, saturation, fringing, spring, damping, stops",
    kernel="gapsense.actuators.reluctance_actuator",
    step_size=20e-6,
    resources=("fringing_29.csv",),
    rising=(("stop.lower", "stop.upper"),),
    limits=(
        Limit((("core.coupling", 1), ("core.magnetization", 1), ("core.shape", -1)), 3.0, UNSTABLE),
        Limit((("friction", 1), ("micro_step", 1), ("mover.mass", -1)), 4e-3, STIFF),
    ),
    ports=(
        input_("voltage", "V", "Coil voltage, held during the step", nominal=30.0, source="drive.voltage_mean"),
        output("current", "A", "Coil current; at a jump of the voltage, that before it", nominal=0.6),
        output("position", "m", "Gap: the smallest is closed", nominal=1e-3),
        output("velocity", "m/s", "Rate of the gap", nominal=0.5),
        output("flux_linkage", "Wb", "Flux linkage", nominal=0.02),
        output(
            "inductance", "H", "Flux linkage / current, limited to 10 times that of the demagnetized coil", nominal=0.05
        ),
        output("force", "N", "Magnetic force; negative: it closes the gap", nominal=1.0),
        output("mode", "1", "1: at the lower stop, 2: moving, 3: at the upper stop", min=1.0, max=3.0),
        output("contact", "1", "1 on a stop, else 0", min=0.0, max=1.0),
        output("core_field", "A/m", "Magnetic field strength in the core, H_c", nominal=1e3),
        output("flux_density", "T", "Flux density in the core, B_c", nominal=1.0),
        output("dissipated_energy", "J", "Lost in coil, core, damping and impacts since the start", nominal=0.1),
        output("eddy_energy", "J", "Part of it lost to eddy currents", nominal=1e-3),
        output("hysteresis_energy", "J", "Part of it lost to hysteresis", nominal=1e-3),
        output("stored_energy", "J", "Magnetic, elastic and kinetic energy", nominal=0.01),
        output("supplied_energy", "J", "Integral of voltage times current since the start", nominal=0.1),
        output("impact_speed", "m/s", "Hardest impact since the mover last left its rest", nominal=0.5),
        parameter("coil.resistance", "Ohm", "Resistance R", 48.0, min=1e-9),
        fixed("coil.turns", "1", "Number of turns N", 1200.0, min=1e-9),
        option("hysteresis", "Hysteresis of the core; off: its anhysteretic curve", True),
        option("saturation", "Saturation of the core; off: its slope is that at zero", True),
        option("eddy_currents", "Eddy currents in the core", True),
        fixed("core.length", "m", "Length of the flux path l_c", 0.055, min=1e-9),
        fixed("core.area", "m2", "Cross section A_c", 1.26e-5, min=1e-12),
        fixed("core.magnetization", "A/m", "Saturation magnetization M_sat", 1.45e6, min=1.0),
        fixed("core.shape", "A/m", "Shape of the anhysteretic curve a = b/mu0", 1949.6, min=1e-3),
        fixed("core.coupling", "1", "Coupling of the domains alpha", 3.66e-3, min=0.0, max=0.9),
        fixed("core.pinning", "A/m", "Pinning of the walls kappa", 942.0, min=1e-3),
        fixed("core.reversibility", "1", "Reversible share of the magnetization c", 0.736, min=0.0, max=0.999),
        fixed("core.eddy_conductance", "S", "Eddy current per rate of flux, k_eddy", 1630.0, min=0.0),
        choice("gap.law", "Reluctance of the gap", ("fringing", "table")),
        fixed("gap.reluctance", "1/H", "Fringing law: reluctance without gap, R_g0", 0.0, min=0.0),
        fixed("gap.slope", "1/(H.m)", "Fringing law: reluctance per gap without fringing, R_gp", 4.7e10, min=0.0),
        fixed("gap.fringing", "1/m", "Fringing law: strength k_f", 300.0, min=0.0),
        fixed("gap.window", "m", "Fringing law: reach c_f; no fringing in larger gaps", 9.73e-3, min=1e-9),
        table(
            "gap.file",
            "Table: CSV file with the columns gap [m], reluctance [1/H], both rising; interpolated by a cubic spline",
            ("rising:gap [m]", "rising:reluctance [1/H]", "spline:reluctance"),
            "fringing_29.csv",
        ),
        fixed("mover.mass", "kg", "Mass of the mover m", 1.6e-3, min=1e-9),
        parameter("spring.stiffness", "N/m", "Stiffness k_sp", 61.8, min=0.0),
        parameter("spring.rest", "m", "Gap without spring force, z_sp", 0.0192),
        parameter("damping", "N.s/m", "Viscous damping c_f", 0.8, min=0.0),
        fixed("friction", "N", "Dry friction, at rest and in motion", 0.0, min=0.0),
        fixed("stop.lower", "m", "Smallest gap z_min", 0.4e-3, min=0.0),
        fixed("stop.upper", "m", "Largest gap z_max", 1.4e-3, min=1e-9),
        fixed("stop.restitution", "1", "Speed after an impact over that before it", 0.0, min=0.0, max=0.95),
        fixed("initial.position", "m", "Gap at the start", 1.4e-3, min=0.0),
        fixed("micro_step", "s", "Longest step of the integrator", 10e-6, min=1e-7),
    ),
)
