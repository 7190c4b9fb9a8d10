"""The reluctance actuator as an FMU."""

from gapsense.actuators import reluctance_actuator
from gapsense.fmi.ports import Component, Limit
from gapsense.kernels.interface import ports_of

UNSTABLE = (
    "at 3 the anhysteretic curve of the core is vertical (alpha M_sat / (3 a) = 1), beyond it the model is unstable"
)
STIFF = "beyond it friction brings the mover to rest faster than the micro-steps can follow"

COMPONENT = Component(
    name="ReluctanceActuator",
    description="Reluctance actuator with eddy currents, hysteresis, saturation, fringing, spring, damping, stops",
    kernel=reluctance_actuator.__name__,
    ports=ports_of(reluctance_actuator),
    step_size=20e-6,
    resources=("fringing_29.csv",),
    rising=(("stop.lower", "stop.upper"),),
    limits=(
        Limit((("core.coupling", 1), ("core.magnetization", 1), ("core.shape", -1)), 3.0, UNSTABLE),
        Limit((("friction", 1), ("micro_step", 1), ("mover.mass", -1)), 4e-3, STIFF),
    ),
)
