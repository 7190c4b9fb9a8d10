"""The bounded unscented Kalman filter as an FMU."""

from gapsense.estimators import ukf
from gapsense.fmi.ports import Component
from gapsense.kernels.interface import ports_of

COMPONENT = Component(
    name="BoundedUkf",
    description="Bounded unscented Kalman filter: position from voltage and current, without a contact sensor",
    kernel=ukf.__name__,
    ports=ports_of(ukf),
    step_size=20e-6,
    rising=(("stop.lower", "stop.upper"),),
    resources=("fringing_19.csv",),
    survives=True,
)
