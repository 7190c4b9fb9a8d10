"""The conditions under which the laws are compared: what is other than on a full bridge with 2 mA of noise."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

from gapsense.drive.bridge import Kind

LEARNING = ("contact", "model")
NOTHING: Mapping[str, Any] = MappingProxyType({})
RESERVE = {"bridge_supply": 40.0, "voltage_least": -40.0, "voltage_most": 40.0}
SLOW = {"closing_travel": 4.0e-3, "opening_lead": 1.8e-3, "opening_travel": 4.6e-3}
HALF = {"bridge_kind": float(Kind.half), "bridge_frequency": 20e3, "voltage_least": 0.0, **SLOW}
WARMER = {"coil_resistance": 1.3}
WORN = {**WARMER, "spring_stiffness": 0.9, "damping": 1.5}


class Condition(NamedTuple):
    """One row of the study; names in `changes` and `drift` are those of the kernels' parameters."""

    title: str
    changes: Mapping[str, float] = NOTHING  # of all parts that have them
    drift: Mapping[str, float] = NOTHING  # factors of the plant's parameters in the last cycle
    cycles: int = 0  # 0: as many as are asked for
    width: float = 0.1  # of the errors of all parameters
    prior: float = 1.0  # of the estimator's standard deviations, that it is told
    plant: str = "reluctance_actuator"
    sample_time: float = 20e-6  # [s]
    period: float = 20e-3  # of a cycle [s]
    closed: float = 9.8e-3  # until its opening begins [s]
    fine: int = 1  # steps of drive and plant per sample; the current is integrated over them
    late: float = 0.0  # by which the contact is told late [s]
    laws: tuple[str, ...] = LEARNING  # unless others are asked for


CONDITIONS = {
    "plain": Condition("2 mA, full bridge", laws=("ordinary", "nominal", "nelder-mead", "fisher", *LEARNING)),
    "warm": Condition("R +30 % over 200 cycles, 40 V", RESERVE, WARMER, 200, laws=("nominal", "fisher", *LEARNING)),
    "worn": Condition("R +30, spring -10, damping +50 % over 200 cycles, 40 V", RESERVE, WORN, 200),
    "no-reserve": Condition("R +30 % over 200 cycles, 30 V", NOTHING, WARMER, 200),
    "half-bridge": Condition(
        "half bridge, 30 V, 20 kHz PWM, 50 us, 25 ms", HALF, sample_time=50e-6, period=25e-3, fine=10
    ),
    "noise": Condition("noise 5 mA", {"noise_current": 5e-3}),
    "late": Condition("contact late by 100 us", late=100e-6, laws=("contact",)),
    "offset": Condition("current offset +5 mA", {"offset_current": 5e-3}),
    "negative-offset": Condition("current offset -5 mA", {"offset_current": -5e-3}),
    "bounce": Condition("restitution 0.3", {"stop_restitution": 0.3}),
    "play": Condition("another plant, PlayActuator", plant="play_actuator"),
    "wrong-5": Condition("parameters wrong by 5 %", width=0.05),
    "wrong-20": Condition("parameters wrong by 20 %, 40 V", RESERVE, width=0.2, prior=2.0),
}


def drifted(condition: Condition, cycle: int, cycles: int) -> dict[str, float]:
    """Factors of the plant's parameters in a cycle."""
    share = cycle / max(1, cycles - 1)
    return {name: 1.0 + (last - 1.0) * share for name, last in condition.drift.items()}


def samples(condition: Condition) -> tuple[int, int]:
    """Samples of a cycle, and those of them with the command to close."""
    return round(condition.period / condition.sample_time), round(condition.closed / condition.sample_time)
