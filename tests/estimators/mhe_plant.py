"""The lossy valve under a square wave, and how well `Mhe` estimates it."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from c_code import driven
from lossy_valve import HALF, START, T_S

from gapsense.actuators import reluctance_actuator
from gapsense.estimators import readings
from gapsense.studies.devices import RTS_VALVE

CYCLES, CYCLE = 6, 2 * HALF


class Plant(NamedTuple):
    """Samples of the lossy valve under a square wave."""

    voltage: np.ndarray
    current: np.ndarray
    mode: np.ndarray
    position: np.ndarray
    velocity: np.ndarray


@cache
def plant(resistance: float = 1.0) -> Plant:
    """30 V and 0 V for 10 ms each; the resistance is another one by a factor."""
    k = np.arange(START + CYCLES * CYCLE) - START
    voltage = np.where((k >= 0) & (k % CYCLE < HALF), 30.0, 0.0)
    par = RTS_VALVE._replace(coil_resistance=RTS_VALVE.coil_resistance * resistance)
    return Plant(voltage, *driven(reluctance_actuator, par, voltage, T_S, *Plant._fields[1:]).T)


def noisy(s: Plant, seed: int = 1, std: float = 2e-3) -> np.ndarray:
    return s.current + std * np.random.default_rng(seed).standard_normal(s.current.size)


class Published(NamedTuple):
    """Smoothed samples in the order in which they came."""

    at: np.ndarray  # sample at which they came
    sample: np.ndarray  # that they belong to
    position: np.ndarray


def published(found: dict[str, np.ndarray], dt: float = T_S) -> Published:
    at = np.flatnonzero(found["smoothed_published"] > 0.0)
    times = found["smoothed_time"][at] / dt
    samples = np.rint(times).astype(int)
    np.testing.assert_allclose(times, samples, atol=1e-5)
    return Published(at, samples, found["smoothed_position"][at])


class Errors(NamedTuple):
    """Root mean square errors in motion from the second cycle on [um]."""

    causal: float
    smoothed: float


def errors(found: dict[str, np.ndarray], s: Plant, first: int = START + CYCLE) -> Errors:
    smoothed = np.full(s.mode.size, np.nan)
    p = published(found)
    smoothed[p.sample] = p.position
    k = np.arange(s.mode.size)
    counts = (s.mode == 2.0) & (k >= first) & (k <= p.sample[-1])
    rms = (np.sqrt(np.mean((z - s.position)[counts] ** 2)) for z in (found["position"], smoothed))
    return Errors(*(1e6 * float(e) for e in rms))


def says(found: dict[str, np.ndarray], cause: float) -> np.ndarray:
    """Where the health names a cause."""
    return (found["health_causes"].astype(int) & int(cause)) > 0


def learnt(found: dict[str, np.ndarray], first: int = START) -> int:
    """The sample at which an operation begins after four, or six, that are explained; `health` is 0 until then."""
    told = np.flatnonzero(says(found, readings.UNLEARNT))
    last = first + told.size
    np.testing.assert_array_equal(told, np.arange(first, last))
    assert 3 * HALF < told.size <= 3 * CYCLE
    np.testing.assert_array_equal(found["health"][:last], np.arange(last) < first)
    return last


def changed(signal: np.ndarray, where: slice, value: float) -> np.ndarray:
    other = signal.copy()
    other[where] = value
    return other
