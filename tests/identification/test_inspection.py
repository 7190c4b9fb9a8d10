"""What a record can give, told before anything is fitted."""

from __future__ import annotations

from pathlib import Path
from time import process_time

import numpy as np
import pytest
from imperfect_records import Condition
from imperfect_records import record as imperfect
from valve_records import write

from gapsense.identification.inspection.facts import WHITE, facts, fall, levels, signal
from gapsense.identification.inspection.show import checklist, curve, of_resistances, remarks
from gapsense.identification.measurements.prepare import subtract_offsets
from gapsense.identification.measurements.reading import read_record
from gapsense.identification.measurements.record import Columns, part, to_record
from gapsense.report.plot import panels, scale_axis
from gapsense.scenarios.semera_valve.measuring import GOOD, Instruments, Pulses, measure

RECORDS = Path(__file__).parent / "records"


@pytest.mark.parametrize(("file", "ohms"), [("tube-150-raw.csv", 0.371), ("empty-162-raw.csv", 0.372)])
def test_one_discharge_gives_resistance_flux_and_inductance(file, ohms):
    found = facts(read_record(RECORDS / file))
    (pulse,) = found.pulses
    assert pulse.resistance == pytest.approx(ohms, rel=0.01)
    assert pulse.closing is None and pulse.opening is None and not found.begun
    assert [found.signals[name].step for name in ("current", "voltage")] == pytest.approx([4.0, 2.0])


def test_inductance_without_iron_is_constant_and_with_iron_is_not():
    empty, tube = (facts(read_record(RECORDS / f"{name}.csv")).pulses[0] for name in ("empty-162-raw", "tube-150-raw"))
    assert empty.inductance == pytest.approx(288e-6, rel=0.02)
    assert tube.bend > 1.7 * empty.bend


def test_clamp_is_a_level_and_the_last_pulse_is_incomplete():
    measured = read_record(RECORDS / "synthetic-flyback-clamp.csv")
    assert levels(measured.voltage) == pytest.approx([-40.0, 0.0, 24.0], abs=0.1)
    found = facts(measured)
    assert len(found.pulses) == 4 and len(found.begun) == 1


def test_eddy_currents_of_a_solid_core_are_not_a_current_before_its_voltage():
    made = imperfect(Condition(eddy=5e-3, dt=20e-6), 30.0, 2, np.random.default_rng(4))
    said = " ".join(remarks(made, facts(made)))
    assert "eddy currents of a solid core" in said and "before the voltage" not in said


def bench(drive=None, instruments=None):
    """Facts of a record of the valve on the bench, and the remarks on it."""
    columns = measure(Pulses()._replace(**(drive or {})), Instruments()._replace(**(instruments or {})))
    read = subtract_offsets(to_record(columns))
    found = facts(read)
    return found, " ".join(remarks(read, found)), {item.what: item for item in checklist(found, 0)}


def seconds(count):
    """Time of the facts of so many pulses that end in 100 equal samples [s]."""
    v = np.tile(np.repeat([0.0, 24.0, 0.0], [60, 120, 20]), count)
    i = np.tile(
        np.concatenate((np.zeros(60), np.minimum(np.arange(120) / 20.0, 1.0), np.arange(19, -1, -1) / 20)), count
    )
    made = to_record(
        Columns("long.csv", np.arange(v.size) + 2, {"time": np.arange(v.size) * 1e-4, "voltage": v, "current": i})
    )
    began = process_time()
    assert len(facts(made).pulses) == count
    return process_time() - began


@pytest.mark.slow
def test_time_grows_with_the_length_of_a_record_not_with_its_square():
    seconds(10)  # what is computed once
    assert seconds(640) < 2.5 * 8.0 * max(seconds(80), seconds(80))


@pytest.mark.parametrize(
    "how",
    [{}, {"noise": (0.0, 0.0)}, {"bits": 8}, {"period": 5e-6}, {"period": 20e-6}, {"filter": 100e-6}, {"offset": 5e-3}],
)
def test_landing_and_release_of_a_mover_are_kinks(how):
    found, _, items = bench(instruments=how)
    for p, begin in zip(found.pulses, (2.5e-3, 18.5e-3)):  # it lands after 2.1 ms, and leaves at 6.9 ms for 3.1 ms
        assert p.closing.end - begin == pytest.approx(2.0e-3, abs=0.2e-3)
        assert 6.9e-3 < p.opening.begin - begin < p.opening.end - begin < 10.1e-3
    assert items["motion, closing"].answer == items["motion, opening"].answer == "yes"


@pytest.mark.parametrize(
    "drive",
    [{"volts": 24.0}, {"source": 5.0}, {"on": 20e-3, "period": 40e-3}, {"volts": 48.0, "duty": 0.6, "carrier": 50e-6}],
)
def test_landing_is_seen_with_any_drive(drive):
    found, _, _ = bench(drive, {"period": 11e-6})
    assert all(p.closing and p.opening for p in found.pulses)


def test_mover_that_stays_has_no_kinks_and_one_that_is_clamped_no_release():
    found, _, items = bench({"volts": 8.0})
    assert not any(p.closing or p.opening for p in found.pulses)
    assert "Raise the voltage" in items["motion, closing"].why and items["`identify`"].answer == "with care"
    found, _, items = bench({"clamp": 40.0})
    assert all(p.closing and not p.opening for p in found.pulses) and found.path.decay == pytest.approx(-40.0, abs=0.1)
    assert "Against -40.0" in items["motion, opening"].why


@pytest.mark.parametrize(
    ("drive", "how", "told"),
    [
        ({}, {"period": 5e-6}, ""),
        ({}, {"delay": 100e-6}, "late behind the voltage"),
        ({}, {"period": 5e-6, "delay": 25e-6}, "late behind the voltage"),
        ({}, {"period": 5e-6, "delay": -50e-6}, "samples before the voltage"),
        ({}, {"filter": 200e-6}, "An edge of the voltage takes 6 samples"),
        ({}, {"bits": 12, "range": (40.0, 0.3)}, "`current` stays at its largest value"),
        ({}, {"bits": 8, "period": 20e-6}, "102 steps of its converter only"),
        ({}, {"period": 100e-6}, "rises to half within 4 samples"),
        ({"carrier": 500e-6, "duty": 0.6}, {}, "every 10 samples, in step with the sampling"),
        ({"carrier": 500e-6, "duty": 0.6}, {"period": 37e-6}, "that averages out"),
        ({"carrier": 50e-6, "duty": 0.6}, {"period": 20e-6}, "is lost, by up to"),
    ],
)
def test_what_impairs_a_record_is_told(drive, how, told):
    _, said, _ = bench(drive, how)
    assert told in said if told else said == ""


def test_supply_that_sags_and_command_are_told():
    found, _, _ = bench({"source": 5.0})
    assert found.path.source == pytest.approx(5.0, rel=0.02)
    assert bench()[0].path.source is None
    assert "a command" in bench(instruments={"noise": (0.0, 1e-3), "period": 20e-6})[1]


def test_coil_that_gets_warm_and_resistance_of_a_meter_are_told():
    found, _, _ = bench()
    warm = [found.pulses[0]._replace(resistance=76.0 * (1.0 + 0.01 * k)) for k in range(5)]
    assert "changes by 4 % from the first operation to the last: as copper does in 10 K" in " ".join(
        of_resistances(found._replace(pulses=warm), None)
    )
    assert [*of_resistances(found, 76.0)] == []
    assert "+52 % off the 50 Ohm" in " ".join(of_resistances(found, 50.0))


def test_record_that_does_not_begin_at_rest_is_told_and_not_believed():
    _, _, items = bench(instruments={"start": 5e-3})
    assert items["`identify`"].answer == items["flux linkage"].answer == items["offsets, noise"].answer == "no"
    assert "record from rest" in items["`identify`"].why and items["resistance"].answer == "yes"


def changed(**signals):
    """A good record with other signals."""
    columns = measure(*GOOD)
    return to_record(columns._replace(values={**columns.values, **{n: f(columns.values) for n, f in signals.items()}}))


def said_of(record):
    found = facts(subtract_offsets(record))
    return " ".join(remarks(record, found)), {item.what: item.answer for item in checklist(found, 0)}


def test_columns_that_are_interchanged_and_single_samples_are_told():
    said, _ = said_of(changed(voltage=lambda x: x["current"], current=lambda x: x["voltage"]))
    assert "Are the columns swapped?" in said
    said, _ = said_of(changed(current=lambda x: np.where(x["time"] == x["time"][900], 3.0, x["current"])))
    assert "row 902: `current` is 3 in this one sample only" in said
    assert "one sample" not in said_of(changed())[0] and "jumps" not in said_of(changed())[0]


@pytest.mark.parametrize("factor", [0.0, -1.0])
def test_no_resistance_and_flux_linkage_of_a_reversed_or_missing_voltage(factor):
    _, items = said_of(changed(voltage=lambda x: factor * x["voltage"]))
    assert {items[name] for name in items if name != "offsets, noise"} == {"no"}


def test_resistance_of_a_record_that_does_not_begin_at_rest_is_not_sure():
    said, items = said_of(changed(current=lambda x: x["current"] + 0.1))
    assert items["resistance"] == "with care" and "before the voltage" not in said


def test_milliseconds_that_are_taken_for_seconds_are_refused_by_all_commands():
    _, items = said_of(changed(time=lambda x: 1e3 * x["time"]))
    assert {items[f"`{name}`"] for name in ("identify", "commission", "estimate")} == {"no"}


def test_levels_of_a_command_are_no_steps_of_a_converter():
    said, _ = said_of(changed(voltage=lambda x: np.where(x["voltage"] > 15.0, 30.0, 0.0)))
    assert "a command" in said and "steps of its converter" not in said


def test_coil_knows_no_sign(tmp_path):
    columns = measure(*GOOD).values
    usual = read_record(write(tmp_path / "usual.csv", columns))
    turned = read_record(
        write(tmp_path / "turned.csv", {**columns, "voltage": -columns["voltage"], "current": -columns["current"]})
    )
    assert np.array_equal(turned.current, usual.current) and np.array_equal(turned.applied, usual.applied)
    assert "the signs of both are changed" in turned.remarks[0] and usual.remarks == ()


def test_long_record_is_drawn_with_few_points_and_its_extremes():
    t = np.arange(300000) * 1e-5
    axis = panels("", 1)[1][0, 0]
    x = np.sin(t)
    x[123456] = 7.0
    curve(axis, t, x, "black")
    (drawn,) = axis.lines
    assert drawn.get_xdata().size < 5000 and drawn.get_ydata().max() == 7.0


@pytest.mark.parametrize(
    ("largest", "label", "factor"), [(244.0, "current / A", 1.0), (0.4, "current / mA", 1e3), (0.0, "current / A", 1.0)]
)
def test_axes_have_units_that_suit_the_values(largest, label, factor):
    text, scale = scale_axis("current", "A", np.array([0.0, -largest]), np.array([np.nan, 0.5 * largest]))
    assert text == label and scale == pytest.approx(factor)


@pytest.mark.parametrize(
    ("on", "noise"),
    [
        *((on, noise) for noise in (1.0, 4.0) for on in (5e-3, 0.03)),
        pytest.param(0.4, 1.0, marks=pytest.mark.slow),
        (0.4, 4.0),
    ],
)
def test_closing_is_seen_however_long_the_coil_is_held(on, noise):
    """In 0.4 s the current was averaged over 16 ms, in which the mover lands."""
    c = Condition(on=on, period=on + 12e-3, noise=noise)
    (pulse,) = facts(imperfect(c, 30.0, 1, np.random.default_rng(3))).pulses
    assert pulse.closing and pulse.closing.begin == pytest.approx(2.8e-3, abs=0.25e-3)
    assert pulse.closing.end == pytest.approx(3.4e-3, abs=0.25e-3)


def test_closing_is_seen_in_an_operation_without_an_end():
    whole = imperfect(Condition(), 30.0, 1, np.random.default_rng(3))
    cut = part(whole, slice(0, 75))  # 1 ms after the landing
    found = facts(cut)
    assert not found.pulses and found.begun[0].closing
    items = {item.what: item for item in checklist(found, 0)}
    assert items["motion, closing"].answer == "yes" and items["`commission`"].answer == "yes"


def test_noise_on_a_current_that_settles_is_no_motion():
    for seed in range(30):
        rng, t = np.random.default_rng(seed), np.arange(30_000)
        current = 1.0 - np.exp(-t / 100.0) + 0.01 * rng.standard_normal(t.size)
        assert fall(current, 0.01, 1e-3) is None, seed


def test_coil_that_is_held_to_the_end_says_so():
    found = facts(imperfect(Condition(on=14e-3, period=14e-3), 30.0, 1, np.random.default_rng(5)))
    assert found.pulses[0].closing and not found.begun
    items = {item.what: item for item in checklist(found, 0)}
    assert "held to the end" in items["motion, opening"].why and items["`identify`"].answer == "yes"


def test_neighbours_in_a_short_rest_may_correlate_by_chance():
    signals = [np.random.default_rng(seed).standard_normal(30) for seed in range(50)]
    assert not [x for x in signals if signal(x, 30).correlation > WHITE]
    assert signal(np.convolve(signals[0], np.ones(5)), 34).correlation > WHITE
