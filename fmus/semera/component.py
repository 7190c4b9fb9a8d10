"""The SEMERA estimator as an FMU."""

from gapsense.estimators import semera
from gapsense.fmi.ports import Component
from gapsense.kernels.interface import ports_of

COMPONENT = Component(
    name="Semera",
    description="SEMERA: resistance, inductance and flux linkage from the coil's voltage and current",
    kernel=semera.__name__,
    ports=ports_of(semera),
    step_size=50e-6,
    survives=True,
)
