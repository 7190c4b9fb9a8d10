"""The actuator of another physics as an FMU."""

from gapsense.actuators import play_actuator
from gapsense.fmi.ports import Component
from gapsense.kernels.interface import ports_of

COMPONENT = Component(
    name="PlayActuator",
    description="Reluctance actuator of another physics: hysteresis of play elements, two poles of eddy currents",
    kernel=play_actuator.__name__,
    ports=ports_of(play_actuator),
    step_size=20e-6,
    rising=(("stop.lower", "stop.upper"),),
)
