"""The integral estimator as an FMU."""

from gapsense.estimators import integral
from gapsense.fmi.ports import Component
from gapsense.kernels.interface import ports_of

COMPONENT = Component(
    name="IntegralEstimator",
    description="Flux linkage by integration, with the resistance recalculated at the start of each operation",
    kernel=integral.__name__,
    ports=ports_of(integral),
    step_size=50e-6,
    survives=True,
)
