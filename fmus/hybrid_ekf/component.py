"""Port table of the hybrid extended Kalman filter."""

from gapsense.fmi.components import load_component, own
from gapsense.fmi.ports import Component, choice, fixed, measured, output, parameter, sample_time

CURRENT = ("current",)
EKF = load_component(own("ekf"))

COMPONENT = Component(
    name="HybridEkf",
    description="Hybrid extended Kalman filter: current, position, velocity and mode of a pot magnet",
    kernel="gapsense.estimators.hybrid_ekf",
    stop_time=0.2,
    step_size=100e-6,
    survives=True,
    ports=(
        measured("voltage", "V", "Measured coil voltage; NaN where it was lost", nominal=24.0),
        measured("current", "A", "Measured coil current; NaN where it was lost", nominal=0.2),
        output("current_estimated", "A", "Estimated current", nominal=0.2, feedthrough=CURRENT),
        output("position", "m", "Estimated lift: 0 at the lower stop", nominal=0.2e-3, feedthrough=CURRENT),
        output("velocity", "m/s", "Estimated rate of the position", nominal=0.1, feedthrough=CURRENT),
        output(
            "mode",
            "1",
            "0: at the lower stop, 1: lifting, 2: contact, 3: at the upper stop, 4: falling",
            min=0.0,
            max=4.0,
            feedthrough=CURRENT,
        ),
        output("current_std", "A", "Standard deviation in the filter", min=0.0, nominal=1e-3, feedthrough=CURRENT),
        output("position_std", "m", "Standard deviation in the filter", min=0.0, nominal=1e-5, feedthrough=CURRENT),
        output("velocity_std", "m/s", "Standard deviation in the filter", min=0.0, nominal=1e-2, feedthrough=CURRENT),
        output("innovation", "A", "Measured minus predicted current", nominal=1e-3, feedthrough=CURRENT),
        output("innovation_std", "A", "Standard deviation expected of it", min=0.0, nominal=1e-3),
        *(
            port._replace(feedthrough=("voltage", *CURRENT))
            for port in EKF.of("output")
            if port.name.startswith("health")
        ),
        sample_time(100e-6),
        choice(
            "orientation", "Gap under the upper stop, or above the lower one as in the paper", ("consistent", "printed")
        ),
        choice("tuning", "Noise of the parameters, that of the paper, or no correction", ("robust", "paper", "none")),
        fixed("coil.turns", "1", "Number of windings N", 964.0, min=1e-9),
        parameter("coil.resistance", "Ohm", "Resistance in modes 0 to 2, K6 = R_i + R_m", 114.3, min=1e-9),
        parameter("coil.resistance_upper", "Ohm", "Resistance in modes 3 and 4, K7 = R_d + R_m", 120.0, min=1e-9),
        parameter("core.permeability", "1", "Relative permeability mu_r", 200.0, min=1e-9),
        parameter("core.length", "m", "Average length of the field lines l_1", 22e-3, min=1e-9),
        parameter("pole.area", "m2", "Area of the flux A", 7.6341e-5, min=1e-12),
        parameter("mover.mass", "kg", "Mass of the armature m", 0.34, min=1e-9),
        parameter("gravity", "m/s2", "Gravity g", 9.81, min=1e-9),
        fixed("stop.upper", "m", "Position of the upper stop s_max; [HEKF] prints 0.5 mm", 0.2e-3, min=1e-9),
        parameter("current.on", "A", "Least current for a lift i_on", 0.1, min=1e-9),
        parameter("current.off", "A", "Current below which it drops i_off", 0.02, min=1e-9),
        fixed("sub_steps", "1", "Steps of a sampling interval in the air", 2.0, min=1.0, max=64.0),
        parameter("landing.band", "1", "Share of s_max within which an approach counts as a landing", 0.03, min=0.0),
        parameter("noise.current", "A", "Standard deviation of the current noise", 1e-3, min=1e-12),
        parameter(
            "process.current", "A", "Standard deviation of its process noise per sample, on a stop", 3e-4, min=0.0
        ),
        parameter("process.current_moving", "A", "Standard deviation of the same in the air", 1e-3, min=0.0),
        parameter("process.position", "m", "Standard deviation of its process noise per sample", 1e-7, min=0.0),
        parameter("process.velocity", "m/s", "Standard deviation of its process noise per sample", 3e-4, min=0.0),
        parameter("release.position_std", "m", "Standard deviation after leaving a stop", 1e-6, min=0.0),
        parameter("release.velocity_std", "m/s", "Standard deviation after leaving a stop", 1e-3, min=0.0),
        parameter("prior.current", "A", "Current at the start", 0.0),
        parameter("prior.current_std", "A", "Its standard deviation", 1e-3, min=0.0),
        fixed("prior.position", "m", "Stop at the start: the upper one from half of s_max on", 0.0, min=0.0),
        *(port for port in EKF.of("parameter") if port.name.startswith("range.")),
        parameter("health.samples", "1", "Samples over which the innovations are averaged", 50.0, min=1.0),
        parameter("health.limit", "1", "Largest mean of the squared normalised innovation", 4.0, min=0.0),
    ),
)
