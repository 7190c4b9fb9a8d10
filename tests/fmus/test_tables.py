"""Tables from CSV files: what is read, and that all problems of a file are told at once."""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from gapsense.fmi import tables as fmi_tables
from gapsense.fmi.components import find_components, load_component
from gapsense.fmi.ports import Component, Port
from gapsense.fmi.tables import column_name, heads, read_table

COMPONENTS = [load_component(folder) for folder in find_components(Path(__file__).parents[2] / "fmus")]

COLUMNS = ("time", "voltage")


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "für 100 %s.csv"


def refused(file: Path, content: str | bytes, columns: tuple[str, ...] = COLUMNS) -> str:
    file.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(ValueError) as caught:
        read_table(file, columns)
    assert file.name in str(caught.value)
    return str(caught.value)


def test_columns_come_in_the_order_asked_for(file: Path) -> None:
    file.write_text("voltage,remark,time\n1.5,a,0\n-2e1,b,1\n")
    assert read_table(file, COLUMNS) == [[0.0, 1.0], [1.5, -20.0]]


def test_table_that_is_read_again_is_new_to_its_reader_and_another_one_after_a_change(file: Path) -> None:
    file.write_text("time,voltage\n0,1\n1,2\n")
    read_table(file, COLUMNS)[1][0] = 9.0
    assert read_table(file, COLUMNS) == [[0.0, 1.0], [1.0, 2.0]]
    assert read_table(file, ("time", "integral:voltage")) == [[0.0, 1.0], [0.0, 1.5]]
    file.write_text("time,voltage\n0,1\n1,3\n")  # as long, and perhaps at the same time
    assert read_table(file, COLUMNS) == [[0.0, 1.0], [1.0, 3.0]]
    for _ in range(2):
        assert "row 3" in refused(file, "time,voltage\n0,1\n1,\n")


UNITS = ("time [s]", "voltage [V]", "integral:voltage")


@pytest.mark.parametrize("head", ["time,voltage", "Time [s],current [mA],Voltage [V]", "voltage (V),time(s)"])
def test_head_may_have_units_as_a_record_has_them(file: Path, head: str) -> None:
    count = head.count(",") + 1
    file.write_text(f"{head}\n{','.join('0' * count)}\n{','.join('2' * count)}\n")
    assert read_table(file, UNITS) == [[0.0, 2.0], [0.0, 2.0], [0.0, 2.0]]


def test_other_units_and_two_columns_of_one_name_are_told(file: Path) -> None:
    text = refused(file, "time [ms],voltage [V],voltage\n0,1,1\n1,1,x\n0,1,1\n", UNITS)
    assert "`time` is in `ms`, but `s` is expected, and nothing is converted" in text
    assert "columns 2 and 3 are both called `voltage`" in text
    assert "row 4: `time` decreases" in text
    assert "column voltage [V] is missing; the header has time [s]" in refused(file, "time [s]\n0\n", UNITS)


TABLES = [(c, p) for c in COMPONENTS for p in c.ports if p.columns]


@pytest.mark.parametrize(("component", "port"), TABLES, ids=[f"{c.name}-{p.name}" for c, p in TABLES])
def test_head_that_a_page_tells_is_taken(file: Path, component: Component, port: Port) -> None:
    wanted = heads(port.columns)
    told = "table like table.file" if port.name == "soft_landing.file" else f"the columns {', '.join(wanted)}"
    assert told in port.description
    is_grid = any(column.startswith("axis:") for column in port.columns)
    rows = [",".join([str(k)] * len(wanted)) for k in range(4)]
    if is_grid:
        rows = [f"{k},{j},{j}" for k in range(4) for j in range(3)]
    file.write_text("\n".join([",".join(wanted), *rows]) + "\n")
    assert len(read_table(file, port.columns)) == len(port.columns)


def test_spaces_blank_lines_and_byte_order_mark_do_no_harm(file: Path) -> None:
    file.write_bytes(b"\xef\xbb\xbf time , voltage\r\n0, 1\r\n\r\n1, 2\r\n")
    assert read_table(file, COLUMNS) == [[0.0, 1.0], [1.0, 2.0]]


def test_repeated_value_of_the_first_column_is_a_jump(file: Path) -> None:
    file.write_text("time,voltage\n0,0\n1,0\n1,5\n2,5\n")
    assert read_table(file, COLUMNS) == [[0.0, 1.0, 1.0, 2.0], [0.0, 0.0, 5.0, 5.0]]


GRID = ("gap [m]", "axis:flux [Wb]", "current [A]", *(f"{kind}:current" for kind in fmi_tables.GRID[1:]))
BLOCK = "{0},0,0\n{0},1,1\n{0},2,4\n"
BLOCKS = [BLOCK.replace("{0}", str(k)) for k in range(5)]
HEAD = "gap,flux,current\n"


def test_grid_is_the_tensor_spline_of_scipy(file: Path) -> None:
    rng = np.random.default_rng(5)
    x, y = np.r_[0.1, 0.1 + np.cumsum(rng.uniform(0.1, 1.0, 5))], np.r_[0.0, np.cumsum(rng.uniform(0.1, 1.0, 6))]
    z = np.hstack([np.zeros((6, 1)), np.cumsum(rng.uniform(0.1, 1.0, (6, 6)), axis=1)])
    rows = [f"{a},{b},{c}" for a, line in zip(x.tolist(), z.tolist()) for b, c in zip(y.tolist(), line)]
    file.write_text(HEAD + "\n".join(rows))
    _, axis, values, *made = read_table(file, GRID)
    assert axis == [*y, *[y[-1]] * (len(rows) - len(y))] and values == [*z.ravel()]
    spline = CubicSpline([*-y[:0:-1], *y], np.hstack([-z[:, :0:-1], z]), axis=1)
    energy = np.array([spline.integrate(0.0, b) for b in y]).T
    expected = [spline(y, 2), energy, *(CubicSpline(x, part)(x, 2) for part in (z, spline(y, 2), energy))]
    for found, other in zip(made, expected):
        np.testing.assert_allclose(np.reshape(found, z.shape), other, atol=1e-11 * np.abs(other).max())


@pytest.mark.parametrize(
    ("blocks", "told"),
    [
        (
            [*BLOCKS[:3], BLOCKS[3][:-6]],
            "row 12: every `gap` needs the same rows of `flux` as the first, and no others",
        ),
        ([*BLOCKS[:2], BLOCKS[3].replace("2,4", "2.5,4"), BLOCKS[4]], "row 10: every `gap` needs the same rows"),
        ([*BLOCKS[:2], BLOCKS[1], BLOCKS[3]], "row 8: every `gap` needs the same rows"),
        ([BLOCKS[1], BLOCKS[0], *BLOCKS[2:]], "row 5: `gap` decreases from 1 to 0"),
        (
            [BLOCK.replace("{0},0,0", f"{k},0,0.5").replace("{0}", str(k)) for k in range(4)],
            "begin at 0 at every `gap`",
        ),
        ([*BLOCKS[:3], BLOCKS[3].replace("2,4", "2,1")], "row 13: `current` does not rise from 1 to 1"),
        ([BLOCK.replace("2,4", "1,4").replace("{0}", str(k)) for k in range(4)], "row 4: `flux` does not rise"),
        (BLOCKS[:3], "9 rows, but at least 12 with different `gap` are needed"),
        ([f"{k},0,0\n{k},1,1\n" for k in range(6)], "12 rows, 2 for each `gap`, but at least 4 times 3 are needed"),
        ([f"{k}{row[1:]}\n" for k in range(3) for row in (BLOCKS[0] + "0,3,5").split()], "12 rows, 4 for each `gap`"),
    ],
)
def test_grid_that_is_none_is_refused(file: Path, blocks: list[str], told: str) -> None:
    assert told in refused(file, HEAD + "".join(blocks), GRID)


def test_integral_is_that_of_straight_lines(file: Path) -> None:
    file.write_text("time,voltage\n0,0\n2,4\n3,4\n3,-2\n5,-2\n")
    assert read_table(file, ("time", "integral:voltage"))[1] == [0.0, 4.0, 8.0, 8.0, 4.0]


def test_missing_file_is_told_with_its_columns(file: Path) -> None:
    with pytest.raises(ValueError, match="is not a file") as caught:
        read_table(file, COLUMNS)
    assert str(file) in str(caught.value) and "time, voltage" in str(caught.value)


def test_folder_is_no_file(tmp_path: Path) -> None:
    folder = tmp_path / "folder.csv"
    folder.mkdir()
    with pytest.raises(ValueError, match="is not a file"):
        read_table(folder, COLUMNS)


@pytest.mark.parametrize("name", ["passwd", "some.key", "table.csv.txt", ".csv"])
def test_other_files_are_not_even_opened(tmp_path: Path, name: str) -> None:
    """Messages tell headers and cells, and go to logs that others read."""
    text = refused(tmp_path / name, "hidden,b\n1,2\n")
    assert "does not end in .csv" in text and "time, voltage" in text and "hidden" not in text


def test_all_missing_columns_are_named_with_those_found(file: Path) -> None:
    text = refused(file, "t,u\n0,1\n")
    assert "time, voltage is missing" in text and "has t, u" in text


def test_empty_file_has_no_header(file: Path) -> None:
    assert "has nothing" in refused(file, "")


def test_all_problems_are_told_at_once_with_row_and_column(file: Path) -> None:
    text = refused(file, "time,voltage\n0,1\n2,high\n1\n1,nan\n3,inf\n")
    assert "row 3: `voltage` is `high`" in text
    assert "row 4: `voltage` is ``" in text
    assert "row 4: `time` decreases from 2 to 1" in text
    assert "row 5: `voltage` is `nan`" in text
    assert "row 6: `voltage` is `inf`" in text


def test_rows_are_counted_as_an_editor_does(file: Path) -> None:
    assert "row 5: `voltage` is `x`" in refused(file, "time,voltage\n0,1\n\n\n1,x\n")


def test_bad_cell_is_told_once(file: Path) -> None:
    text = refused(file, "time,voltage\n1,1\nx,2\n3,3\ny,4\n")
    assert text.count("row") == 2 and "decreases" not in text


@pytest.mark.parametrize("rows", ["", "0,1\n", "0,1\n0,2\n"])
def test_too_few_rows_are_told(file: Path, rows: str) -> None:
    assert "at least 2 with different `time` are needed" in refused(file, "time,voltage\n" + rows)


@pytest.mark.parametrize("content", [b"time,voltage\n0,\xff\n", "time,voltage\n0,1\n".encode("utf-16")])
def test_other_encodings_are_told(file: Path, content: bytes) -> None:
    assert "not a CSV file in UTF-8" in refused(file, content)


GAP = ("rising:gap", "rising:reluctance", "spline:reluctance")


def test_marks_name_their_tables() -> None:
    assert [column_name(c) for c in ("time", *GAP, "integral:voltage")] == [
        "time", "gap", "reluctance", "spline", "integral",
    ]  # fmt: skip


@pytest.mark.parametrize("count", [4, 5, 12])
def test_spline_is_that_of_scipy(file: Path, count: int) -> None:
    rng = np.random.default_rng(count)
    x, y = np.cumsum(rng.uniform(0.5, 2.0, count)), np.cumsum(rng.uniform(0.1, 1.0, count))
    file.write_text("gap,reluctance\n" + "".join(f"{a!r},{b!r}\n" for a, b in zip(x.tolist(), y.tolist())))
    gaps, reluctances, curvatures = read_table(file, GAP)
    assert gaps == x.tolist() and reluctances == y.tolist()
    assert curvatures == pytest.approx(CubicSpline(x, y)(x, 2), rel=1e-9, abs=1e-12)


def test_rising_column_that_does_not_rise_is_told_with_its_row(file: Path) -> None:
    text = refused(file, "gap,reluctance\n0,0\n1,2\n1,3\n0.5,3\n4,nan\n5,1\n6,0\n", GAP)
    assert "row 4: `gap` does not rise from 1 to 1" in text
    assert "row 5: `gap` decreases from 1 to 0.5" in text
    assert "row 5: `reluctance` does not rise from 3 to 3" in text
    assert "row 6: `reluctance` is `nan`" in text
    assert "row 8: `reluctance` decreases from 1 to 0" in text


def test_spline_needs_four_rows(file: Path) -> None:
    assert "3 rows, but at least 4 with different `gap`" in refused(file, "gap,reluctance\n0,0\n1,2\n2,3\n", GAP)


def test_a_long_table_takes_few_calls_for_a_row(tmp_path: Path) -> None:
    """Calls are counted, since times depend on what else runs; a function for each cell took 30 times as long."""
    file, calls = tmp_path / "long.csv", Counter[str]()
    file.write_text("gap [m],reluctance [1/H]\n" + "".join(f"{k},{k + 0.5!r}\n" for k in range(20_000)))
    before = sys.getprofile()
    try:
        sys.setprofile(lambda frame, event, argument: calls.update([event]))
        read_table(file, ("rising:gap [m]", "spline:reluctance [1/H]"))
    finally:
        sys.setprofile(before)
    assert calls["call"] < 1_000 and calls["c_call"] < 4 * 20_000, calls


def test_only_the_first_problems_of_rows_are_told(file: Path) -> None:
    text = refused(file, "time,voltage\n" + "0,x\n" * 1000)
    assert text.count("is `x`") == 10 and "; and 1990 more; " not in text and "and 990 more" in text
