"""Port table of the extended Kalman filter; `Ertss` and `BoundedUkf` take what they have in common from here."""

from gapsense.fmi.ports import Component, choice, fixed, input_, option, output, parameter, sample_time, table

BOTH = ("current", "mode")
ALL = ("voltage", *BOTH)

COMPONENT = Component(
    name="Ekf",
    description="Extended Kalman filter: position, velocity and flux linkage from voltage, current and contact",
    kernel="gapsense.estimators.ekf",
    step_size=20e-6,
    survives=True,
    resources=("fringing_29.csv",),
    rising=(("stop.lower", "stop.upper"),),
    ports=(
        input_("voltage", "V", "Measured coil voltage; NaN where it was lost", nominal=30.0),
        input_("current", "A", "Measured coil current; NaN where it was lost", nominal=0.4),
        input_(
            "mode",
            "1",
            "1: at the lower stop, 2: moving, 3: at the upper stop; NaN where it was lost",
            start=3.0,
            min=1.0,
            max=3.0,
            nominal=2.0,
        ),
        output("position", "m", "Estimated position", nominal=1e-3, feedthrough=BOTH),
        output("velocity", "m/s", "Estimated mean velocity since the last sample", nominal=0.5, feedthrough=BOTH),
        output("flux_linkage", "Wb", "Estimated flux linkage", nominal=0.02, feedthrough=BOTH),
        output("current_error", "A", "Estimated error of the model's current", nominal=0.1, feedthrough=BOTH),
        output(
            "force_error", "N", "Estimated error of the model's force; the normal force at a stop", feedthrough=BOTH
        ),
        output("position_std", "m", "Standard deviation in the filter", min=0.0, nominal=1e-4, feedthrough=BOTH),
        output("velocity_std", "m/s", "Standard deviation in the filter", min=0.0, nominal=0.1, feedthrough=BOTH),
        output("flux_linkage_std", "Wb", "Standard deviation in the filter", min=0.0, nominal=1e-3, feedthrough=BOTH),
        output("current_error_std", "A", "Standard deviation in the filter", min=0.0, nominal=0.1, feedthrough=BOTH),
        output("force_error_std", "N", "Standard deviation in the filter", min=0.0, feedthrough=BOTH),
        output("innovation", "A", "Measured minus predicted current", nominal=1e-2, feedthrough=BOTH),
        output("innovation_std", "A", "Standard deviation expected of it", min=0.0, nominal=1e-2, feedthrough=BOTH),
        output(
            "health", "1", "1: to be trusted as far as the filter can tell; 0: not", min=0.0, max=1.0, feedthrough=ALL
        ),
        output(
            "health_causes",
            "1",
            "Why not, a sum of 1: innovations larger than expected, 2: current error larger than expected, 4: flux "
            "linkage beyond saturation, 8: position held at a bound for long, 16: a reading lost or wild, 32: "
            "covariance lost, restarted",
            min=0.0,
            max=63.0,
            feedthrough=ALL,
        ),
        sample_time(20e-6),
        parameter("coil.resistance", "Ohm", "Resistance R", 48.0, min=1e-9),
        fixed("coil.turns", "1", "Number of turns N", 1200.0, min=1e-9),
        parameter("mover.mass", "kg", "Mass of the mover m", 1.6e-3, min=1e-9),
        parameter("spring.stiffness", "N/m", "Stiffness k_sp", 61.8, min=0.0),
        parameter("spring.rest", "m", "Position without spring force z_sp", 19.2e-3),
        parameter("damping", "N.s/m", "Viscous damping c_f", 0.8, min=0.0),
        fixed("stop.lower", "m", "Smallest position z_min", 0.4e-3, min=0.0),
        fixed("stop.upper", "m", "Largest position z_max", 1.4e-3, min=1e-9),
        parameter("core.reluctance", "1/H", "Reluctance of the core without flux, N^2 R_c0*", 2.52e6, min=1e-9),
        parameter("core.saturation", "Wb", "Flux linkage of saturation lambda_sat", 23.8e-3, min=1e-12),
        choice("gap.law", "Reluctance of the gap", ("fringing", "table")),
        parameter("gap.reluctance", "1/H", "Fringing law: reluctance of the closed gap R_g0", 0.0),
        parameter("gap.slope", "1/(H.m)", "Fringing law: reluctance per gap without fringing", 4.7e10, min=0.0),
        parameter("gap.fringing", "1/m", "Fringing law: strength k_f; 0: none", 300.0, min=0.0),
        fixed("gap.window", "m", "Fringing law: length along which the flux fringes c_f", 9.73e-3, min=1e-5),
        table(
            "gap.file",
            "Table: CSV file with the columns gap [m], reluctance [1/H], both rising; interpolated by a cubic spline",
            ("rising:gap", "rising:reluctance", "spline:reluctance"),
            "fringing_29.csv",
        ),
        parameter("gap.tilt", "1/(H.m)", "Slope added around the middle of the stroke", 0.0),
        option("option.force_error", "Estimate the force error e_F, as in the paper", True),
        option("option.current_error", "Estimate the current error e_i, as in the paper", True),
        parameter("process.flux_linkage", "Wb", "Standard deviation of its process noise in 20 us", 19e-6, min=0.0),
        parameter("process.current_error", "A", "Standard deviation of its process noise in 20 us", 2.2e-3, min=0.0),
        parameter(
            "process.current_error_memory",
            "s",
            "Time constant with which the current error is forgotten at rest; 0: it never is, as in the paper",
            0.66e-3,
            min=0.0,
        ),
        parameter("process.force_error", "N", "Standard deviation of its process noise in 20 us", 21e-3, min=0.0),
        parameter("noise.current", "A", "Standard deviation of the current noise", 2e-3, min=1e-12),
        parameter("prior.flux_linkage", "Wb", "Flux linkage at the start", 0.0),
        parameter("prior.flux_linkage_std", "Wb", "Its standard deviation", 0.0, min=0.0),
        parameter("range.voltage", "V", "A reading beyond plus or minus this counts as lost", 100.0, min=1e-9),
        parameter(
            "range.current",
            "A",
            "A reading beyond plus or minus this counts as lost; 0: twice what range.voltage drives",
            0.0,
            min=0.0,
        ),
        parameter(
            "range.innovation",
            "1",
            "A current with an innovation beyond so many deviations is wild, but not more than 5 in a row; 0: none is",
            50.0,
            min=0.0,
        ),
        parameter("health.samples", "1", "Samples over which the innovations are averaged", 50.0, min=1.0),
        parameter("health.limit", "1", "Largest mean of the squared normalised innovation", 6.0, min=0.0),
        parameter(
            "health.current_error",
            "1",
            "Largest root mean square of the current error at rest, in stationary deviations",
            6.0,
            min=0.0,
        ),
    ),
)
