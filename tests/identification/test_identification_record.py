"""Records: what can be read, and what is refused with row and column."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from valve_records import columns, record, write

from gapsense.cosim import run
from gapsense.identification.measurements.prepare import unipolar
from gapsense.identification.measurements.reading import read_record
from gapsense.identification.measurements.record import Reading
from gapsense.identification.measurements.signals import noise
from gapsense.problems import InputError

ROOT = Path(__file__).resolve().parents[2]


def problems(path: Path, **options) -> list[str]:
    with pytest.raises(InputError) as caught:
        read_record(path, **options)
    assert all(line.endswith((".", "?")) for line in caught.value.problems)
    return caught.value.problems


def changed(path: Path, edit) -> Path:
    """A sound record with its lines edited; `lines[k]` is row k + 1."""
    lines = write(path / "valve.csv", seed=1).read_text("utf-8").splitlines()
    edit(lines)
    (path / "valve.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path / "valve.csv"


def cell(row: int, column: int, text: str):
    def edit(lines):
        cells = lines[row - 1].split(",")
        cells[column] = text
        lines[row - 1] = ",".join(cells)

    return edit


def test_times_that_do_not_rise_are_told_once(tmp_path):
    def backwards(lines):
        lines[1:] = lines[:0:-1]

    (said,) = problems(changed(tmp_path, backwards))
    assert "`time` falls from row to row, it is to rise. Sort the rows" in said
    v = columns(seed=1)
    (said,) = problems(write(tmp_path / "still.csv", {**v, "time": np.zeros(v["time"].size)}))
    assert "`time` does not change from row to row" in said


def test_units_may_have_prefixes_and_columns_any_order(tmp_path):
    sound = read_record(write(tmp_path / "a.csv", seed=1))
    v = columns(seed=1)
    other = {"current": 1e3 * v["current"], "spare": v["time"], "time": 1e6 * v["time"], "voltage": 1e-3 * v["voltage"]}
    read = read_record(write(tmp_path / "b.csv", other, "Current [mA],spare,time (us), voltage [kV]"))
    for name in ("times", "voltage", "current", "halves"):
        np.testing.assert_allclose(getattr(read, name), getattr(sound, name), rtol=1e-12, atol=1e-18)
    assert sound.dt == pytest.approx(50e-6, rel=1e-12)
    assert read.mode is None and read.position is None


def test_two_columns_of_one_name_are_refused_if_they_are_read(tmp_path):
    (found,) = problems(write(tmp_path / "a.csv", seed=1, header="time [s],voltage [V],Voltage [V]"))[:1]
    assert found == "a.csv, row 1: columns 2 and 3 are both called `voltage`. Rename one."
    v = columns(seed=1)
    values = {"time": v["time"], "voltage": v["voltage"], "current": v["current"], "a": v["time"], "b": v["time"]}
    read_record(write(tmp_path / "b.csv", values, "time [s],voltage [V],current [A],spare,spare"))


def test_columns_of_other_names_are_named_by_the_user(tmp_path):
    file = write(tmp_path / "a.csv", seed=1, header="time [s],u1 [V],ch2 [A]")
    assert read_record(file, Reading({"voltage": "u1", "current": "ch2"})).current.size > 600
    assert "`--column voltage=NAME`" in problems(file)[0]
    german = write(tmp_path / "b.csv", seed=1, header="Zeit [s],Spannung [V],Strom [A]")
    names = {"time": "Zeit", "voltage": "Spannung", "current": "Strom"}
    assert read_record(german, Reading(names)).current.size > 600
    assert "`--column time=NAME`" in problems(german)[0]
    with pytest.raises(ValueError, match="--column zeit: there is no such quantity"):
        read_record(german, Reading({"zeit": "Zeit"}))


def test_file_without_rows_or_without_heads_is_told_as_what_it_is(tmp_path):
    rows = write(tmp_path / "a.csv", seed=1).read_text(encoding="utf-8").splitlines()
    for name, lines, said in (
        ("empty", [], "it is empty. Write `time"),
        ("heads", rows[:1], "no row has two numbers, so it is not a record. Record some, below its heads."),
        ("rows", rows[1:], "row 1: numbers found, the names of the columns expected. Write `time"),
    ):
        (tmp_path / f"{name}.csv").write_text("\n".join(lines), encoding="utf-8")
        (found,) = problems(tmp_path / f"{name}.csv")
        assert said in found


MALFORMED = {
    "missing column": (cell(1, 2, "amps [A]"), [r"row 1: column `current` is missing; there are .*`amps`"]),
    "wrong unit": (cell(1, 1, "voltage [A]"), [r"row 1, column 2: `voltage` has unit `A`; `V` is expected"]),
    "no unit": (cell(1, 2, "current"), [r"row 1, column 3: `current` has no unit"]),
    "NaN": (cell(7, 2, "nan"), [r"row 7: `current` is `nan`, a finite number"]),
    "text": (cell(8, 1, "on"), [r"row 8: `voltage` is `on`"]),
    "empty cell": (cell(9, 0, ""), [r"row 9: `time` is empty, .* interpolate it"]),
    "decimal comma": (cell(9, 2, "0,1"), [r"row 9: 4 cells found, 3 expected.*point, not a comma.*--decimal ,"]),
    "repeated row": (lambda lines: lines.insert(20, lines[19]), [r"row 21: `time` is .* 0 s after the row before"]),
    "missing row": (lambda lines: lines.pop(30), [r"row 31: `time` is .* 0.0001 s after .* steps of 5e-05 s"]),
    "too short": (lambda lines: lines.__delitem__(slice(6, None)), [r"5 rows found, at least 8"]),
    "cut": (lambda lines: lines.__delitem__(slice(60, None)), [r"no complete operation .* row 12\).*has ended"]),
    "no edge": (lambda lines: lines.__delitem__(slice(10, None)), [r"no current flows"]),
    "not from rest": (lambda lines: lines.__delitem__(slice(1, 60)), [r"row 2 to \d+: `current` is 0\.\d+ A before"]),
}


@pytest.mark.parametrize("case", MALFORMED)
def test_malformed_file_is_refused_with_row_and_column(tmp_path, case):
    edit, expected = MALFORMED[case]
    found = problems(changed(tmp_path, edit))
    assert all(line.startswith("valve.csv") for line in found)
    for pattern in expected:
        assert any(re.search(pattern, line) for line in found), found


def test_all_problems_come_at_once_and_many_rows_are_counted(tmp_path):
    def edit(lines):
        for k in (5, 50, 51, 52, 53):
            cell(k, 2, "nan")(lines)
        cell(100, 1, "x")(lines)
        lines.pop(200)

    found = "\n".join(problems(changed(tmp_path, edit)))
    assert all(word in found for word in ("row 5: `current`", "2 more rows", "row 100: `voltage`", "row 201: `time`"))


def test_clipped_signals_are_refused(tmp_path):
    for name, limit, word in (("current", 0.3, "largest"), ("voltage", 29.99, "largest")):
        values = columns(seed=1)
        values[name] = np.minimum(values[name], limit)
        (found,) = problems(write(tmp_path / "c.csv", values))
        assert re.search(rf"row \d+ to \d+: `{name}` stays at its {word} value {limit}", found)


def test_clipping_is_seen_without_noise_and_behind_a_converter(tmp_path):
    values = columns()
    for step in (1e-15, 2e-3):
        digits = {**values, "current": np.round(np.minimum(values["current"], 0.3) / step) * step}
        assert "clipped" in problems(write(tmp_path / "c.csv", digits))[0]


@pytest.mark.parametrize("step", [0.0, 1e-4, 4e-3])
@pytest.mark.parametrize("seed", [None, 2])
def test_sound_signals_are_not_called_clipped(tmp_path, step, seed):
    values = columns(seed=seed, noise=(2e-3, 3e-4))
    if step:
        values["current"] = np.round(values["current"] / step) * step
        values["voltage"] = np.round(values["voltage"] / (10.0 * step)) * 10.0 * step
    read_record(write(tmp_path / "c.csv", values))


def test_period_that_does_not_end_as_it_began_is_refused(tmp_path):
    (found, *_) = problems(write(tmp_path / "c.csv", seed=1, periods=3), period=13e-3)
    assert re.search(r"row \d+ to \d+: `current` is .* at the start of this operation and .* at its end", found)


def test_noise_is_found_beside_jumps():
    values = columns(seed=3)
    assert noise(values["current"]) == pytest.approx(1e-3, rel=0.15)
    assert noise(values["voltage"]) == pytest.approx(15e-3, rel=0.15)


def test_results_of_a_run_are_records_at_the_instants_of_the_sensor(fmus, tmp_path):
    result = run(ROOT / "scenarios" / "semera_valve", fmus=fmus)
    file = result.save(tmp_path / "own.csv")
    own = read_record(file)
    rows = result.stepped("sensor.current_measured")
    assert own.dt == pytest.approx(50e-6, rel=1e-9)
    signals = {"voltage": "sensor.voltage_measured", "mode": "valve.mode", "position": "valve.position"}
    for name, signal in signals.items():
        np.testing.assert_array_equal(getattr(own, name), result[signal][rows])
    named = read_record(file, Reading({"voltage": "drive.voltage", "current": "valve.current"}))
    assert named.dt == pytest.approx(25e-6, rel=1e-9)
    lone = file.rename(tmp_path / "lone.csv")  # without its side-car: a file like any other, its heads have the units
    alone = read_record(lone, Reading({"voltage": "sensor.voltage_measured", "current": "sensor.current_measured"}))
    np.testing.assert_array_equal(alone.current, result["sensor.current_measured"])
    assert alone.dt == pytest.approx(25e-6, rel=1e-9)
    lone.rename(file)
    assert "no signal `valve.curent`" in problems(file, how=Reading({"current": "valve.curent"}))[0]


def foreign(path: Path, separator: str, decimal: str) -> Path:
    """A sound record as programs of other countries write it."""
    lines = write(path / "f.csv", seed=1).read_text("utf-8").replace(",", separator)
    (path / "f.csv").write_text(lines.replace(".", decimal), encoding="utf-8")
    return path / "f.csv"


@pytest.mark.parametrize(("separator", "said"), [(";", 'semicolons.*`--separator ";"'), ("\t", "tabs.*--separator")])
def test_other_separators_are_named_and_read(tmp_path, separator, said):
    file = foreign(tmp_path, separator, ",")
    (found,) = problems(file)
    assert re.search(rf"f.csv, row 1: .*{said}.*--decimal ,", found)
    sound = read_record(write(tmp_path / "a.csv", seed=1))
    read = read_record(file, Reading(separator=separator, decimal=","))
    np.testing.assert_array_equal(read.current, sound.current)


def test_decimal_commas_between_semicolons_are_named(tmp_path):
    found = problems(foreign(tmp_path, ";", ","), how=Reading(separator=";"))
    assert "With decimal commas, add `--decimal ,`." in found[0]


def test_times_may_be_rounded_but_no_row_may_lack(tmp_path):
    values = columns(seed=1)
    values["time"] = np.round(values["time"] * 1.07, 5)  # 53.5 us to 10 us
    assert read_record(write(tmp_path / "r.csv", values)).dt == pytest.approx(53.5e-6, rel=1e-2)
    lacking = {name: np.delete(x, 40) for name, x in values.items()}
    assert "row 42: `time`" in "".join(problems(write(tmp_path / "l.csv", lacking)))


def test_milliseconds_called_seconds_are_noticed(tmp_path):
    values = columns(seed=1)
    values["time"] = 1e3 * values["time"]
    (found,) = problems(write(tmp_path / "ms.csv", values))
    assert re.search(r"`current` takes \d.*milliseconds are expected.*write `time \[ms\]`", found)


def test_reversed_sensor_is_named(tmp_path):
    values = columns(seed=1)
    values["current"] = -values["current"]
    (found,) = problems(write(tmp_path / "r.csv", values))
    assert re.search(r"opposite signs, so that the resistance would be -7\d.*reversed: change the sign", found)


def test_converter_without_sign_is_noticed(tmp_path):
    values = columns(seed=1)
    noisy = 1e-3 * np.random.default_rng(3).standard_normal(100)
    early = {"time": np.arange(-100, 0) * 50e-6 + values["time"][0], "voltage": 15.0 * noisy[::-1], "current": noisy}
    values = {name: np.concatenate((early[name], values[name])) for name in values}
    assert read_record(write(tmp_path / "two.csv", values)).remarks == ()
    values["current"] = np.maximum(values["current"], 0.0)
    (said,) = read_record(write(tmp_path / "one.csv", values)).remarks
    assert said.startswith("`current` never falls below 0 at rest, though it is noisy")


def test_clipped_signal_is_taken_on_request(tmp_path):
    values = columns(seed=1)
    values["current"] = np.minimum(values["current"], 0.3)
    file = write(tmp_path / "c.csv", values)
    assert "--clipped" in problems(file)[0]
    assert read_record(file, Reading(may_clip=True)).current.max() == 0.3


@pytest.mark.parametrize("form", ["{:.5e}", "{:.4e}", "{:.6f}"])
def test_times_that_a_program_rounded_coarsely_are_taken_as_equal_steps(tmp_path, form):
    step, n = 3.2e-7, 4000
    k = np.arange(n)
    times = [form.format(t) for t in (k * step + 0.0213).tolist()]
    current = np.where((k > 500) & (k < 2500), 0.3, 0.0) + 1e-3 * np.random.default_rng(1).standard_normal(n)
    rows = [f"{t},{12.0 * (i > 0.1)},{i:.6f}" for t, i in zip(times, current.tolist())]
    file = tmp_path / "scope.csv"
    file.write_text("\n".join(["time [s],voltage [V],current [A]", *rows]) + "\n", encoding="utf-8")
    record = read_record(file, needs="samples")
    assert record.dt == pytest.approx(step, rel=2e-3)
    assert np.all(np.diff(record.times) > 0.0)
    assert len(record.remarks) == (form != "{:.5e}") and all("rounded" in text for text in record.remarks)
    del rows[1000:1100]
    file.write_text("\n".join(["time [s],voltage [V],current [A]", *rows]) + "\n", encoding="utf-8")
    with pytest.raises(InputError, match="equal steps"):
        read_record(file, needs="samples")


@pytest.mark.parametrize("bits", [10, 12, 40])
def test_unipolar_converter_is_noticed_and_no_other_is_taken_for_one(bits):
    step, told = 0.8 / 2.0**bits, 0
    for seed in range(16):
        made = record(seed=seed, noise=(0.1, 3e-3))
        measured = made._replace(current=step * np.round(made.current / step))
        assert unipolar(measured) == ()
        said = unipolar(measured._replace(current=np.maximum(measured.current, 0.0)))
        told += any("`current` never falls below 0 at rest" in text for text in said)
    assert told >= 9  # with 11 samples at rest; with more, all


def test_record_without_noise_is_not_taken_for_unipolar():
    assert unipolar(record()) == ()


def test_current_without_a_voltage_is_told(tmp_path):
    values = columns(seed=1)
    file = write(tmp_path / "a.csv", {**values, "voltage": 0.0 * values["voltage"]})
    with pytest.raises(InputError, match="`voltage` is the same throughout though current flows"):
        read_record(file)


def test_decimal_commas_between_commas_are_all_that_is_told(tmp_path):
    file = tmp_path / "a.csv"
    rows = [f"0,{k},1,5,0,2" for k in range(20)]
    file.write_text("\n".join(["time [s],voltage [V],current [A]", *rows]) + "\n", encoding="utf-8")
    with pytest.raises(InputError) as caught:
        read_record(file)
    assert all("6 cells found, 3 expected" in problem for problem in caught.value.problems)


def test_a_row_that_is_too_long_does_not_hide_what_is_wrong_with_others(tmp_path):
    file = tmp_path / "a.csv"
    rows = [f"{1e-5 * k:.5f},1,0" for k in range(20)]
    rows[5], rows[9] = "0.00005,1,0,,", "0.00009,abc,0"
    file.write_text("\n".join(["time [s],voltage [V],current [A]", *rows]) + "\n", encoding="utf-8")
    with pytest.raises(InputError) as caught:
        read_record(file)
    long, text = caught.value.problems
    assert "row 7: 5 cells found, 3 expected" in long
    assert "row 11: `voltage` is `abc`" in text


def test_one_sample_that_hides_all_others_is_named(tmp_path):
    values = {name: x.copy() for name, x in columns(seed=1).items()}
    values["current"][500] = 40.0
    with pytest.raises(InputError, match="beside row 502 with 40 A, which is to be corrected"):
        read_record(write(tmp_path / "spike.csv", values))
