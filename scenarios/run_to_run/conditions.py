"""The conditions under which the laws are compared: what is other than on a full bridge with 2 mA of noise."""

from __future__ import annotations

from collections.abc import Mapping
from random import Random
from types import MappingProxyType
from typing import Any, NamedTuple

from gapsense.drive.drive_voltage import Kind

LEARNING = ("contact", "model")
PIECE = 50  # samples; operations of drawn lengths have a multiple of it
CHANGED = 15  # cycle of what happens once, or from then on
NOTHING: Mapping[str, Any] = MappingProxyType({})
RESERVE = {"bridge_supply": 40.0, "voltage_least": -40.0, "voltage_most": 40.0}
SLOW = {"closing_travel": 4.0e-3, "opening_lead": 1.8e-3, "opening_travel": 4.6e-3}
UNCHANGED = {"option_ahead": 0.0}  # with a half bridge, or much noise, more operations would be hard
HALF = {"bridge_kind": float(Kind.half), "bridge_frequency": 20e3, "voltage_least": 0.0, **SLOW, **UNCHANGED}
WEAK = {"voltage_least": 0.0, "voltage_most": 24.0, **SLOW, **UNCHANGED}
WARMER = {"coil_resistance": 1.3}
WORN = {**WARMER, "spring_stiffness": 0.9, "damping": 1.5}
SOFTER = {"spring_stiffness": 0.85, "damping": 0.5}


class Disturbance(NamedTuple):
    """What goes wrong between the parts."""

    supply: float = 0.0  # share by which the voltage is lower at most, drawn for each cycle
    gain: float = 1.0  # of the voltage's reading
    offset: float = 0.0  # of that [V]
    step: float = 0.0  # of the current's readings from cycle `CHANGED` on [A]
    spike: float = 0.0  # of one reading of the current, in a closing [A]
    is_missed: bool = False  # a closing without voltage


class Condition(NamedTuple):
    """One row of the study; names in `changes`, `drift` and `step` are those of the kernels' parameters."""

    title: str
    changes: Mapping[str, float] = NOTHING  # of all parts that have them, or of one: `sensor.noise_current`
    drift: Mapping[str, float] = NOTHING  # factors of the plant's parameters in the last cycle
    step: Mapping[str, float] = NOTHING  # the same from cycle `CHANGED` on
    cycles: int = 0  # 0: as many as are asked for
    width: float = 0.1  # of the errors of all parameters
    prior: float = 1.0  # of the estimator's standard deviations, that it is told
    plant: str = "reluctance_actuator"
    sample_time: float = 20e-6  # [s]
    drawn: str = "uniform"  # those errors; "normal": the width is a standard deviation
    period: float = 20e-3  # of a cycle [s]
    closed: float = 9.8e-3  # until its opening begins [s]
    lengths: tuple[float, float] | None = None  # operations are drawn from these instead [s]
    disturbance: Disturbance | None = None
    fine: int = 1  # steps of drive and plant per sample; the current is integrated over them
    late: float = 0.0  # by which the contact is told late [s]
    laws: tuple[str, ...] = LEARNING  # unless others are asked for


CONDITIONS = {
    "plain": Condition("2 mA, full bridge", laws=("ordinary", "nominal", "nelder-mead", "fisher", *LEARNING)),
    "warm": Condition(
        "R +30 % over 200 cycles, 40 V", RESERVE, WARMER, cycles=200, laws=("nominal", "fisher", *LEARNING)
    ),
    "warm-fast": Condition("R +30 % over all cycles, 40 V", RESERVE, WARMER),
    "worn": Condition("R +30, spring -10, damping +50 % over 200 cycles, 40 V", RESERVE, WORN, cycles=200),
    "no-reserve": Condition("R +30 % over 200 cycles, 30 V", NOTHING, WARMER, cycles=200),
    "half-bridge": Condition(
        "half bridge, 30 V, 20 kHz PWM, 50 us, 25 ms", HALF, sample_time=50e-6, period=25e-3, fine=10
    ),
    "noise": Condition("noise 5 mA", {"noise_current": 5e-3}),
    "late": Condition("contact late by 100 us", late=100e-6, laws=("contact", "both")),
    "offset": Condition("current offset +5 mA", {"offset_current": 5e-3}),
    "negative-offset": Condition("current offset -5 mA", {"offset_current": -5e-3}),
    "bounce": Condition("restitution 0.3", {"stop_restitution": 0.3}, laws=(*LEARNING, "both")),
    "play": Condition("another plant, PlayActuator", plant="play_actuator"),
    "wrong-5": Condition("parameters wrong by 5 %", width=0.05),
    "wrong-20": Condition("parameters wrong by 20 %, 40 V", RESERVE, width=0.2, prior=2.0),
    "lengths": Condition("operations of 9.8 to 200 ms", lengths=(9.8e-3, 0.2)),
    "missed": Condition("one closing without voltage", disturbance=Disturbance(is_missed=True)),
    "spike": Condition("one reading of the current +5 A", disturbance=Disturbance(spike=5.0)),
    "lost": Condition("one reading of the current lost", disturbance=Disturbance(spike=float("nan"))),
    "gain": Condition("voltage read 2 % too low", disturbance=Disturbance(gain=0.98)),
    "voltage-offset": Condition("voltage read 0.5 V too high", disturbance=Disturbance(offset=0.5)),
    "supply": Condition("supply up to 10 % lower, another in each cycle", disturbance=Disturbance(supply=0.1)),
    "offset-step": Condition("current offset +10 mA from cycle 15 on", disturbance=Disturbance(step=10e-3)),
    "untold-noise": Condition("noise 12 mA, told 2 mA", {"sensor.noise_current": 12e-3}, laws=(*LEARNING, "both")),
    "softer": Condition("spring -15, damping -50 % over all cycles", drift=SOFTER),
    "short": Condition("operations of 9 ms", period=18e-3, closed=9e-3),
    "slow-samples": Condition("samples of 50 us", sample_time=50e-6),
    "normal-10": Condition("parameters wrong by 10 %, normal", drawn="normal"),
    "half-24": Condition("half bridge, 24 V", WEAK, period=25e-3, closed=12e-3),
    "weak-24": Condition("half bridge, 24 V, wrong by 10 %, normal", WEAK, period=25e-3, closed=12e-3, drawn="normal"),
    "told-noise": Condition("noise 20 mA", {"noise_current": 20e-3, **UNCHANGED}),
    "rest-step": Condition("spring rest +6 % from cycle 15 on", step={"spring_rest": 1.06}),
    "damping-step": Condition("damping x 2 from cycle 15 on", step={"damping": 2.0}),
}


def factors(condition: Condition, cycle: int, cycles: int) -> dict[str, float]:
    """Factors of the plant's parameters in a cycle."""
    share = cycle / max(1, cycles - 1)
    drift = {name: 1.0 + (last - 1.0) * share for name, last in condition.drift.items()}
    return {**drift, **(condition.step if cycle >= CHANGED else {})}


def samples(condition: Condition, cycle: int = 0) -> tuple[int, int]:
    """Samples of a cycle, and those of them with the command to close."""
    if condition.lengths is None:
        return round(condition.period / condition.sample_time), round(condition.closed / condition.sample_time)
    chance, longest = Random(cycle), PIECE * condition.sample_time
    closed, opened = (PIECE * round(chance.uniform(*condition.lengths) / longest) for _ in range(2))
    return closed + opened, closed
