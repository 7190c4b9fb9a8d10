"""`gapsense fem`."""

from __future__ import annotations

from pathlib import Path

TABLE = Path(__file__).resolve().parents[1] / "identification" / "records" / "lifting-magnet-static.csv"


def test_command_writes_set_law_map_and_figure(gapsense, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = gapsense("fem", TABLE, "--turns", "957", "--current", "1.2", "--out", "m.toml", "--figure", "f.png")
    assert (done.exit_code, done.stderr) == (0, "")
    assert "m.toml, m_law.csv, m_map.csv written." in done.stdout and "not told by one current" in done.stdout
    assert "19 of 19   falls 1.1 %" in done.stdout
    assert Path("f.png").read_bytes().startswith(b"\x89PNG")


def test_table_that_contradicts_itself_is_refused(gapsense, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    lines = TABLE.read_text(encoding="utf-8").splitlines()
    cells = lines[9].split(",")
    Path("t.csv").write_text("\n".join([*lines[:9], ",".join([*cells[:3], f"{0.7 * float(cells[3])}"]), *lines[10:]]))
    done = gapsense("fem", "t.csv", "--turns", "957", "--current", "1.2")
    assert done.exit_code == 2 and "line 10" in done.stderr and not Path("fem.toml").exists()
