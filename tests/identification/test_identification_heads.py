"""Files as instruments write them: lines above the heads, units in a row of their own."""

from __future__ import annotations

import pytest

from gapsense.identification.measurements.reading import read_columns
from gapsense.identification.measurements.record import Reading
from gapsense.problems import InputError

ROWS = [f"{k},{12 if k > 3 else 0},{max(0, k - 4)}" for k in range(20)]
HEAD = "time [ms],voltage [V],current [mA]"


def read(path, lines, **how):
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    problems: list[str] = []
    columns = read_columns(path, Reading(**how), problems)
    if problems:
        raise InputError(problems)
    return columns


@pytest.mark.parametrize(
    "above",
    [
        [],
        ["# relay, 21 degC"],
        ["Model,MSO44", "Sample Interval,5E-05,", "", ",,"],
        ["a line without any comma", "and, one, with, many, of, them"],
    ],
)
def test_lines_above_the_heads_are_left_out(tmp_path, above):
    found = read(tmp_path / "a.csv", [*above, HEAD, *ROWS])
    assert found.values["current"][-1] == pytest.approx(15e-3) and found.values["time"].size == 20
    assert found.rows[0] == len(above) + 2


@pytest.mark.parametrize("units", ["ms,V,mA", "(ms),(V),(mA)", "[ms],[V],[mA]"])
def test_units_may_have_a_row_of_their_own(tmp_path, units):
    found = read(tmp_path / "a.csv", ["Time,Voltage,Current", units, "", *ROWS])
    assert found.values["current"][-1] == pytest.approx(15e-3) and found.values["time"][-1] == pytest.approx(19e-3)


def test_messages_name_the_row_of_the_heads_and_the_separator_below_other_lines(tmp_path):
    with pytest.raises(InputError) as error:
        read(tmp_path / "a.csv", ["Model,MSO44", "TIME,CH1,CH2", *ROWS])
    assert "a.csv, row 2, column 1: `time` has no unit" in error.value.problems[0]
    with pytest.raises(InputError, match=r"separated by semicolons.*--decimal ,"):
        read(
            tmp_path / "a.csv", ["of a scope", HEAD.replace(",", ";"), *(row.replace(",", ";") + ",5" for row in ROWS)]
        )


def test_nan_in_the_first_row_is_no_unit(tmp_path):
    with pytest.raises(InputError, match="row 2: `voltage` is `nan`"):
        read(tmp_path / "a.csv", [HEAD, "0,nan,0", *ROWS[1:]])
