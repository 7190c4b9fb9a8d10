"""Port table of the extended Rauch-Tung-Striebel smoother: that of the filter, and what it says later."""

from gapsense.fmi.components import load_component, own
from gapsense.fmi.ports import output, parameter

BOTH = ("current", "mode")
EKF = load_component(own("ekf"))

COMPONENT = EKF._replace(
    name="Ertss",
    description="Extended RTS smoother: each motion again after its landing, with landing time and impact speed",
    kernel="gapsense.estimators.ertss",
    ports=(
        *EKF.of("input"),
        *EKF.of("output"),
        output(
            "smoothed_published",
            "1",
            "1: smoothed values of the sample at smoothed_time; 0: those of the filter, now",
            min=0.0,
            max=1.0,
            feedthrough=BOTH,
        ),
        output(
            "smoothed_time",
            "s",
            "Time of the sample that the smoothed values belong to",
            nominal=0.01,
            feedthrough=BOTH,
        ),
        output("smoothed_position", "m", "Smoothed position", nominal=1e-3, feedthrough=BOTH),
        output(
            "smoothed_velocity", "m/s", "Smoothed mean velocity since the sample before", nominal=0.5, feedthrough=BOTH
        ),
        output("smoothed_flux_linkage", "Wb", "Smoothed flux linkage", nominal=0.02, feedthrough=BOTH),
        output("smoothed_current_error", "A", "Smoothed error of the model's current", nominal=0.1, feedthrough=BOTH),
        output("smoothed_force_error", "N", "Smoothed error of the model's force", feedthrough=BOTH),
        output("smoothed_position_std", "m", "Its standard deviation", min=0.0, nominal=1e-4, feedthrough=BOTH),
        output("smoothed_velocity_std", "m/s", "Its standard deviation", min=0.0, nominal=0.1, feedthrough=BOTH),
        output(
            "takeoff_time",
            "s",
            "Last sample at rest before the last motion that has landed",
            nominal=0.01,
            feedthrough=BOTH,
        ),
        output("landing_time", "s", "Landing of the last motion", nominal=0.01, feedthrough=BOTH),
        output("impact_speed", "m/s", "Speed before that landing", min=0.0, feedthrough=BOTH),
        output("bounces", "1", "How often the mover came off its stop again after it", min=0.0, feedthrough=BOTH),
        output(
            "rest_time",
            "s",
            "Last contact after it; the landing if there was no bounce",
            nominal=0.01,
            feedthrough=BOTH,
        ),
        *EKF.of("parameter"),
        parameter(
            "contact.debounce",
            "s",
            "A mover that leaves its stop and is back in this time has bounced",
            0.2e-3,
            min=0.0,
        ),
    ),
)
