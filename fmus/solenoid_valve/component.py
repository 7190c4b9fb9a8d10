"""The solenoid valve as an FMU."""

from gapsense.actuators import solenoid_valve
from gapsense.fmi.ports import Component
from gapsense.kernels.interface import ports_of

COMPONENT = Component(
    name="SolenoidValve",
    description="Solenoid valve with magnetic saturation, spring, damping and stops",
    kernel=solenoid_valve.__name__,
    ports=ports_of(solenoid_valve),
    resources=("fringing_19.csv",),
    rising=(("stop.lower", "stop.upper"),),
)
