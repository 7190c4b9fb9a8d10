"""Signals of the valve of [RTS] with eddy currents and hysteresis, and what its filters believe."""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

import numpy as np
from c_code import driven, switched

from gapsense.actuators import reluctance_actuator
from gapsense.fmi.components import kernel_parameters, own
from gapsense.scenarios.estimators.parameters import VALVE, reduced
from gapsense.studies.devices import RTS_VALVE

T_S, HALF, START, CYCLES = 20e-6, 500, 50, 4  # sampling period and samples of the usual signals


class Signals(NamedTuple):
    """Samples of a square wave of 30 V, 10 ms on and 10 ms off; 2 mA of noise."""

    voltage: np.ndarray
    current: np.ndarray
    mode: np.ndarray
    position: np.ndarray
    flux_linkage: np.ndarray


@cache
def square_wave(sample_time: float = T_S) -> Signals:
    per = T_S / sample_time
    k = np.arange(round((START + CYCLES * 2 * HALF) * per)) - round(START * per)
    voltage = np.where((k >= 0) & (k % round(2 * HALF * per) < HALF * per), 30.0, 0.0)
    current, *others = driven(
        reluctance_actuator, RTS_VALVE, voltage, sample_time, "current", "mode", "position", "flux_linkage"
    ).T
    return Signals(voltage, current + 2e-3 * np.random.default_rng(1).standard_normal(k.size), *others)


def irregular(seed: int, halves: int) -> np.ndarray:
    """First samples of operations of 8 to 15 ms, and the end of the last one."""
    return START + np.r_[0, np.cumsum(np.random.default_rng(seed).integers(400, 751, halves))]


def faulty(
    first: int,
    last: int,
    halves: int = 12,
    volts: float | np.ndarray = 30.0,
    starts: np.ndarray | None = None,
    valve: Any = RTS_VALVE,
    **changes: float,
) -> Signals:
    """The square wave, or operations with other starts or supplies, with another valve in some of its halves."""
    starts = START + HALF * np.arange(halves + 1) if starts is None else starts
    k = np.arange(starts[-1])
    half = np.searchsorted(starts, k, side="right") - 1
    voltage = np.where((k >= START) & (half % 2 == 0), np.resize(volts, starts.size)[half], 0.0)
    devices, is_other = (valve, valve._replace(**changes)), (first <= half) & (half < last)
    shown = ("current", "mode", "position", "flux_linkage")
    current, *others = switched(reluctance_actuator, devices, 1 * is_other, voltage, T_S, *shown).T
    return Signals(voltage, current + 2e-3 * np.random.default_rng(2).standard_normal(k.size), *others)


def believed(memory: float | None = None, resistance: float = 1.0, sample_time: float = T_S) -> Any:
    """The parameters of the benchmark, with a factor of the resistance; `memory` 0 is the paper, None the default."""
    wrong = reduced(VALVE._replace(resistance=VALVE.resistance * resistance))
    memories = {} if memory is None else {"process.current_error_memory": memory}
    return kernel_parameters(own("ekf"), {**wrong, **memories, "sample_time": sample_time})
