"""The moving-horizon estimator as an FMU."""

from gapsense.estimators.mhe import mhe
from gapsense.fmi.ports import Component, Limit
from gapsense.kernels.interface import ports_of

COMPONENT = Component(
    name="Mhe",
    description="Moving-horizon estimator: position from voltage and current only; learns the device from each motion",
    kernel=mhe.__name__,
    ports=ports_of(mhe),
    stop_time=2.0,
    step_size=20e-6,
    resources=("fringing_29.csv",),
    rising=(("stop.lower", "stop.upper"),),
    limits=(
        Limit(
            (("window.longest", 1), ("sample_time", -1)),
            2000.0,
            "a window has at most 2000 samples, so that the memory of 8192 holds those that wait, too",
        ),
        Limit(
            (("window.longest", 1), ("sample_time", -1), ("window.memory", -1)),
            0.5,
            "half of the samples that are kept are for those that wait; keep more, or take a shorter window",
        ),
        Limit(
            (("sample_time", 1), ("window.tail", -1)),
            0.075,
            "a motion has too few samples; sample more often, or say by a longer `window.tail` that motions are slower",
        ),
    ),
    survives=True,
)
