"""The power stage as an FMU."""

from gapsense.drive import power_stage
from gapsense.fmi.ports import Component
from gapsense.kernels.interface import ports_of

COMPONENT = Component(
    name="PowerStage",
    description="Power stage: low-side switch with its clamp, half and full bridge, boost; a supply that sags",
    kernel=power_stage.__name__,
    ports=ports_of(power_stage),
    step_size=20e-6,
)
