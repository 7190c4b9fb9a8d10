"""Port table of the soft-landing controller; mechanics, gap and coil are those of `Ekf` and `Mhe`."""

from gapsense.fmi.components import load_component, own
from gapsense.fmi.ports import Component, Limit, choice, input_, measured, output, parameter, sample_time

EKF, MHE = (load_component(own(name)) for name in ("ekf", "mhe"))
DEVICE = (
    *("coil.resistance", "coil.turns", "mover.mass", "spring.stiffness", "spring.rest", "damping"),
    *("stop.lower", "stop.upper", "core.reluctance", "gap.law", "gap.reluctance", "gap.slope", "gap.fringing"),
    *("gap.window", "gap.file"),
)
TOLD = (  # input, unit, output of `Mhe`
    ("estimated_flux_linkage", "Wb", "flux_linkage"),
    ("windows", "1", "windows"),
    ("misfit", "1", "misfit"),
    ("landing_time", "s", "landing_time"),
    ("estimated_impact_speed", "m/s", "impact_speed"),
    ("smoothed_published", "1", "smoothed_published"),
    ("smoothed_time", "s", "smoothed_time"),
    ("smoothed_flux_linkage", "Wb", "smoothed_flux_linkage"),
    ("estimated_resistance", "Ohm", "resistance"),
    ("estimated_mass", "kg", "mass"),
    ("estimated_rest_position", "m", "rest_position"),
    ("estimated_viscous_damping", "N.s/m", "viscous_damping"),
    ("estimated_gap_factor", "1", "gap_factor"),
    ("estimated_gap_bend", "1", "gap_bend"),
)
INPUTS = (
    input_("enable", "1", "0.5 or less when a closing begins: the cycle is an ordinary one", start=1.0),
    input_("command", "1", "Above 0.5: closed"),
    input_("voltage", "V", "Mean voltage since the last sample", nominal=30.0, source="drive.voltage_mean"),
    measured("current", "A", "Measured coil current", nominal=0.4),
    measured(
        "mode",
        "1",
        "Law contact: 1 at the lower stop, 2 moving, 3 at the upper stop; 0: not known",
        min=0.0,
        max=3.0,
        nominal=2.0,
    ),
    input_(
        "impact_speed",
        "m/s",
        "Law contact: speed of the landing, of the operation that ends",
        min=0.0,
        is_optional=True,
    ),
    *(input_(name, unit, f"Law model: `{said}` of `Mhe`", is_optional=True) for name, unit, said in TOLD),
)
ALL = tuple(port.name for port in INPUTS)
SHORT = "a voltage that changes so seldom does not make the mover follow its path"

COMPONENT = Component(
    name="RunToRun",
    description="Soft landing from cycle to cycle: a flux linkage that the voltage follows, learnt from each operation",
    kernel="gapsense.control.run_to_run",
    survives=True,
    stop_time=0.2,
    step_size=20e-6,
    resources=("fringing_29.csv",),
    rising=(("stop.lower", "stop.upper"), ("voltage.least", "voltage.most")),
    limits=(
        Limit((("sample_time", 1), ("closing.travel", -1)), 0.025, SHORT),
        Limit((("sample_time", 1), ("opening.travel", -1)), 0.025, SHORT),
    ),
    ports=(
        *INPUTS,
        output(
            "voltage_reference", "V", "Mean voltage that is to be until the next sample", nominal=30.0, feedthrough=ALL
        ),
        output("flux_reference", "Wb", "Flux linkage at the next sample; 0: no profile", nominal=0.02, feedthrough=ALL),
        output("flux_linkage", "Wb", "By the integral of u - R i", nominal=0.02, feedthrough=ALL),
        output("resistance", "Ohm", "Resistance R in use", nominal=48.0, feedthrough=ALL),
        output("approach_speed", "m/s", "Speed that this operation is to land with", min=0.0, feedthrough=ALL),
        output(
            "balance_flux",
            "Wb",
            "Flux linkage that balances the spring where this operation begins",
            nominal=0.02,
            feedthrough=ALL,
        ),
        output("cycle", "1", "Cycles begun so far", min=0.0, feedthrough=ALL),
        output(
            "state",
            "1",
            "0: no command yet, 1: first cycles, ordinary, 2: soft, 3: soft, but the last operation that was judged "
            "did not arrive in time, 4: ordinary cycle after that",
            min=0.0,
            max=4.0,
            feedthrough=ALL,
        ),
        output(
            "warnings",
            "1",
            "Of this cycle and the last one, a sum of 1: contact silent in an ordinary operation, 2: profile "
            "faster than the voltage allows, 4: voltage used up by the resistance, 8: estimator has explained no "
            "window, 16: a reading lost or wild, 32: the reading of the voltage has an offset, 64: a soft operation "
            "landed hard, 128: an operation landed hard or not at all, and the next ones are ordinary",
            min=0.0,
            max=255.0,
            feedthrough=ALL,
        ),
        sample_time(20e-6),
        choice("law", "What it learns from", ("contact", "model")),
        *(port for port in EKF.of("parameter") if port.name in DEVICE),
        *(port for port in MHE.of("parameter") if port.name in ("gap.factor", "gap.bend")),
        parameter("voltage.least", "V", "Least mean voltage of the bridge; 0: half bridge", -30.0),
        parameter("voltage.most", "V", "Largest mean voltage of the bridge", 30.0, min=1e-9),
        parameter("voltage.hold", "V", "Of an ordinary closing, and after a soft one", 24.0, min=1e-9),
        parameter("closing.lead", "s", "From the command until the mover is to take off", 1.5e-3, min=1e-9),
        parameter("closing.travel", "s", "Then until it is near the other stop, in the first cycle", 3.4e-3, min=1e-9),
        parameter("opening.lead", "s", "From the command until the mover is to take off", 1.2e-3, min=1e-9),
        parameter("opening.travel", "s", "Then until it is near the other stop, in the first cycle", 3.4e-3, min=1e-9),
        parameter("approach.time", "s", "Then for so long it is expected to land", 3.5e-3, min=0.0),
        parameter("approach.distance", "m", "Distance from the stop at which the approach begins", 80e-6, min=0.0),
        parameter("approach.first", "m/s", "Speed of the first approaches", 0.4, min=1e-9),
        parameter("approach.least", "m/s", "Speed of the slowest ones", 0.08, min=1e-9),
    ),
)
