"""The sensor chain as an FMU."""

from gapsense.fmi.ports import Component
from gapsense.kernels.interface import ports_of
from gapsense.sensor import sensor

COMPONENT = Component(
    name="Sensor",
    description="Sensor chain: errors, noise, saturation, quantisation, sample and hold, dropouts; contact detection",
    kernel=sensor.__name__,
    ports=ports_of(sensor),
    step_size=50e-6,
    rising=(("contact.lower", "contact.upper"),),
)
