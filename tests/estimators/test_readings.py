"""Every filter skips readings that are lost or wild, says so, and is back within one operation."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cache
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
import pytest
from c_code import driven
from c_code import run as run_in_c
from lossy_valve import HALF, START, believed, square_wave
from magnet_signals import exact as magnet_exact
from magnets import POT_MAGNET
from table_i import defaults

from gapsense.actuators import pot_magnet, solenoid_valve
from gapsense.estimators import ekf, ertss, hybrid_ekf, readings, ukf
from gapsense.estimators.watch import PATIENCE
from gapsense.kernels.layout import names
from gapsense.scenarios.soft_landing.rts import smooth_record
from gapsense.studies.devices import VALVE

Columns = Mapping[str, np.ndarray]


class Case(NamedTuple):
    """An estimator, its parameters, the inputs of two operations, and three samples."""

    kernel: ModuleType
    par: Any
    inputs: Columns
    position: np.ndarray
    motion: int  # in the first operation
    rest: int
    again: int  # where the next operation starts


@cache
def case(name: str) -> Case:
    return {"Ekf": _reduced, "Ertss": _reduced, "BoundedUkf": _valve, "HybridEkf": _magnet}[name](KERNELS[name])


KERNELS = {"Ekf": ekf, "Ertss": ertss, "BoundedUkf": ukf, "HybridEkf": hybrid_ekf}
SIGNALS = [(name, signal) for name in KERNELS for signal in ("voltage", "current")]
SIGNALS += [("Ekf", "mode"), ("Ertss", "mode")]
WILD = {"voltage": 1e3, "current": 10.0, "mode": 10.0}
LOSSES = {"NaN": (math.nan,), "infinity": (-math.inf,), "wild": (), "three NaN": (math.nan,) * 3}


def _reduced(kernel: ModuleType) -> Case:
    s = square_wave()
    time = {"time": 20e-6 * np.arange(s.mode.size)} if kernel is ertss else {}
    inputs = {**time, "voltage": s.voltage, "current": s.current, "mode": s.mode, "resistance": 0.0 * s.mode}
    takeoff = int(np.argmax(s.mode == 2.0))
    par = ertss.Parameters(believed(), contact_debounce=0.2e-3) if kernel is ertss else believed()
    return Case(kernel, par, inputs, s.position, takeoff + 40, START + 300, START + 2 * HALF)


def _valve(kernel: ModuleType) -> Case:
    voltage = np.where((np.arange(2050) % 1000 >= 50) & (np.arange(2050) % 1000 < 550), 30.0, 0.0)
    plant = VALVE._replace(coil_resistance=77.5, gap_law=2.0)
    current, mode, position = driven(solenoid_valve, plant, voltage, 20e-6, "current", "mode", "position").T
    inputs = {"voltage": voltage, "current": _noisy(current, 2e-3), "resistance": 0.0 * voltage}
    return Case(kernel, defaults(kernel), inputs, position, int(np.argmax(mode == 2.0)) + 20, 400, 1050)


def _magnet(kernel: ModuleType) -> Case:
    voltage = np.where((np.arange(2010) % 1000 >= 5) & (np.arange(2010) % 1000 < 505), 24.0, 0.0)
    current, mode, position = driven(pot_magnet, POT_MAGNET, voltage, 1e-4, "current", "mode", "position").T
    inputs = {"voltage": voltage, "current": _noisy(current, 1e-3)}
    return Case(kernel, magnet_exact(), inputs, position, int(np.argmax(mode == 1.0)) + 10, 400, 1005)


def _noisy(signal: np.ndarray, std: float) -> np.ndarray:
    return signal + std * np.random.default_rng(1).standard_normal(signal.size)


def run(at: Case, inputs: Columns) -> dict[str, np.ndarray]:
    """Outputs of all samples by name."""
    return dict(zip(names(at.kernel.Outputs), run_in_c(at.kernel, np.column_stack([*inputs.values()]), at.par).T))


@cache
def clean(name: str) -> dict[str, np.ndarray]:
    return run(case(name), case(name).inputs)


def disturbed(at: Case, signal: str, start: int, values: tuple[float, ...]) -> Columns:
    """The inputs with some samples of one of them replaced."""
    changed = at.inputs[signal].copy()
    changed[start : start + len(values)] = values
    return {**at.inputs, signal: changed}


def says(found: Columns, cause: float) -> np.ndarray:
    """Where the health names a cause."""
    return (found["health_causes"].astype(int) & int(cause)) > 0


def error(found: Columns, at: Case) -> float:
    """Root mean square error of the position in the next operation [m]."""
    return float(np.sqrt(np.mean((found["position"] - at.position)[at.again :] ** 2)))


@pytest.mark.parametrize("where", ["motion", "rest", "start"])
@pytest.mark.parametrize("kind", LOSSES)
@pytest.mark.parametrize(("name", "signal"), SIGNALS)
def test_a_lost_reading_is_skipped_said_and_soon_forgotten(name: str, signal: str, kind: str, where: str) -> None:
    at, values = case(name), LOSSES[kind] or (WILD[signal],)
    first = 0 if where == "start" else getattr(at, where)
    found = run(at, disturbed(at, signal, first, values))
    assert all(np.all(np.isfinite(column)) for column in found.values())
    lost = np.zeros(at.position.size, bool)
    lost[first : first + len(values)] = True
    np.testing.assert_array_equal(says(found, readings.LOST), lost)
    assert not np.any(found["health"][lost])
    assert error(found, at) < 1.001 * error(clean(name), at) + 1e-8
    assert np.abs(found["position"] - clean(name)["position"]).max() < 10e-6


@pytest.mark.parametrize("signal", ["voltage", "current", "mode"])
def test_a_lost_reading_costs_no_motion(signal: str) -> None:
    at = case("Ertss")
    found = run(at, disturbed(at, signal, at.motion, (math.nan,) * 3))
    for name in ("smoothed_published", "landing_time", "impact_speed", "smoothed_position"):
        np.testing.assert_allclose(found[name], clean("Ertss")[name], rtol=2e-2, atol=2e-6)


@pytest.mark.parametrize("signal", ["voltage", "current", "mode"])
def test_a_record_with_lost_readings_is_smoothed(signal: str) -> None:
    at = case("Ekf")
    records = [at.inputs, disturbed(at, signal, at.motion, (math.nan,) * 3)]
    whole, found = (smooth_record(inputs["voltage"], inputs["current"], inputs["mode"], at.par) for inputs in records)
    assert [o[:2] for o in found.operations] == [o[:2] for o in whole.operations]
    np.testing.assert_allclose(found.smoothed.position, whole.smoothed.position, atol=2e-6)


@pytest.mark.parametrize("name", KERNELS)
def test_nothing_but_lost_readings(name: str) -> None:
    at = case(name)
    inputs = {
        signal: values[:50] if signal == "time" else np.full(50, math.nan) for signal, values in at.inputs.items()
    }
    found = run(at, inputs)
    assert all(np.all(np.isfinite(column)) for column in found.values())
    assert np.all(found["health_causes"] == readings.LOST)


@pytest.mark.parametrize("length", [1, 3, 5])
@pytest.mark.parametrize("where", ["motion", "rest"])
@pytest.mark.parametrize("name", ["Ekf", "Ertss", "HybridEkf"])
def test_a_wild_current_within_the_range_is_skipped(name: str, where: str, length: int) -> None:
    at = case(name)
    first = getattr(at, where)
    found = run(at, disturbed(at, "current", first, (1.5,) * length))
    assert np.flatnonzero(says(found, readings.LOST)).tolist() == list(range(first, first + length))
    assert error(found, at) < 1.001 * error(clean(name), at) + 1e-8


@pytest.mark.parametrize("name", ["Ekf", "HybridEkf"])
def test_a_model_that_is_wrong_does_not_shut_the_measurements_out(name: str) -> None:
    at = case(name)
    start = at.rest
    found = run(at, disturbed(at, "current", start, (1.5,) * 100))
    skipped = says(found, readings.LOST)[start : start + 100]
    assert skipped[: int(PATIENCE) + 1].tolist() == [True] * int(PATIENCE) + [False]
    assert skipped.sum() <= 4 * PATIENCE
    assert np.all(says(found, readings.INNOVATION)[start + 20 : start + 30])


def test_the_limit_of_the_current_follows_the_coil() -> None:
    assert readings.most_current(0.0, 100.0, 48.0) == 2.0 * 100.0 / 48.0
    assert readings.most_current(5.0, 100.0, 48.0) == 5.0
