"""The soft-landing controller as an FMU."""

from gapsense.control import run_to_run
from gapsense.fmi.ports import Component, Limit
from gapsense.kernels.interface import ports_of

SHORT = "a voltage that changes so seldom does not make the mover follow its path"

COMPONENT = Component(
    name="RunToRun",
    description="Soft landing from cycle to cycle: a flux linkage that the voltage follows, learnt from each operation",
    kernel=run_to_run.__name__,
    ports=ports_of(run_to_run),
    survives=True,
    stop_time=0.2,
    step_size=20e-6,
    resources=("fringing_29.csv",),
    rising=(("stop.lower", "stop.upper"), ("voltage.least", "voltage.most")),
    limits=(
        Limit((("sample_time", 1), ("closing.travel", -1)), 0.025, SHORT),
        Limit((("sample_time", 1), ("opening.travel", -1)), 0.025, SHORT),
    ),
)
