"""The actuator from a table as an FMU."""

from gapsense.actuators import table_actuator
from gapsense.fmi.ports import Component, Limit
from gapsense.kernels.interface import ports_of

UNSTABLE = (
    "at 3 the anhysteretic curve of the core is vertical (alpha M_sat / (3 a) = 1), beyond it the model is unstable"
)

COMPONENT = Component(
    name="TableActuator",
    description="Actuator from a table of current over gap and flux linkage, with eddy currents, hysteresis and stops",
    kernel=table_actuator.__name__,
    ports=ports_of(table_actuator),
    step_size=20e-6,
    resources=("map.csv", "spring.csv"),
    rising=(("stop.lower", "stop.upper"),),
    limits=(Limit((("core.coupling", 1), ("core.magnetization", 1), ("core.shape", -1)), 3.0, UNSTABLE),),
)
