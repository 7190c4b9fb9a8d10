"""The smoothed motion as arrays, in native FMUs of FMI 3.0."""

from __future__ import annotations

from functools import cache

import pytest
from native3 import FOLDERS, Instance, fmu, placed  # noqa: F401

from gapsense.fmi.components import own
from gapsense.fmi.fmi3.variables import MOTION_ROWS, motion

ERTSS = own("ertss")
PERIOD = 20e-6
PHASES = ((3.0, 51), (2.0, 100), (1.0, 250), (2.0, 50), (3.0, 150))  # contact signal, and for how many samples
INPUTS = {3.0: (0.0, 0.01), 2.0: (30.0, 0.2), 1.0: (5.0, 0.1)}  # voltage and current


def rows() -> list[list[float]]:
    """Inputs sample by sample: the mover takes off and lands, and does so once more."""
    return [[*INPUTS[mode], mode, 0.0][: len(fmu(ERTSS).references("input"))] for mode, n in PHASES for _ in range(n)]


def signals(one: Instance) -> dict[str, list[float]]:
    """The motion as it is told."""
    count = one.get("smoothed_motion.count")
    found = {}
    for port in motion(one.fmu.component):
        values = one.get(f"smoothed_motion.{port.name.removeprefix('smoothed_')}", MOTION_ROWS)
        assert values[count:] == [0.0] * (MOTION_ROWS - count)
        found[port.name] = values[:count]
    return found


@cache
def published() -> list[dict[str, list[float]]]:
    """What is published sample by sample, motion by motion."""
    one, motions = Instance(fmu(ERTSS)), [{}, {}]  # type: ignore[var-annotated]
    one.start(rows()[0])
    found: list[dict[str, float]] = []
    for k, row in enumerate(rows()[1:]):
        one.step(row, k * PERIOD, PERIOD)
        if one.get("smoothed_published") == 1.0:
            found.append({port.name: one.get(port.name) for port in motion(one.fmu.component)})
    cut = next(k for k, (a, b) in enumerate(zip(found, found[1:]), 1) if b["smoothed_time"] - a["smoothed_time"] > 1e-4)
    for part, some in zip(motions, (found[:cut], found[cut:])):
        part.update({name: [sample[name] for sample in some] for name in found[0]})
    return motions


def test_smoothers_have_it() -> None:
    assert [folder.name for folder in FOLDERS if "smoothed_motion.count" in fmu(folder).variables] == ["ertss", "mhe"]


def test_arrays_hold_the_samples_that_are_published_one_by_one() -> None:
    first, second = published()
    one, seen = Instance(fmu(ERTSS)), []
    one.start(rows()[0])
    assert one.get("smoothed_motion.count") == 0
    for k, row in enumerate(rows()[1:]):
        one.step(row, k * PERIOD, PERIOD)
        seen.append(signals(one)) if k % 50 == 0 or k == len(rows()) - 2 else None
    assert (len(first["smoothed_time"]), len(second["smoothed_time"])) == (100, 50)
    assert first in seen and seen[-1] == second


@pytest.mark.parametrize("samples", [10, 50])
def test_long_steps_miss_no_sample(samples: int) -> None:
    one, step = Instance(fmu(ERTSS)), samples * PERIOD
    one.start(rows()[0])
    for k, row in enumerate(rows()[1::samples]):
        one.step(row, k * step, step)
    found, (_, expected) = signals(one), published()
    assert found["smoothed_time"] == pytest.approx(expected["smoothed_time"])
    assert found["smoothed_position"] == pytest.approx(expected["smoothed_position"], abs=1e-9)


def test_saved_state_holds_the_motion_and_reset_forgets_it() -> None:
    one, two = Instance(fmu(ERTSS)), Instance(fmu(ERTSS))
    one.start(rows()[0])
    for k, row in enumerate(rows()[1:]):
        one.step(row, k * PERIOD, PERIOD)
    data = one.slave.serializeFMUState(one.slave.getFMUState())
    two.slave.setFMUState(two.slave.deserializeFMUState(data))
    assert signals(two) == signals(one) and signals(two)["smoothed_time"]
    two.slave.reset()
    two.start(rows()[0])
    assert two.get("smoothed_motion.count") == 0
    reference = two.fmu["smoothed_motion.count"]
    assert "`smoothed_motion` is an output" in two.refused("setInt32", [reference], [1])
    two.slave.reset()
    assert "is an output" in two.refused("setFloat64", [reference + 1], [0.0] * MOTION_ROWS)
