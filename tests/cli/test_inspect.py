"""`gapsense inspect`."""

from __future__ import annotations

from pathlib import Path

RECORDS = Path(__file__).resolve().parents[1] / "identification" / "records"


def told(gapsense, *arguments):
    done = gapsense("inspect", *arguments)
    assert (done.exit_code, done.stderr) == (0, "")
    return " ".join(done.stdout.split())


def test_command_says_what_is_missing_and_draws(gapsense, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    said = told(gapsense, RECORDS / "tube-150-raw.csv", "--figure", "f.png")
    assert "`current` has 61 steps of its converter only" in said and "no motion is seen" in said
    assert "-3.91 A" in said and "this offset is subtracted" in said
    assert (tmp_path / "f.png").read_bytes().startswith(b"\x89PNG")
    both = told(gapsense, *(RECORDS / f"{name}-raw.csv" for name in ("tube-150", "empty-162")), "--figure", "two.png")
    assert "tube-150-raw: 4000 samples" in both and "empty-162-raw: 4000 samples" in both
    rows = [f"{k * 1e-4:.4f},12,{0.1 * (1.0 - 0.95**k):.4f}" for k in range(60)]
    (tmp_path / "cut.csv").write_text("\n".join(["time [s],voltage [V],current [A]", *rows]) + "\n", encoding="utf-8")
    said = told(gapsense, "cut.csv")
    assert "0 samples at rest first" in said and "no complete operation" in said
