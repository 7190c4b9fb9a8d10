"""Operations of records as people bring them: clamps, single shots, pulses of different height, offsets."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from valve_records import PERIOD, REST, columns, record, write

from gapsense.identification.measurements.operations import Operation, estimate, operations, starts
from gapsense.identification.measurements.prepare import remaining
from gapsense.identification.measurements.reading import read_record
from gapsense.identification.measurements.record import Columns, to_record
from gapsense.problems import InputError

RECORDS = Path(__file__).parent / "records"
L, R, DT = 20e-3, 10.0, 50e-6


def coil(pulses, rest=100, clamp=0.0, tail=1.0, noise=(0.0, 0.0), seed=0):
    """A coil of constant L and R; each of `pulses` is volts, samples on, samples until the next one.

    A clamp holds the voltage there while the current falls.  The record ends `tail` of the last length after it.
    """
    v, i = [0.0] * rest, [0.0] * rest
    decay = np.exp(-R * DT / L)
    for k, (volts, on, length) in enumerate(pulses):
        for j in range(length if k + 1 < len(pulses) else round(tail * length)):
            applied = volts if j < on else (-clamp if i[-1] > 1e-9 else 0.0)
            current = i[-1] * decay + applied / R * (1.0 - decay)
            if applied < 0.0 and current < 0.0:  # the clamp stops when the current has gone
                applied, current = -i[-1] * decay / (1.0 - decay) * R, 0.0
            v.append(applied)
            i.append(current)
    rng = np.random.default_rng(seed)
    v, i = (np.array(x) + s * rng.standard_normal(len(x)) for x, s in zip((v, i), noise))
    values = {"time": np.arange(v.size) * DT, "voltage": v, "current": i}
    return to_record(Columns("coil.csv", np.arange(v.size) + 2, values), "end")


def test_fast_decay_by_a_clamp():
    measured = read_record(RECORDS / "synthetic-flyback-clamp.csv")
    found = operations(measured)
    assert [o.start for o in found] == pytest.approx([99, 899, 1699, 2499], abs=1) and found[-1].stop < 3400
    flux = estimate(measured, found)
    assert flux.resistances == pytest.approx([10.0] * 4, rel=0.02)


def test_single_shot_is_one_operation():
    shot = record(periods=1, seed=3)
    (operation,) = operations(shot)
    assert operation == Operation(REST, REST + round(PERIOD / shot.dt))
    assert estimate(shot, [operation]).resistances == pytest.approx([76.0], rel=2e-3)


def test_voltage_of_two_levels_tells_the_edge_though_their_distance_is_its_smallest_difference():
    one = coil([(12.0, 100, 600)])
    assert np.unique(one.voltage).size == 2 and [o.start for o in operations(one)] == [99]


def test_current_of_a_mover_that_goes_back_later_is_no_operation():
    two = coil([(12.0, 100, 600)] * 2, noise=(5e-3, 5e-4))
    bump = 0.03 * two.current.max() * np.exp(-(((np.arange(two.times.size) - 500.0) / 12.0) ** 2))
    assert operations(two._replace(current=two.current + bump)) == operations(two)
    assert len(operations(two)) == 2


def test_record_that_ends_while_current_flows_has_one_operation_less():
    assert len(operations(coil([(12.0, 200, 800)] * 3, tail=0.15))) == 2
    assert operations(coil([(12.0, 200, 800)], tail=0.15)) == []


@settings(max_examples=60)
@given(
    st.lists(st.tuples(st.floats(3.0, 60.0), st.integers(50, 300)), min_size=1, max_size=6),
    st.sampled_from([0.0, 1.0, 40.0]),
    st.integers(0, 1000),
)
def test_pulses_of_any_height_and_length_are_found(pulses, clamp, seed):
    made = [(volts, on, 1200) for volts, on in pulses]
    measured = coil(made, clamp=clamp, noise=(5e-3, 5e-4), seed=seed)
    found = operations(measured)
    begins = 99 + 1200 * np.arange(len(pulses))
    assert [o.start for o in found] == begins.tolist() == starts(measured)


def test_pulse_width_modulation_is_one_operation():
    rng = np.random.default_rng(1)
    v, i, decay = [0.0] * 50, [0.0] * 50, np.exp(-R * DT / L)
    for k in range(1000):
        v.append(24.0 if k < 500 and k % 10 < 5 else 0.0)
        i.append(i[-1] * decay + v[-1] / R * (1.0 - decay))
    times = np.arange(len(v)) * DT
    values = {"time": times, "voltage": np.array(v), "current": np.array(i) + 1e-3 * rng.standard_normal(len(i))}
    (operation,) = operations(to_record(Columns("pwm.csv", np.arange(len(v)) + 2, values), "end"))
    assert operation == Operation(49, 1049)


def test_current_that_never_ends_is_cut_at_the_edges_of_the_voltage():
    found = operations(coil([(12.0, 100, 160)] * 6, rest=1))
    assert len(found) == 6 and {o.stop - o.start for o in found} == {160}


@pytest.mark.parametrize("bits", [None, 8])
def test_offsets_are_found_subtracted_and_told(tmp_path, bits):
    values = columns(seed=4)
    early = np.arange(-300, 0) * 50e-6 + values["time"][0]
    rng = np.random.default_rng(2)
    quiet = {"time": early, "voltage": 15e-3 * rng.standard_normal(300), "current": 1e-3 * rng.standard_normal(300)}
    values = {name: np.concatenate((quiet[name], values[name])) for name in values}
    values["voltage"] += 0.4
    values["current"] += 5e-3
    if bits:
        values["current"] = np.round(values["current"] * 2**bits / 0.5) * 0.5 / 2**bits
    measured = read_record(write(tmp_path / "offset.csv", values))
    for name, expected in (("voltage", 0.4), ("current", 5e-3)):
        value, error = measured.offsets[name]
        assert abs(value - expected) < 4.0 * error
    assert abs(measured.current[:300].mean()) < 1e-4 and abs(measured.halves[:300].mean()) < 1e-3


def test_offsets_that_may_be_chance_are_left(tmp_path):
    assert read_record(write(tmp_path / "none.csv", seed=1)).offsets == {}


def test_offset_of_one_step_of_the_converter_is_found_and_what_it_hides_is_known(tmp_path):
    values = columns(seed=4)
    for offset, told in ((4e-3, {"current": 4e-3}), (0.0, {})):
        coarse = {**values, "current": np.round((values["current"] + offset) / 4e-3) * 4e-3}
        measured = read_record(write(tmp_path / "coarse.csv", coarse))
        assert {name: pytest.approx(o.value) for name, o in measured.offsets.items()} == told
        assert remaining(measured)["current"] == pytest.approx(4e-3 / np.sqrt(12.0), rel=1e-6)
    assert remaining(read_record(write(tmp_path / "fine.csv", values))) == {}


@pytest.mark.parametrize(("file", "volts"), [("tube-150-raw.csv", 150.0), ("empty-162-raw.csv", 162.0)])
def test_discharge_of_a_capacitor_as_an_oscilloscope_gives_it(file, volts):
    measured = read_record(RECORDS / file)
    assert measured.offsets["current"].value == pytest.approx(-4.0, abs=0.5)
    assert measured.offsets["current"].error < 0.2
    (operation,) = operations(measured)
    assert measured.times[operation.start] == pytest.approx(8.25e-3, abs=0.1e-3) and operation.stop == 3999
    assert measured.voltage.max() == pytest.approx(volts, abs=3.0)


@pytest.mark.parametrize("first", [161, 182, 203, 217])
def test_current_that_still_flows_is_no_offset(tmp_path, first):
    values = {name: x[first:] for name, x in columns(seed=1).items()}
    with pytest.raises(InputError, match="before the first operation"):
        read_record(write(tmp_path / "late.csv", values))
