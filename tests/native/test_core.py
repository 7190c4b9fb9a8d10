"""Numbers and CSV files in the C of native FMUs, beside Python's own reading and writing of them."""

from __future__ import annotations

import math
import os
import random
import socket
import struct
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from core import Core
from drivers import ROOT

from gapsense.fmi.components import load_component
from gapsense.fmi.ports import Component
from gapsense.fmi.sentences import say
from gapsense.fmi.tables import read_table

DRIVE = ROOT / "fmus" / "drive_voltage"  # has an integral
ACTUATOR = ROOT / "fmus" / "reluctance_actuator"  # has a spline
MAP = ROOT / "fmus" / "table_actuator"  # has a grid
EDGES = (0.0, -0.0, 1.0, 1e16, 1e15, 123456789012345680.0, 1e-4, 1e-5, 5e-324, 2**-44, 2.0**60, 9007199254740993.0,
         1.7976931348623157e308, 0.1, 1 / 3, math.nan, math.inf, -math.inf, 100.0, 0.00012345, 999999.5, 1e22,
         1e23)  # fmt: skip
NUMBERS = (" 1", "1_000", "1__0", "_1", "1_", "1.e5", ".5", ".", "", "+.5e-3", "1e", "1e+", "0x10", "inf", "nan", "-",
           "1e999", "1e-999", "\u00a02\u2003", "\t3\n", "1 2", "1,5", "00.10", "1._5", "1e1_0")  # fmt: skip


def doubles(count: int) -> list[float]:
    rng = random.Random(1)
    made = [struct.unpack("d", rng.randbytes(8))[0] for _ in range(count)]
    return [*EDGES, *made, *(float(f"{rng.uniform(0, 1):.{k % 12}e}") for k in range(count))]


def test_numbers_are_written_as_python_writes_them(core: Core) -> None:
    for value in doubles(3000):
        assert core.repr(value) == repr(value) or math.frexp(value)[0] in (0.5, -0.5)  # a power of two, see below
        for form in ("%g", "%.3g", "%.9g"):
            assert core.printed(form, value) == form % value


def test_powers_of_two_are_read_back_as_they_were(core: Core) -> None:
    """Their neighbours are not equally far, so that Python may choose another of the shortest texts."""
    for power in range(-1074, 1024):
        assert float(core.repr(2.0**power)) == 2.0**power


def test_numbers_are_read_as_python_reads_them(core: Core) -> None:
    for text in (*NUMBERS, *map(repr, doubles(2000)), "1" * 400 + ".5", "0." + "0" * 300 + "17", "1" * 5000):
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        found = core.number_in(text.encode())
        expected = value if math.isfinite(value) else math.nan
        assert struct.pack("d", found) == struct.pack("d", expected) or (math.isnan(found) and math.isnan(expected))


def judged(component: Component, folder: Path, name: str, file: Path) -> list[list[float]] | str:
    """What Python makes of a table's file."""
    made, problems = [], []
    for port in component.ports:
        if port.columns:
            try:
                made += read_table(file if port.name == name else folder / port.start, port.columns)
            except ValueError as error:
                problems.append(say("of_parameter", port.name, error))
    return " ".join(problems) or made


@pytest.fixture(scope="session", params=[DRIVE, ACTUATOR], ids=lambda folder: folder.name)
def tables(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Core, Component, int]:
    core = request.getfixturevalue("core")
    component = load_component(request.param)
    reference = next(k for k, port in enumerate(component.ports) if port.columns)
    if request.param != DRIVE:
        core = Core(request.param, tmp_path_factory.mktemp(request.param.name))
    return core, component, reference


def files(x: str, y: str) -> list[bytes]:
    """Good and bad files of two columns and of three; `x` and `y` are the heads of two."""
    rows = "0,1,2\n1,2,3\n2,4,5\n3,7,6\n4.5,1e1,9\n"
    name, other = x.split()[0], y.split()[0]
    texts = (
        f"{x},{y}\n{rows}",
        f"{y} , {x}\r\n{rows}",
        f'"{x}","{y}"\r0,1\r1,"2"\r2,3\r3,4\r',
        f"\ufeff{x.upper()},{y}\n\n\n{rows}",
        f"{name},{other}\n{rows}",
        f"{x} extra\n{rows}",
        "",
        "\n\n",
        f"{x},{x},{y}\n{rows}",
        f"{x},{y}\n0,1\n0,1\n",
        f"{x},{y}\n0,1\n2,3\n1,nan\n",
        f"{x},{y}\n0\n1,x,\n2,3\n,\n",
        f"{x},{y}\n0,1\n",
        f"{x},{y}",
        f"{x.replace('[', '(').replace(']', ')')},{y}\n{rows}",
        f"{name} [x],{y}\n{rows}",
        f'{x},{y},"a ""quoted"" one"\n0,1,"x\ny"\n1,1\n2,z\n3,3\n',
        f'{x},{y}\n0,"1\n',
        f"kind:{x},{y}\n{rows}",
        f"{x},{y}\n0,1\n1,2\n1,3\n2,1\n3,1\n",
        f'{x},{y}\n0,"1"2\n1,"2"x\n2,3\n4,5\n',
    )
    return [*(text.encode() for text in texts), b"\xff\xfe", "0,1\n".encode("utf-16")]


def test_tables_and_what_is_wrong_with_them_are_those_of_python(
    tables: tuple[Core, Component, int], tmp_path: Path
) -> None:
    core, component, reference = tables
    port, file = component.ports[reference], tmp_path / "tafel 1.csv"
    heads = [column.rpartition(":")[2] for column in port.columns]
    for content in files(heads[0], heads[1]):
        file.write_bytes(content)
        expected, found = judged(component, core.folder, port.name, file), core.tables(reference, file)
        if isinstance(expected, str) and "not a CSV file" in expected:  # Python tells which byte, C does not
            expected = expected.partition("(")[0]
            found = found.partition("(")[0] if isinstance(found, str) else found
        assert found == expected, content


def test_tables_of_anything_are_those_of_python(tables: tuple[Core, Component, int], tmp_path: Path) -> None:
    core, component, reference = tables
    port, file, rng = component.ports[reference], tmp_path / "any.csv", random.Random(2)
    heads = [column.rpartition(":")[2] for column in port.columns]
    parts = (
        '"',
        ",",
        "\n",
        "\r\n",
        "\r",
        " ",
        "1",
        "2.5",
        "-3",
        "[V]",
        "(s)",
        "time",
        "voltage",
        '""',
        "a",
        "7\n8",
        "é",
    )
    for _ in range(300):
        body = "".join(rng.choice(parts) for _ in range(rng.randrange(40)))
        head = ",".join(heads) + rng.choice(("\n", "\r\n", ",", '"')) if rng.random() < 0.8 else ""
        file.write_bytes((head + body).encode())
        assert core.tables(reference, file) == judged(component, core.folder, port.name, file), head + body


def test_grids_are_those_of_python(tmp_path_factory: pytest.TempPathFactory, tmp_path: Path) -> None:
    """Of random size and numbers, and with one cell, one row or one column made wrong."""
    core, component, rng = Core(MAP, tmp_path_factory.mktemp(MAP.name)), load_component(MAP), random.Random(3)
    reference = next(k for k, port in enumerate(component.ports) if port.columns)
    file, good, bad = tmp_path / "grid.csv", 0, 0
    for _ in range(200):
        x, y = (sorted(rng.sample(range(1, 60), rng.randrange(3, 9))) for _ in range(2))
        rows = [[a / 7e4, b / 3e3, b * (b + rng.random())] for a in x for b in (0, *y)]
        if rng.random() < 0.6:
            k = rng.randrange(len(rows))
            rows[k][rng.randrange(3)] = rng.choice((0.0, -1.0, 1.0, math.nan, rows[k - 1][0], rows[k - 1][2]))
        if rng.random() < 0.2:
            del rows[rng.randrange(len(rows))]
        file.write_text("\n".join(["gap,flux_linkage,current", *(",".join(map(repr, row)) for row in rows)]))
        expected = judged(component, core.folder, component.ports[reference].name, file)
        assert core.tables(reference, file) == expected
        good, bad = good + isinstance(expected, list), bad + isinstance(expected, str)
    assert good > 30 and bad > 60


def test_missing_files_and_files_of_another_kind_are_not_read(core: Core, tmp_path: Path) -> None:
    (tmp_path / "folder.csv").mkdir()
    other = tmp_path / "secret.txt"
    other.write_text("time [s],voltage [V]\n0,1\n1,2\n")
    drive = load_component(DRIVE)
    reference = next(k for k, port in enumerate(drive.ports) if port.columns)
    for file in (other, tmp_path / "none.csv", tmp_path / "folder.csv", tmp_path / ".csv"):
        assert core.tables(reference, file) == judged(drive, DRIVE, drive.ports[reference].name, file)


def made_pipe(path: Path) -> None:
    os.mkfifo(path)


def made_device(path: Path) -> None:
    path.symlink_to("/dev/zero")


def made_socket(path: Path) -> None:
    place = socket.socket(socket.AF_UNIX)
    os.chdir(path.parent)  # names of sockets must be short
    place.bind(path.name)


@pytest.mark.skipif(sys.platform == "win32", reason="no pipes in folders")
@pytest.mark.parametrize("make", [made_pipe, made_device, made_socket, Path.mkdir], ids=lambda f: f.__name__)
def test_what_is_no_file_is_refused_at_once(
    tables: tuple[Core, Component, int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, make: Callable[[Path], None]
) -> None:
    core, component, reference = tables
    monkeypatch.chdir(tmp_path)
    file = tmp_path / "own.csv"
    make(file)
    found = core.tables(reference, file)
    assert found == judged(component, core.folder, component.ports[reference].name, file)
    assert f"`{file}` is not a file." in str(found)


def test_messages_about_tables_have_a_bound(tables: tuple[Core, Component, int], tmp_path: Path) -> None:
    core, component, reference = tables
    port, file = component.ports[reference], tmp_path / "own.csv"
    head = ",".join(column.rpartition(":")[2] for column in port.columns[:2])
    for content in (
        head + "\n" + "0,x\n" * 20_000,
        head + "\n" + "\n".join(f"{-k},1" for k in range(20_000)),
        head + "\n0," + "ä" * 100_000 + "\n",
        f"{head}\n" + "0,1\n" * 11,
        ",".join(["time"] * 9 + ["ö" * 999] * 999) + "\n0,1\n",
        f"{head.partition(',')[0]} [{'x' * 9999}],{head}\n0,1\n",
        head.replace("[", f"[{'k' * 999}") + "\n0,1\n",
        ",".join([head] * 9999) + "\n",
    ):
        file.write_text(content)
        found = core.tables(reference, file)
        assert found == judged(component, core.folder, port.name, file)
        assert isinstance(found, str) and len(found) < 2000
