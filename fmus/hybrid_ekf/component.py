"""The hybrid extended Kalman filter as an FMU."""

from gapsense.estimators import hybrid_ekf
from gapsense.fmi.ports import Component
from gapsense.kernels.interface import ports_of

COMPONENT = Component(
    name="HybridEkf",
    description="Hybrid extended Kalman filter: current, position, velocity and mode of a pot magnet",
    kernel=hybrid_ekf.__name__,
    ports=ports_of(hybrid_ekf),
    stop_time=0.2,
    step_size=100e-6,
    survives=True,
)
