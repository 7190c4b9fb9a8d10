"""The studies of the smoother: what they print and write, and what they refuse."""

from __future__ import annotations

import numpy as np
import pytest

from gapsense._os.files import read_columns

PNG = b"\x89PNG\r\n\x1a\n"


@pytest.mark.slow
def test_monte_carlo_prints_tables_and_orderings_and_writes_figures_and_numbers(gapsense, tmp_path):
    out = tmp_path / "new" / "out"
    done = gapsense("study", "monte-carlo", "--runs", 6, "--widths", "1,10", "--workers", 1, "--out", out)
    assert done.exit_code == 0, done.output
    for title in ("NRMSE of the position in the making", "NRMSE of the velocity in the breaking", "Process noise (60)"):
        assert title in done.output
    assert "ERTSS better than EKF: 8 of 8 cases" in done.output
    assert "ERTSS better than without e_i up to 10 %: 8 of 8 cases" in done.output
    assert "4 tasks computed now" in done.output
    for name in ("monte_carlo.png", "monte_carlo_worst.png"):
        assert (out / name).read_bytes().startswith(PNG)
    columns = read_columns(out / "monte_carlo.csv")
    np.testing.assert_array_equal(columns["width"], [0.01, 0.1])
    assert np.all(columns["ERTSS, making, position"] < columns["EKF, making, position"])
    assert len(columns) == 1 + 5 * 2 * 2
    again = gapsense("study", "monte-carlo", "--runs", 6, "--widths", "10", "--workers", 1, "--out", out)
    assert "0 tasks computed now" in again.output


@pytest.mark.slow
def test_consistency_prints_its_numbers_beside_the_published(gapsense, tmp_path):
    done = gapsense("study", "consistency", "--runs", 5, "--out", tmp_path / "out")
    assert done.exit_code == 0, done.output
    assert "89.56 %" in done.output and "4.9477" in done.output and "NEE of e_F,k within +-1.645" in done.output
    for name in ("consistency_nees.png", "consistency_nee.png"):
        assert (tmp_path / "out" / name).read_bytes().startswith(PNG)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("monte-carlo", "--widths", "1,ten"), "numbers separated by commas"),
        (("monte-carlo", "--widths", "-1", "--runs", "2"), "none negative"),
        (("monte-carlo", "--widths", "200", "--runs", "2"), "all below 200 %"),
        (("monte-carlo", "--core", "guessed"), "`fitted` or `published` expected"),
        (("consistency", "--core", "guessed"), "`fitted` or `published` expected"),
    ],
    ids=str,
)
def test_wrong_options_are_refused(gapsense, arguments, words):
    done = gapsense("study", *arguments)
    assert done.exit_code == 2 and words in " ".join(done.output.split())
