"""Port table of the bounded unscented Kalman filter."""

from gapsense.fmi.components import load_component, own
from gapsense.fmi.ports import Component, choice, fixed, measured, option, output, parameter, sample_time, table

BOTH = ("voltage", "current")  # the voltage too, with the option to use the sample at the end of an interval
EKF = load_component(own("ekf"))
LOSSES = ("core.bend", "core.eddy", "core.hysteresis", "core.turnover")

OWN = {
    "current_error": output(
        "current_error", "A", "Estimated: model's current minus the true one", nominal=0.1, feedthrough=BOTH
    ),
}

COMPONENT = Component(
    name="BoundedUkf",
    description="Bounded unscented Kalman filter: position from voltage and current, without a contact sensor",
    kernel="gapsense.estimators.ukf",
    step_size=20e-6,
    rising=(("stop.lower", "stop.upper"),),
    resources=("fringing_19.csv",),
    survives=True,
    ports=(
        measured("voltage", "V", "Measured coil voltage; NaN where it was lost", nominal=30.0),
        measured("current", "A", "Measured coil current; NaN where it was lost", nominal=0.4),
        *(port for port in EKF.of("input") if port.name == "resistance"),
        *(OWN.get(port.name, port._replace(feedthrough=BOTH)) for port in EKF.of("output") if "force" not in port.name),
        sample_time(20e-6),
        parameter("coil.resistance", "Ohm", "Resistance R", 77.5, min=1e-9),
        fixed("coil.turns", "1", "Number of turns N", 1200.0, min=1e-9),
        table(
            "gap.file",
            "Gap reluctance: CSV file with the columns gap [m], reluctance [1/H], slope [1/(H.m)]",
            ("gap [m]", "reluctance [1/H]", "slope [1/(H.m)]"),
            "fringing_19.csv",
        ),
        parameter("core.reluctance", "1/H", "Reluctance of the core without flux k_1", 3.25e6, min=1e-9),
        parameter("core.saturation", "Wb", "Flux linkage of saturation, N / k_2", 0.024, min=1e-12),
        *(port for port in EKF.of("parameter") if port.name in LOSSES),
        parameter("mover.mass", "kg", "Mass of the mover m", 1.6e-3, min=1e-9),
        parameter("spring.stiffness", "N/m", "Stiffness k_sp", 37.0, min=0.0),
        parameter("spring.rest", "m", "Gap without spring force z_sp", 22.5e-3),
        parameter("damping", "N.s/m", "Viscous damping c_f", 0.4, min=0.0),
        fixed("stop.lower", "m", "Smallest gap", 0.0, min=0.0),
        fixed("stop.upper", "m", "Largest gap z_max", 0.9e-3, min=1e-9),
        choice("option.filter", "Filter", ("bounded_ukf", "unbounded_ukf", "bounded_ekf", "open_loop")),
        choice("option.noise", "Process noise in the sigma points", ("additive", "augmented")),
        choice("option.voltage", "Sample that stands for an interval", ("at_start", "mean", "at_end")),
        choice("option.tuning", "Process noise; `own` takes the parameters process.*", ("robust", "paper", "own")),
        option("option.current_error", "Estimate the current error, as in the paper", True),
        fixed("sigma.spread", "1", "Spread of the sigma points, n + kappa", 8.0, min=1e-6),
        parameter("process.flux_linkage", "Wb", "Tuning `own`: standard deviation per sample", 16e-6, min=0.0),
        parameter("process.position", "m", "Tuning `own`: standard deviation per sample", 60e-9, min=0.0),
        parameter("process.current_error", "A", "Tuning `own`: standard deviation per sample", 1e-6, min=0.0),
        parameter("process.memory", "1", "Tuning `own`: what is left of it after a sample", 0.99, min=0.0, max=1.0),
        parameter("process.limit", "1", "Tuning `own`: largest innovation that counts, in deviations", 1.2, min=1e-9),
        parameter("noise.voltage", "V", "Standard deviation of the voltage noise", 0.15, min=0.0),
        parameter("noise.current", "A", "Standard deviation of the current noise", 2e-3, min=1e-12),
        *(port for port in EKF.of("parameter") if port.name in ("range.voltage", "range.current")),
        fixed("prior.position", "m", "Position at the start, at rest", 0.9e-3),
        fixed("prior.position_std", "m", "Its standard deviation", 0.0, min=0.0),
        fixed("prior.flux_linkage", "Wb", "Flux linkage at the start", 0.0),
        fixed("prior.flux_linkage_std", "Wb", "Its standard deviation", 0.0, min=0.0),
        fixed("prior.current_error_std", "A", "Standard deviation of the current error at the start", 0.0, min=0.0),
        parameter("health.samples", "1", "Samples over which the innovations are averaged", 50.0, min=1.0),
        parameter("health.limit", "1", "Largest mean of the squared normalised innovation", 60.0, min=0.0),
    ),
)
