"""Port table of the moving-horizon estimator; the mechanics, the gap and the coil are those of `Ekf`."""

from gapsense.fmi.components import load_component, own
from gapsense.fmi.ports import Component, Limit, Port, input_, measured, option, output, parameter

EKF = load_component(own("ekf"))
ALL = ("voltage", "current", "command")
GROUPS = ("sample_time", "coil", "mover", "spring", "damping", "stop", "core", "gap", "range", "noise")
OTHERS = ("gap.tilt", "range.innovation", "core.eddy", "core.hysteresis", "core.turnover")  # not here, or not the same
LEARNT = (  # output, prior, unit, what it is, relative deviation before the first window
    ("resistance", "resistance", "Ohm", "Resistance R", 0.15),
    ("eddy", "eddy", "S", "Eddy currents g_e", 0.5),
    ("gap_factor", "gap", "1", "Factor of the gap reluctance", 0.04),
    ("knee", "knee", "A", "Knee b of the core", 0.4),
    ("saturation", "saturation", "Wb", "Flux linkage of saturation", 0.06),
    ("hysteresis", "hysteresis", "A", "Amplitude I_h of the hysteresis", 1.0),
    ("mass", "mass", "kg", "Mass of the mover", 0.04),
    ("rest_position", "rest", "m", "Position without spring force", 0.04),
    ("viscous_damping", "damping", "N.s/m", "Viscous damping", 0.1),
    ("core_reluctance", "core", "1/H", "Reluctance R_c of the core without its knee, over N^2", 0.2),
    ("gap_bend", "bend", "1", "Bend of the gap law, zero at both stops", 0.1),
)


def said(name: str, unit: str, description: str, **more: float) -> Port:
    """An output: the causal ones follow the voltage, and what is not new is published with them."""
    return output(name, unit, description, feedthrough=ALL, **more)


COMPONENT = Component(
    name="Mhe",
    description="Moving-horizon estimator: position from voltage and current only; learns the device from each motion",
    kernel="gapsense.estimators.mhe.mhe",
    stop_time=2.0,
    step_size=20e-6,
    resources=("fringing_29.csv",),
    rising=(("stop.lower", "stop.upper"),),
    limits=(
        Limit(
            (("window.longest", 1), ("sample_time", -1)),
            2000.0,
            "the memory of 4096 samples could not hold two windows",
        ),
        Limit(
            (("sample_time", 1), ("window.tail", -1)),
            0.075,
            "a motion has too few samples; sample more often, or say by a longer `window.tail` that motions are slower",
        ),
    ),
    survives=True,
    ports=(
        measured("voltage", "V", "Measured coil voltage; NaN where it was lost", nominal=30.0),
        measured("current", "A", "Measured coil current; NaN where it was lost", nominal=0.4),
        input_("command", "1", "With option.command: a window ends where this changes; any number", is_optional=True),
        said("position", "m", "Causal estimate of the position", nominal=1e-3),
        said("velocity", "m/s", "Its velocity", nominal=0.5),
        said("flux_linkage", "Wb", "Causal estimate of the flux linkage", nominal=0.02),
        said("mode", "1", "1: at the lower stop, 2: moving, 3: at the upper stop", min=1.0, max=3.0),
        said("innovation", "A", "Measured current minus that of the causal estimate", nominal=1e-2),
        *(port._replace(feedthrough=ALL) for port in EKF.of("output") if port.name.startswith("health")),
        said(
            "smoothed_published",
            "1",
            "1: smoothed values of the sample at smoothed_time; 0: the causal ones, now",
            min=0.0,
            max=1.0,
        ),
        said("smoothed_time", "s", "Time of the sample that the smoothed values belong to", nominal=0.01),
        said("smoothed_position", "m", "Smoothed position", nominal=1e-3),
        said("smoothed_velocity", "m/s", "Smoothed mean velocity since the sample before", nominal=0.5),
        said("smoothed_flux_linkage", "Wb", "Smoothed flux linkage", nominal=0.02),
        said("takeoff_time", "s", "Last sample at rest before the last motion that was solved", nominal=0.01),
        said("landing_time", "s", "Its first landing", nominal=0.01),
        said("impact_speed", "m/s", "Speed before that landing", min=0.0),
        said("bounces", "1", "Landings after the first one in the same window", min=0.0),
        said("windows", "1", "Windows solved so far", min=0.0),
        said("misfit", "1", "Cost of the last window over what noise and model error make", min=0.0),
        *(said(name, unit, what) for name, _, unit, what, _ in LEARNT),
        *(said(f"{name}_std", unit, "Its standard deviation", min=0.0) for name, _, unit, _, _ in LEARNT),
        *(p for p in EKF.of("parameter") if p.name.split(".")[0] in GROUPS and p.name not in OTHERS),
        parameter("core.eddy", "S", "Eddy currents, k_eddy / N^2; a guess, see prior.eddy", 0.5e-3, min=1e-9),
        parameter(
            "core.hysteresis", "A", "Largest current of hysteresis; a guess, see prior.hysteresis", 5e-3, min=1e-9
        ),
        parameter("core.turnover", "Wb", "Flux linkage in which hysteresis turns over", 1.8e-3, min=1e-9),
        parameter("gap.factor", "1", "Factor of the gap reluctance", 1.0, min=1e-9),
        parameter("gap.bend", "1", "Bend of the gap law, zero at both stops", 0.0),
        option("option.further", "Learn damping, core reluctance and bend of the gap law too", False),
        option("option.command", "A window ends where the input command changes, not after a landing", False),
        option("option.mean", "The voltage is the mean since the last sample: that of a held or switched one", False),
        option("option.zero", "The current that is left after `window.tail` without voltage is an offset", False),
        parameter("noise.voltage", "V", "Standard deviation of the voltage noise", 0.03, min=0.0),
        parameter("model.error", "A", "Standard deviation of the model's error of the current", 1e-3, min=0.0),
        parameter("edge", "V", "A voltage that changes by more is an edge: the current does not count", 1.0, min=1e-9),
        parameter("window.tail", "s", "Time at rest after a landing until the window ends", 2e-3, min=1e-9),
        parameter("window.longest", "s", "Longest window; at most 2000 samples", 20e-3, min=1e-9),
        parameter(
            "window.pace",
            "1",
            "Pieces of the work on a window in a step; 0: by the sample time",
            0.0,
            min=0.0,
            max=64.0,
        ),
        parameter("publish.within", "s", "Age beyond which a sample is not published; 0: all are", 0.0, min=0.0),
        *(
            parameter(f"prior.{prior}", "1", f"{what}: relative deviation before the first window", start, min=0.0)
            for _, prior, _, what, start in LEARNT
            if start
        ),
        parameter("health.limit", "1", "Largest misfit; good windows have less than 1", 3.0, min=0.0),
    ),
)
