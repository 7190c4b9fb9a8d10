"""The extended Kalman filter as an FMU."""

from gapsense.estimators import ekf
from gapsense.fmi.ports import Component
from gapsense.kernels.interface import ports_of

COMPONENT = Component(
    name="Ekf",
    description="Extended Kalman filter: position, velocity and flux linkage from voltage, current and contact",
    kernel=ekf.__name__,
    ports=ports_of(ekf),
    step_size=20e-6,
    survives=True,
    resources=("fringing_29.csv",),
    rising=(("stop.lower", "stop.upper"),),
)
