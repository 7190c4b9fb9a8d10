"""What a record can give, told before anything is fitted."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from valve_records import record

from gapsense.report.plot import suited
from gapsense.studies.identification.checks import read_record
from gapsense.studies.inspection.facts import facts, levels

RECORDS = Path(__file__).parent / "records"


@pytest.mark.parametrize(("file", "ohms"), [("tube-150-raw.csv", 0.371), ("empty-162-raw.csv", 0.372)])
def test_one_discharge_gives_resistance_flux_and_inductance(file, ohms):
    found = facts(read_record(RECORDS / file))
    (pulse,) = found.pulses
    assert pulse.resistance == pytest.approx(ohms, rel=0.01)
    assert pulse.kink is None and found.incomplete == 0
    assert [found.signals[name].step for name in ("current", "voltage")] == pytest.approx([4.0, 2.0])


def test_inductance_without_iron_is_constant_and_with_iron_is_not():
    empty, tube = (facts(read_record(RECORDS / f"{name}.csv")).pulses[0] for name in ("empty-162-raw", "tube-150-raw"))
    assert empty.inductance == pytest.approx(288e-6, rel=0.02)
    assert tube.bend > 1.7 * empty.bend


def test_clamp_is_a_level_and_the_last_pulse_is_incomplete():
    measured = read_record(RECORDS / "synthetic-flyback-clamp.csv")
    assert levels(measured.voltage) == pytest.approx([-40.0, 0.0, 24.0], abs=0.1)
    found = facts(measured)
    assert len(found.pulses) == 4 and found.incomplete == 1


@pytest.mark.parametrize("seed", [1, 2])
def test_landing_of_a_mover_is_a_kink(seed):
    found = facts(record(seed=seed))
    assert [p.kink is not None for p in found.pulses] == [True, True]
    assert found.pulses[0].kink == pytest.approx(1.3e-3, abs=0.3e-3)  # the mover has begun to move


@pytest.mark.parametrize(
    ("largest", "label", "factor"), [(244.0, "current / A", 1.0), (0.4, "current / mA", 1e3), (0.0, "current / A", 1.0)]
)
def test_axes_have_units_that_suit_the_values(largest, label, factor):
    text, scale = suited("current", "A", np.array([0.0, -largest]), np.array([np.nan, 0.5 * largest]))
    assert text == label and scale == pytest.approx(factor)
