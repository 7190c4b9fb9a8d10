"""Records: what can be read, and what is refused with row and column."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from valve_records import columns, write

from gapsense.cosim import run
from gapsense.problems import InputError
from gapsense.studies.identification.checks import read_record
from gapsense.studies.identification.operations import noise

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
    assert read_record(file, {"voltage": "u1", "current": "ch2"}).current.size > 600
    assert "`--column voltage=NAME`" in problems(file)[0]


MALFORMED = {
    "missing column": (cell(1, 2, "amps [A]"), [r"row 1: column `current` is missing; there are .*`amps`"]),
    "wrong unit": (cell(1, 1, "voltage [A]"), [r"row 1, column 2: `voltage` has unit `A`; `V` is expected"]),
    "no unit": (cell(1, 2, "current"), [r"row 1, column 3: `current` has no unit"]),
    "NaN": (cell(7, 2, "nan"), [r"row 7: `current` is `nan`, a finite number"]),
    "text": (cell(8, 1, "on"), [r"row 8: `voltage` is `on`"]),
    "empty cell": (cell(9, 0, ""), [r"row 9: `time` is ``"]),
    "decimal comma": (cell(9, 2, "0,1"), [r"row 9: 4 cells found, 3 expected.*point, not a comma"]),
    "repeated row": (lambda lines: lines.insert(20, lines[19]), [r"row 21: `time` is .* 0 s after the row before"]),
    "missing row": (lambda lines: lines.pop(30), [r"row 31: `time` is .* 0.0001 s after .* steps of 5e-05 s"]),
    "too short": (lambda lines: lines.__delitem__(slice(6, None)), [r"5 rows found, at least 8"]),
    "cut": (lambda lines: lines.__delitem__(slice(100, None)), [r"no complete operation .* row 12\).*has ended"]),
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
    named = read_record(file, {"voltage": "drive.voltage", "current": "valve.current"})
    assert named.dt == pytest.approx(25e-6, rel=1e-9)
    lone = file.rename(tmp_path / "lone.csv")  # without its side-car: a file like any other, its heads have the units
    alone = read_record(lone, {"voltage": "sensor.voltage_measured", "current": "sensor.current_measured"})
    np.testing.assert_array_equal(alone.current, result["sensor.current_measured"])
    assert alone.dt == pytest.approx(25e-6, rel=1e-9)
    lone.rename(file)
    assert "no signal `valve.curent`" in problems(file, names={"current": "valve.curent"})[0]
