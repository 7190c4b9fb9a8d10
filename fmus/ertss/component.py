"""The extended Rauch-Tung-Striebel smoother as an FMU."""

from gapsense.estimators import ertss
from gapsense.fmi.ports import Component
from gapsense.kernels.interface import ports_of

COMPONENT = Component(
    name="Ertss",
    description="Extended RTS smoother: each motion again after its landing, with landing time and impact speed",
    kernel=ertss.__name__,
    ports=ports_of(ertss),
    step_size=20e-6,
    survives=True,
    resources=("fringing_29.csv",),
    rising=(("stop.lower", "stop.upper"),),
)
