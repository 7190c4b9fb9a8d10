"""Temperature coefficient of the resistance: found within its error, refused in words where records do not tell it."""

from __future__ import annotations

import numpy as np
import pytest
from valve_records import record, write

from gapsense.identification.measurements.operations import estimate, operations
from gapsense.identification.measurements.reading import read_record
from gapsense.identification.temperature import (
    coefficient,
    impossible,
    temperature_notes,
    temperature_tables,
    with_temperatures,
)
from gapsense.identification.valve.show import validate_valve
from gapsense.problems import InputError
from gapsense.studies.devices import VALVE

COPPER = 3.93e-3


def at(temperatures, alpha=COPPER, seed=None, volts=30.0):
    """Records of a valve of 76 Ohm at 20 degC."""
    made = []
    for k, T in enumerate(temperatures):
        par = VALVE._replace(coil_resistance=76.0 * (1.0 + alpha * (T - 20.0)))
        made.append(record(par=par, periods=2, seed=None if seed is None else 100 * seed + k, volts=volts))
    return [each._replace(temperature=float(T)) for each, T in zip(made, temperatures)]


def found(records):
    return coefficient(records, [estimate(each, operations(each)) for each in records])


def test_coefficient_of_copper_comes_back_without_noise():
    result = found(at([23.0, 60.0, 85.0]))
    assert result.alpha.value == pytest.approx(COPPER, rel=2e-3)
    assert result.reference.value == pytest.approx(76.0, rel=1e-3)
    assert result.is_usual and result.at(60.0) == pytest.approx(76.0 * (1.0 + 40.0 * COPPER), rel=1e-3)
    assert result.temperature(result.at(47.0)) == pytest.approx(47.0)


def test_noisy_records_give_it_within_its_error():
    z = []
    for seed in range(16):
        result = found(at([18.0, 41.0, 77.0] if seed % 2 else [25.0, 70.0], seed=seed))
        z += [
            (result.alpha.value - COPPER) / result.alpha.error,
            (result.reference.value - 76.0) / result.reference.error,
        ]
        assert 1e-3 * COPPER < result.alpha.error < 0.1 * COPPER
    assert 0.5 < np.sqrt(np.mean(np.square(z))) < 1.6 and np.abs(z).max() < 5.0, z


def test_resistance_in_series_is_no_metal():
    records = at([23.0, 85.0], alpha=1.5e-3, seed=3)
    result = found(records)
    assert not result.is_usual
    assert "No metal of which coils are wound" in str(temperature_tables(records, 80.0, result)[-1])
    assert "temperature coefficient is 0.00149" in temperature_notes(80.0, result)[0]


def test_what_tells_no_coefficient_is_refused_in_words():
    records = at([20.0, 25.0])
    assert "5 K from the coldest to the hottest" in impossible(records) and found(records) is None
    assert "No temperature coefficient" in str(temperature_tables(records, 76.0, None)[0])
    assert "one record" in impossible(records[:1])
    assert "has no temperature" in impossible([records[0], records[1]._replace(temperature=None)])
    assert temperature_tables([record()], 76.0, None) == []
    for text, sentence in (
        ("20;60", "numbers in degC"), ("20", "1 found, 2 expected"), ("20,900", "900 degC"), ("20,26", "6 K from"),
    ):  # fmt: skip
        with pytest.raises(ValueError, match=sentence):
            with_temperatures(text, records)
    assert [each.temperature for each in with_temperatures("20,60", records)] == [20.0, 60.0]


def test_column_of_the_temperature_may_have_gaps_and_other_units(tmp_path):
    lines = write(tmp_path / "a.csv", seed=1).read_text("utf-8").splitlines()
    for unit, zero in (("degC", 0.0), ("\N{DEGREE SIGN}C", 0.0), ("K", 273.15)):
        rows = [f"{row},{zero + 60.0 + k % 2 if k % 10 < 2 else ''}" for k, row in enumerate(lines[1:])]
        text = "\n".join([f"{lines[0]},temperature [{unit}]", *rows])
        (tmp_path / "b.csv").write_text(text + "\n", encoding="utf-8")
        assert read_record(tmp_path / "b.csv").temperature == pytest.approx(60.5, abs=0.01)
    (tmp_path / "b.csv").write_text(text.replace("[K]", "[F]"), encoding="utf-8")
    with pytest.raises(InputError, match="`degC` is expected"):
        read_record(tmp_path / "b.csv")


def test_validation_takes_the_resistance_at_its_temperature():
    cold, warm, other = at([20.0, 80.0, 50.0])
    result = found([cold, warm])
    checks = validate_valve(VALVE, [other, other._replace(temperature=None)], result)
    assert checks[0].rms < 0.1 * checks[1].rms
