"""The condition monitor as an FMU."""

from gapsense.estimators.monitor import monitor
from gapsense.fmi.ports import Component
from gapsense.kernels.interface import ports_of

COMPONENT = Component(
    name="Monitor",
    description="Condition of a device by what Mhe says of it: healthy or not, since when, why, and where it goes",
    kernel=monitor.__name__,
    ports=ports_of(monitor),
    step_size=20e-6,
    survives=True,
)
