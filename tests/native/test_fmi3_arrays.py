"""Tables as array parameters, and covariances as array outputs, of native FMUs of FMI 3.0."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from native3 import FOLDERS, Instance, bits, fmu, placed, reference  # noqa: F401

from gapsense.fmi.components import kernel_of, load_component, own
from gapsense.fmi.fmi3.variables import shapes

DRIVE, EKF = own("drive_voltage"), own("ekf")
TIMES, VOLTS = [0.0, 0.01, 0.02, 0.03, 0.05], [1.0, 5.0, -2.0, 0.1, 3.0]


def with_table(rows: int | None = None, **values: Any) -> Instance:
    """A drive that plays its table, with another number of rows, and values of `table.file.*`."""
    instance = Instance(fmu(DRIVE))
    if rows is not None:
        instance.slave.enterConfigurationMode()
        instance.set({"table.file.rows": rows})
        instance.slave.exitConfigurationMode()
    instance.set({"waveform": 3})
    instance.set({f"table.file.{name}": value for name, value in values.items()})
    return instance


def played(instance: Instance, steps: int = 40, step: float = 1e-3) -> list[list[float]]:
    inputs = [1.0, 0.0]
    return [instance.start(inputs), *(instance.step(inputs, k * step, step) for k in range(steps))]


def from_file(path: Path, times: Sequence[float], volts: Sequence[float]) -> Instance:
    """The drive with the same table in a file."""
    path.write_text("time,voltage\n" + "".join(f"{t!r},{v!r}\n" for t, v in zip(times, volts)))
    instance = Instance(fmu(DRIVE))
    instance.set({"waveform": 3, "table.file": str(path)})
    return instance


@pytest.mark.parametrize("rows", [2, 3, 5, 40])
def test_arrays_are_the_table_as_a_file_with_the_same_numbers_is(tmp_path: Path, rows: int) -> None:
    times, volts = [0.001 * k * k for k in range(rows)], [30.0 / (1 + k) for k in range(rows)]
    expected = played(from_file(tmp_path / "own.csv", times, volts))
    one = with_table(rows, time=times, voltage=volts)
    assert bits(played(one)) == bits(expected)
    assert one.get("table.file.time", rows) == times and one.get("table.file.rows") == rows


def test_shipped_numbers_that_a_tool_sets_again_change_nothing(tmp_path: Path) -> None:
    names = {name: v for name, v in fmu(DRIVE).variables.items() if name.startswith("table.file.") and v.dimensions}
    again = {name: [float(word) for word in v.start.split()] for name, v in names.items()}
    plain, one = with_table(), with_table()
    one.set(again)
    assert bits(played(one)) == bits(played(plain))
    file = from_file(tmp_path / "own.csv", TIMES, VOLTS)
    file.set(again)
    assert bits(played(file)) == bits(played(from_file(tmp_path / "own.csv", TIMES, VOLTS)))


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"time": [0.0, 1.0, 0.5]}, "`table.file`: its arrays: row 3: `time` decreases from 1 to 0.5. Correct them."),
        ({"voltage": [0.0, float("nan"), 1.0]}, "row 2: `voltage` is `nan`, not a finite number"),
        ({"time": [1.0, 1.0, 1.0]}, "different `time` are needed"),
        ({}, ""),
    ],
)
def test_wrong_arrays_are_told_with_other_parameters(values: dict[str, Any], words: str) -> None:
    given = {"time": [0.0, 0.1, 0.2], "voltage": [0.0, 1.0, 2.0], **values}
    one = with_table(3, **given)
    one.set({"pwm.high": -1.0})
    one.slave.enterInitializationMode(startTime=0.0)
    text = one.refused("exitInitializationMode")
    assert words in text and "`pwm.low`" in text


def test_rows_without_numbers_are_refused() -> None:
    one = with_table(7)
    one.slave.enterInitializationMode(startTime=0.0)
    text = one.refused("exitInitializationMode")
    assert "row 6: `time` is `nan`" in text and "row 7: `voltage` is `nan`" in text


def test_spline_needs_rows_and_rising_columns() -> None:
    one = Instance(fmu(EKF))
    one.slave.enterConfigurationMode()
    one.set({"gap.file.rows": 3})
    one.slave.exitConfigurationMode()
    one.set({"gap.law": 1, "gap.file.gap": [0.0, 1e-3, 2e-3], "gap.file.reluctance": [1.0, 2.0, 1.5]})
    one.slave.enterInitializationMode(startTime=0.0)
    text = one.refused("exitInitializationMode")
    assert "row 3: `reluctance` decreases from 2 to 1.5; 3 rows, but at least 4" in text


def test_file_and_arrays_both_changed_are_refused(tmp_path: Path) -> None:
    one = from_file(tmp_path / "own.csv", TIMES, VOLTS)
    one.set({"table.file.voltage": [1.0] * 5})
    one.slave.enterInitializationMode(startTime=0.0)
    assert "`table.file`: both the file and the arrays differ from" in one.refused("exitInitializationMode")


@pytest.mark.parametrize("rows", [0, 1, 1_000_001, 2**63])
def test_number_of_rows_has_limits(rows: int) -> None:
    one = Instance(fmu(DRIVE))
    one.slave.enterConfigurationMode()
    text = one.refused("setUInt64", [one.fmu["table.file.rows"]], [rows])
    assert "`table.file.rows` is" in text and "expected 2 to 1e+06" in text


def test_number_of_rows_is_set_in_the_configuration_mode_only() -> None:
    one = Instance(fmu(DRIVE))
    assert "only in `configuring`" in one.refused("setUInt64", [one.fmu["table.file.rows"]], [3])
    one.slave.reset()
    one.slave.enterConfigurationMode()
    assert one.get("table.file.rows") == 5
    assert "`configuring`" in one.refused("setFloat64", [one.fmu["table.file.time"]], TIMES)


def test_array_has_the_new_length_and_is_fixed_in_a_run() -> None:
    one = with_table(3)
    assert "these variables have 3 values" in one.refused("setFloat64", [one.fmu["table.file.time"]], TIMES)
    one = with_table(5, time=TIMES, voltage=VOLTS)
    one.start()
    assert "`table.file.time` is fixed" in one.refused("setFloat64", [one.fmu["table.file.time"]], TIMES)


def test_scalars_and_arrays_go_together() -> None:
    one = with_table()
    references = [one.fmu[name] for name in ("square.low", "table.file.time", "enable", "table.file.voltage")]
    one.slave.setFloat64(references, [0.25, *TIMES, 1.0, *VOLTS])
    one.slave.enterInitializationMode(startTime=0.0)
    assert one.slave.getFloat64(references, 12) == [0.25, *TIMES, 1.0, *VOLTS]


@pytest.mark.parametrize("is_running", [False, True])
def test_saved_state_holds_arrays(is_running: bool) -> None:
    one, plain = with_table(3, time=[0.0, 0.01, 0.05], voltage=[1.0, 2.0, 3.0]), with_table()
    expected = played(with_table(3, time=[0.0, 0.01, 0.05], voltage=[1.0, 2.0, 3.0]))
    if is_running:
        one.start([1.0, 0.0])
    state = one.slave.getFMUState()
    data = one.slave.serializeFMUState(state)
    plain.slave.setFMUState(plain.slave.deserializeFMUState(data))
    one.slave.reset()
    assert bits(played(one)) != bits(expected)
    one.slave.reset()
    one.slave.setFMUState(state)
    for instance in (one, plain):
        if is_running:
            found = [instance.step([1.0, 0.0], k * 1e-3, 1e-3) for k in range(40)]
            assert bits(found) == bits(expected[1:])
        else:
            assert bits(played(instance)[1:]) == bits(expected[1:])


WITH_COVARIANCE = [folder for folder in FOLDERS if shapes(kernel_of(load_component(folder)))]


def test_estimators_with_a_covariance_in_their_state_show_it() -> None:
    assert [folder.name for folder in WITH_COVARIANCE] == ["bounded_ukf", "ekf", "ertss", "hybrid_ekf", "semera"]


@pytest.mark.parametrize("folder", WITH_COVARIANCE, ids=lambda folder: folder.name)
def test_covariance_is_symmetric_and_its_diagonal_are_the_squared_deviations(folder: Path) -> None:
    own_fmu, run = fmu(folder), reference(folder)
    (shape,) = shapes(kernel_of(own_fmu.component))
    one, n = Instance(own_fmu), shape.size
    is_predicted = shape.name != "covariance"  # then it is that of the next sample, larger than what is shown
    for k in range(len(run.inputs)):
        one.start(run.inputs[0]) if k == 0 else one.step(run.inputs[k], (k - 1) * run.step, run.step)
        values = one.get(shape.name, n * n)
        assert all(values[i * n + j] == values[j * n + i] for i in range(n) for j in range(n))
        for i, name in enumerate(shape.of):
            std = one.get(f"{name.removesuffix('_estimated')}_std")
            if not is_predicted:
                assert max(values[i * n + i], 0.0) == pytest.approx(std * std, rel=1e-6, abs=1e-24)
            else:
                assert values[i * n + i] > 0.0


def test_covariance_is_that_of_the_inputs_during_initialization() -> None:
    one = Instance(fmu(EKF))
    one.set({"prior.flux_linkage_std": 2e-3})
    one.slave.enterInitializationMode(startTime=0.0)
    assert one.get("covariance", 25)[12] == pytest.approx(4e-6)
    one.set({"prior.flux_linkage_std": 3e-3})
    assert one.get("covariance", 25)[12] == pytest.approx(9e-6)
