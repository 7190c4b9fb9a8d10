"""The commands of campaigns: run, show, figure, and what they say when something is wrong."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
from itertools import product

import pyarrow.parquet as pq
import pytest
from typer.testing import CliRunner

from gapsense import read_campaign
from gapsense._os.files import read_columns
from gapsense.cli import app
from gapsense.many.store import Store

STUDY = """
title = "Amplitudes"
scenario = "SCENARIO"
[grid]
"drive.square.amplitude" = [24.0, 30.0]
"""


@pytest.fixture
def study(write, tmp_path):
    file = tmp_path / "amplitudes.toml"
    scenario = write(("[metrics.current_error]", "[metrics.largest]"))
    file.write_text(STUDY.replace("SCENARIO", scenario.as_posix()), encoding="utf-8")
    return file


def call(*arguments):
    result = CliRunner().invoke(app, ["campaign", *map(str, arguments)])
    return result.exit_code, result.output


def test_run_show_and_figure(study, fmus, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert call(study, "--fmus", fmus, "--check") == (0, f"{study}: no problems.\n")
    code, said = call("--workers", 1, "--engine", "fmu", study, "--fmus", fmus)
    assert code == 0 and said.splitlines()[-1] == "results/amplitudes: 2 of 2 runs, 2 of them computed now.", said
    code, said = call("run", study, "--fmus", fmus)
    assert code == 0 and said.splitlines()[-1].endswith("2 of 2 runs, 0 of them computed now.")
    code, said = call("show", "results/amplitudes")
    assert code == 0 and "drive.square.amplitude" in said and "current [mA]" in said
    code, said = call("figure", "results/amplitudes")
    assert (code, (tmp_path / "results" / "amplitudes.png").read_bytes()[:4]) == (0, b"\x89PNG"), said


def test_wrong_input_is_told(study, fmus, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert call("none.toml") == (2, "none.toml: there is no such file. Correct the path.\n")
    study.write_text(study.read_text().replace("24.0", '"high"'))
    code, said = call(study, "--fmus", fmus, "--check")
    assert code == 2 and "amplitudes.toml, grid.drive.square.amplitude:" in said
    assert call("show", tmp_path)[0] == 2
    assert call("figure", tmp_path, "--out", "x.txt")[0] == 2
    assert call("--workers", 0, study)[0] == 2
    assert "show" in call("--help")[1]


@pytest.mark.parametrize("ending", [".csv", ".parquet"])
def test_rows_are_exported(study, fmus, tmp_path, ending):
    out, file = tmp_path / "out", tmp_path / f"rows{ending}"
    code, said = call(study, "--fmus", fmus, "--out", out, "--workers", 1, "--export", file)
    assert code == 0 and "written" in said, said
    again = file.with_name(f"again{ending}")
    assert call("show", out, "--export", again)[0] == 0 and again.read_bytes() == file.read_bytes()
    result = read_campaign(out)
    if ending == ".csv":
        read = read_columns(file.with_name("numbers.csv"), content=without_texts(file))
    else:
        table = pq.read_table(file)
        assert table.schema.field("wall").metadata == {b"unit": b"s"} and table["error"].null_count == 2
        read = {name: table[name].to_numpy() for name in table.column_names if name not in ("error", "ended")}
    for name, column in read.items():
        assert column.tolist() == result.column(name).tolist(), name
    assert len(read) == 4 + len(result.metrics)


def without_texts(file):
    """A table without its last two columns, which are empty here."""
    return "\n".join(line.rsplit(",", 2)[0] for line in file.read_text("utf-8").splitlines()).encode()


def test_export_that_cannot_be_is_told_before_the_run(study, fmus, tmp_path, monkeypatch):
    code, said = call(study, "--fmus", fmus, "--out", tmp_path / "out", "--export", tmp_path / "x.xlsx")
    assert code == 2 and "a file expected that ends in `.csv` or `.parquet`" in said, said
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    code, said = call(study, "--fmus", fmus, "--out", tmp_path / "out", "--export", tmp_path / "x.parquet")
    assert (code, said) == (2, "pyarrow is needed but not installed: `pip install 'gapsense[campaign]'`.\n")
    assert not (tmp_path / "out").exists()


def test_cluster_without_its_package_is_told(study, fmus, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    code, said = call(study, "--fmus", fmus, "--out", tmp_path / "out", "--scheduler", "tcp://127.0.0.1:9")
    assert (code, said) == (2, "distributed is needed but not installed: `pip install 'gapsense[campaign]'`.\n")


@pytest.mark.parametrize("command", ["campaign", pytest.param("sweep", marks=pytest.mark.slow)])
def test_full_disk_is_told_with_the_file_and_costs_nothing_that_was_done(study, fmus, tmp_path, monkeypatch, command):
    given = [study] if command == "campaign" else ["semera_valve", "--seeds", "20"]
    words = [command, *given, "--fmus", fmus, "--out", tmp_path / "out", "--workers", 1, "--engine", "fmu"]
    add = Store.add

    def on_a_full_disk(store, runs, more):
        (pages,) = store.connection.execute("PRAGMA page_count").fetchone()
        store.connection.execute(f"PRAGMA max_page_count = {pages}")
        add(store, {run: content + bytes(9000) for run, content in runs.items()}, more)

    with monkeypatch.context() as patch:
        patch.setattr(Store, "add", on_a_full_disk)
        done = CliRunner().invoke(app, [*map(str, words)])
    said = " ".join(done.output.split())
    assert done.exit_code == 2 and f"{os.strerror(errno.ENOSPC)}. Make room on its disk, or " in said, said
    assert f"`{tmp_path / 'out'}/" in said and "Errno" not in said and "None" not in said, said
    done = CliRunner().invoke(app, [*map(str, words)])
    assert done.exit_code == 0 and " runs, " in done.output, done.output


LIMITED = """
import resource, sys
from gapsense import read_campaign
from gapsense._os.files import read_columns
from gapsense.cli import app
from gapsense.many.store import Store
resource.setrlimit(resource.RLIMIT_NOFILE, (int(sys.argv.pop(1)),) * 2)
app()
"""


@pytest.mark.skipif(sys.platform == "win32", reason="sets a limit of POSIX")
@pytest.mark.parametrize(
    ("command", "most"),
    [
        pytest.param(*case, marks=[] if case in (("campaign", 12), ("sweep", 8)) else pytest.mark.slow)
        for case in product(("campaign", "sweep"), (8, 12, 15))
    ],
)
def test_too_many_open_files_are_told_with_what_to_do(study, fmus, tmp_path, most, command):
    given = study if command == "campaign" else "semera_valve"
    words = [str(most), command, str(given), "--fmus", str(fmus), "--out", str(tmp_path / "out"), "--engine", "fmu"]
    done = subprocess.run([sys.executable, "-c", LIMITED, *words], capture_output=True, text=True, check=False)
    said = " ".join(done.stderr.split())
    assert done.returncode == 2 and "Too many open files" in said and "Allow more open files (`ulimit -n`)" in said, (
        said
    )
    assert said.startswith("`") and "Errno" not in said and "Traceback" not in said, said
