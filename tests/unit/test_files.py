"""CSV files: heads with units, all problems at once, errors that name the file."""

from __future__ import annotations

import errno
import io

import numpy as np
import pytest

from gapsense._os.files import header, naming, read_columns, split_header, write_columns


@pytest.mark.parametrize(
    ("head", "name", "unit"),
    [
        ("time [s]", "time", "s"),
        ("  valve.current   [ A ] ", "valve.current", "A"),
        ("valve.slope [1/(H.m)]", "valve.slope", "1/(H.m)"),
        ("valve.current", "valve.current", ""),
        ("a.x[1]", "a.x[1]", ""),  # an element of an array, as FMI writes it
        ("a.x[1] [m]", "a.x[1]", "m"),
        ("a.der(x)", "a.der(x)", ""),
        ("[s]", "[s]", ""),
        ("", "", ""),
    ],
)
def test_heads_tell_name_and_unit(head: str, name: str, unit: str) -> None:
    assert split_header(head) == (name, unit)
    assert split_header(header(name, unit)) == (name, unit)


def test_columns_read_back_without_their_units(tmp_path) -> None:
    columns = {"time": np.array([0.0, 0.1]), "a.x[1]": np.array([1e-300, -0.0]), "plain": np.array([np.nan, np.inf])}
    text = io.StringIO()
    write_columns(text, columns, {"time": "s", "a.x[1]": "m", "other": "V"})
    assert text.getvalue().splitlines()[0] == '"time [s]","a.x[1] [m]","plain"'
    (tmp_path / "x.csv").write_text(text.getvalue())
    again = read_columns(tmp_path / "x.csv", {"time": "s", "a.x[1]": "m", "plain": "V"})
    assert list(again) == list(columns)
    assert all(again[name].tobytes() == columns[name].tobytes() for name in columns)


def test_all_problems_of_a_file_are_told_at_once(tmp_path) -> None:
    rows = ["1,2,3", "1,x,3", "1,2", "1,,3", "y,y,y"]
    (tmp_path / "x.csv").write_text("\n".join(["time [ms],a [V],a", *rows]) + "\n")
    with pytest.raises(ValueError) as caught:
        read_columns(tmp_path / "x.csv", {"time": "s", "a": "V"})
    file = tmp_path / "x.csv"
    assert str(caught.value).splitlines() == [
        f"{file}, line 1: columns 2 and 3 are both called `a`. Rename or remove one.",
        f"{file}, line 4: 2 values found, 3 expected. Correct it.",
        f"{file}, line 1: `time` is in `ms`, `s` is expected, and nothing is converted. "
        "Convert the column and write `time [s]`.",
        f"{file}, line 3, column 2 (`a`): `x` found, a number expected. Correct it.",
        f"{file}, line 5, column 2 (`a`): `` found, a number expected. Correct it.",
        f"{file}, line 6, column 1 (`time`): `y` found, a number expected. Correct it.",
        f"{file}: 2 more cells do not hold a number.",
    ]


def test_files_in_another_encoding_are_told(tmp_path) -> None:
    (tmp_path / "x.csv").write_bytes("time,a\n0,1\n".encode("utf-16"))
    with pytest.raises(ValueError, match="not a CSV file in UTF-8"):
        read_columns(tmp_path / "x.csv")


def test_errors_of_the_operating_system_get_a_name(tmp_path) -> None:
    with pytest.raises(OSError, match=r"No space left on device: 'x'"), naming("x"):
        raise OSError(errno.ENOSPC, "No space left on device")
