"""The contenders of the benchmark, one entry each.

What is measured and shown follows from them, and so do the files of the scenario, which `scenario.write` writes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

from gapsense.tables import Value

from .parameters import VALVE, Valve, blind, coil, core, magnet, reduced, reduced_core, tabulated, tabulated_core

MOTION = {name: name for name in ("position", "velocity")}
REAL_TIME = {**MOTION, "flux_linkage": "flux_linkage"}
SMOOTHED = {quantity: f"smoothed_{signal}" for quantity, signal in REAL_TIME.items()}
ELECTRIC = {name: name for name in ("flux_linkage", "resistance")}
MEASURED = {"voltage": "sensor.voltage_measured", "current": "sensor.current_measured"}
WITH_MODEL: dict[str, str | float] = {**MEASURED, "resistance": 0.0}  # they believe their parameter
WITH_CONTACT = {**WITH_MODEL, "mode": "sensor.mode_measured"}
NOISES = ("noise.voltage", "noise.current")
CURRENT = NOISES[1:]
MODEL = "all parameters"
LOSSES = f"{MODEL}, core losses"
FROM_SEMERA = {"resistance": "semera.resistance"}
WIRED = {**WITH_CONTACT, **FROM_SEMERA}
CONTACT = f"{MODEL}; contact sensor"
CORE: Mapping[str, Value] = core(VALVE)
TUNED: dict[str, Value] = {
    "option.tuning": "own",
    "process.flux_linkage": 100e-6,
    "process.position": 20e-9,
    "process.current_error": 2e-3,
    "process.limit": 2.0,
}


class Contender(NamedTuple):
    """An estimator of the benchmark; several may be the same FMU with other options or other wires."""

    label: str
    component: str  # its name in the scenario, and of its numbers
    gives: Mapping[str, str]  # signal by quantity
    needs: str  # beside voltage and current
    fmu: str = ""
    file: str = ""  # its parameter set, in the scenario's folder `parameters`
    told: Callable[[Valve], Mapping[str, float]] = lambda valve: {}  # parameters by what is believed of the valve
    noises: tuple[str, ...] = NOISES  # parameters that follow the noise of the sensor
    wires: Mapping[str, str | float] = MEASURED  # by input: signal of the sensor or another contender, or a constant
    options: Mapping[str, Value] = {}  # parameters beside those of its set
    published: str = ""  # signal that is 1 in samples that are about `time`
    time: str = ""
    is_lift: bool = False  # the position counts from the upper stop down
    shared: str = ""  # component that it looks at, where it has none of its own
    is_commissioned: bool = False  # it has a parameter set for each device

    @property
    def source(self) -> str:
        """The component in the scenario that gives its signals."""
        return self.shared or self.component

    def signals(self) -> list[str]:
        """What it gives, and what says which sample that is about."""
        return [signal for signal in (*self.gives.values(), self.published, self.time) if signal]


BOUNDED_UKF = Contender(
    label="BoundedUkf",
    component="bounded_ukf",
    gives=REAL_TIME,
    needs=MODEL,
    fmu="BoundedUkf",
    file="bounded_ukf",
    told=tabulated,
    wires=WITH_MODEL,
)
EKF = Contender(
    label="Ekf",
    component="ekf",
    gives=REAL_TIME,
    needs=CONTACT,
    fmu="Ekf",
    file="reduced",
    told=reduced,
    noises=CURRENT,
    wires=WITH_CONTACT,
)
ERTSS = EKF._replace(
    label="Ertss", component="ertss", fmu="Ertss", gives=SMOOTHED, published="smoothed_published", time="smoothed_time"
)
INTEGRAL = Contender(
    label="Integral",
    component="integral",
    gives=ELECTRIC,
    needs="R, periodic drive",
    fmu="IntegralEstimator",
    file="integral",
    told=coil,
    noises=CURRENT,
)
OFFLINE = INTEGRAL._replace(options={"offline": True}, published="published", time="published_time")
MHE = Contender(
    label="Mhe",
    component="mhe",
    gives={**REAL_TIME, "resistance": "resistance"},
    needs=f"{MODEL}, roughly",
    fmu="Mhe",
    file="mhe",
    told=blind,
)
MHE = MHE._replace(wires={**MEASURED, "command": 0.0})
COMMISSIONED = MHE._replace(
    label="Mhe commissioned",
    component="mhe_commissioned",
    needs="one record",
    file="mhe_commissioned",
    told=lambda valve: {},
    is_commissioned=True,
)
CORE_UKF = BOUNDED_UKF._replace(needs=LOSSES, told=tabulated_core, options=CORE)


def with_losses(c: Contender) -> Contender:
    """`Ekf` or `Ertss` that knows them, and so leaves a tenth of the usual errors to the current; R is wired."""
    return c._replace(
        label=f"{c.label}, R wired, core losses",
        component=f"{c.component}_wired_losses",
        needs=f"{LOSSES}; contact sensor",
        told=reduced_core,
        wires=WIRED,
        options={**CORE, "process.current_error": 0.2e-3},
    )


def smoothed(c: Contender) -> Contender:
    """What the same `Mhe` says after a motion."""
    return c._replace(
        label=f"{c.label} smoothed",
        component=f"{c.component}_smoothed",
        shared=c.component,
        gives=SMOOTHED,
        published="smoothed_published",
        time="smoothed_time",
    )


CONTENDERS = (
    BOUNDED_UKF._replace(
        label="open loop", component="open_loop", needs=f"{MODEL}; no current", options={"option.filter": "open_loop"}
    ),
    BOUNDED_UKF,
    BOUNDED_UKF._replace(label="BoundedUkf, tuned", component="bounded_ukf_tuned", options=TUNED),
    Contender(
        label="HybridEkf",
        component="hybrid_ekf",
        gives=MOTION,
        needs=MODEL,
        fmu="HybridEkf",
        file="hybrid_ekf",
        told=magnet,
        noises=(),
        is_lift=True,
    ),
    EKF,
    ERTSS,
    ERTSS._replace(label="Ertss without e_i", component="no_current_error", options={"option.current_error": False}),
    Contender(
        label="Semera",
        component="semera",
        gives=ELECTRIC,
        needs="R, rest inductance",
        fmu="Semera",
        file="semera",
        told=coil,
    ),
    INTEGRAL,
    OFFLINE._replace(label="Integral offline", component="integral_offline", needs="periodic drive"),
    CORE_UKF._replace(
        label="open loop, core losses",
        component="open_loop_losses",
        needs=f"{LOSSES}; no current",
        options={"option.filter": "open_loop", **CORE},
    ),
    CORE_UKF._replace(
        label="BoundedUkf, R wired, core losses",
        component="bounded_ukf_wired_losses",
        wires={**WITH_MODEL, **FROM_SEMERA},
    ),
    EKF._replace(label="Ekf, R wired", component="ekf_wired", wires=WIRED),
    ERTSS._replace(label="Ertss, R wired", component="ertss_wired", wires=WIRED),
    with_losses(EKF),
    with_losses(ERTSS),
    MHE,
    smoothed(MHE),
    COMMISSIONED,
    smoothed(COMMISSIONED),
)
