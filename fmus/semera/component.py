"""Port table of the SEMERA estimator."""

from gapsense.fmi.components import load_component, own
from gapsense.fmi.ports import Component, measured, option, output, parameter, sample_time

EKF = load_component(own("ekf"))
BOTH = ("voltage", "current")

COMPONENT = Component(
    name="Semera",
    description="SEMERA: resistance, inductance and flux linkage from the coil's voltage and current",
    kernel="gapsense.estimators.semera",
    step_size=50e-6,
    survives=True,
    ports=(
        measured("voltage", "V", "Measured coil voltage; NaN where it was lost", nominal=30.0),
        measured("current", "A", "Measured coil current; NaN where it was lost", nominal=0.4),
        output("resistance", "Ohm", "Estimated coil resistance", nominal=76.0, feedthrough=BOTH),
        output("inductance", "H", "Estimated apparent inductance", nominal=0.1, feedthrough=BOTH),
        output("flux_linkage", "Wb", "Estimated flux linkage", nominal=0.02, feedthrough=BOTH),
        output(
            "quality",
            "1",
            "1: current outside the noise band; 0: estimates follow the expert rule",
            min=0.0,
            max=1.0,
            feedthrough=BOTH,
        ),
        output(
            "resistance_std", "Ohm", "Standard deviation of the resistance in the filter", min=0.0, feedthrough=BOTH
        ),
        output(
            "inductance_std", "H", "Standard deviation of the inductance in the filter", nominal=0.01, feedthrough=BOTH
        ),
        output("innovation", "V", "Measured minus predicted voltage", feedthrough=BOTH),
        output("innovation_std", "V", "Standard deviation expected of the innovation", feedthrough=BOTH),
        output("flux", "Wb", "Estimated flux; 0 while coil.turns is 0", nominal=2e-5, feedthrough=BOTH),
        output("reluctance", "1/H", "Estimated reluctance; 0 while coil.turns is 0", nominal=1e7, feedthrough=BOTH),
        *(port._replace(feedthrough=BOTH) for port in EKF.of("output") if port.name.startswith("health")),
        sample_time(50e-6),
        parameter("prior.resistance", "Ohm", "Expected resistance at the start", 77.5, min=1e-9),
        parameter("prior.resistance_std", "Ohm", "Its standard deviation", 1.0, min=0.0),
        parameter("prior.inductance", "H", "Expected inductance at rest", 50e-3, min=0.0),
        parameter("prior.inductance_std", "H", "Its standard deviation", 5e-3, min=0.0),
        parameter("process.resistance_rate", "Ohm/s", "Standard deviation of the resistance's rate", 1.0, min=0.0),
        parameter("process.inductance_acceleration", "H/s2", "Standard deviation of d2l/dt2", 1e8, min=0.0),
        parameter("noise.voltage", "V", "Standard deviation of the voltage noise", 15e-3, min=0.0),
        parameter("noise.current", "A", "Standard deviation of the current noise", 1e-3, min=0.0),
        parameter(
            "gate.sigmas", "1", "Half width of the noise band, in standard deviations (3.29: 99.9 %)", 3.29, min=0.0
        ),
        option("gate.update", "Noise-only samples update the filter while it sleeps, too", True),
        parameter(
            "gate.decay",
            "s",
            "Time after an operation until the filter falls asleep and learns no more from noise; 0: never, as printed",
            5e-3,
            min=0.0,
        ),
        *(port for port in EKF.of("parameter") if port.name in ("range.voltage", "range.current")),
        parameter("coil.turns", "1", "Number of turns, for flux and reluctance; 0: unknown", 0.0, min=0.0),
    ),
)
