"""Port table of the integral estimator."""

from gapsense.fmi.components import load_component, own
from gapsense.fmi.ports import Component, measured, option, output, parameter, sample_time

EKF = load_component(own("ekf"))
BOTH = ("voltage", "current")

COMPONENT = Component(
    name="IntegralEstimator",
    description="Flux linkage by integration, with the resistance recalculated at the start of each operation",
    kernel="gapsense.estimators.integral",
    step_size=50e-6,
    survives=True,
    ports=(
        measured("voltage", "V", "Measured coil voltage; NaN where it was lost", nominal=30.0),
        measured("current", "A", "Measured coil current; NaN where it was lost", nominal=0.4),
        output("resistance", "Ohm", "Mean resistance of the last operation", nominal=76.0, feedthrough=BOTH),
        output("inductance", "H", "Estimated apparent inductance", nominal=0.1, feedthrough=BOTH),
        output("flux_linkage", "Wb", "Estimated flux linkage", nominal=0.02, feedthrough=BOTH),
        output(
            "quality",
            "1",
            "1: current outside the noise band; 0: inductance at rest",
            min=0.0,
            max=1.0,
            feedthrough=BOTH,
        ),
        output(
            "published",
            "1",
            "1: the estimates belong to published_time; 0: no operation to replay",
            min=0.0,
            max=1.0,
            feedthrough=BOTH,
        ),
        output(
            "published_time", "s", "Time of the sample that the estimates belong to", nominal=0.01, feedthrough=BOTH
        ),
        *(port._replace(feedthrough=BOTH) for port in EKF.of("output") if port.name.startswith("health")),
        sample_time(50e-6),
        parameter("prior.resistance", "Ohm", "Resistance until the first operation has ended", 77.5, min=1e-9),
        parameter("prior.inductance", "H", "Inductance at rest", 50e-3, min=0.0),
        parameter("prior.flux_linkage", "Wb", "Flux linkage at the start of every operation", 0.0),
        parameter("noise.current", "A", "Standard deviation of the current noise", 1e-3, min=0.0),
        parameter(
            "gate.sigmas", "1", "Half width of the noise band, in standard deviations (3.29: 99.9 %)", 3.29, min=0.0
        ),
        parameter("edge.voltage", "V", "An operation starts when the voltage rises above it", 15.0),
        option("offline", "Publish an operation after it has ended, with the resistance that it gave", False),
        *(port for port in EKF.of("parameter") if port.name in ("range.voltage", "range.current")),
    ),
)
