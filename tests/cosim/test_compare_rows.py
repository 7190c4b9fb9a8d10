"""Rows of results are compared by their times: what is missing, double, extra or out of order is told, and where."""

import hashlib
import json
from dataclasses import replace

import numpy as np
import pytest
from test_compare_cli import gapsense, results, three  # noqa: F401  # three results, of 11 rows each

from gapsense import Scenario
from gapsense._os.files import SEAL, seal
from gapsense.cosim import compare_results, test_scenario, update_baseline
from gapsense.cosim.result.compare import apart

TIMES = 2e-5 * np.arange(801.0)
CHANGES = {
    "missing": (lambda rows: [*rows[:100], *rows[700:]], "600 rows are missing", "from t = 0.002 s to 0.01398 s"),
    "one": (lambda rows: [*rows[:400], *rows[401:]], "1 row is missing", "at t = 0.008 s"),
    "first": (lambda rows: rows[1:], "1 row is missing", "at t = 0 s"),
    "last": (lambda rows: rows[:-1], "1 row is missing", "at t = 0.016 s"),
    "half": (lambda rows: [*rows[:200], *rows[601:]], "401 rows are missing", "t = 0.004 s"),
    "double": (lambda rows: sorted([*rows, *rows[300:500]]), "200 rows are at times of rows before", "t = 0.006 s"),
    "all twice": (lambda rows: sorted([*rows, *rows]), "801 rows are at times of rows before", "t = 0 s"),
    "extra": (lambda rows: sorted([*rows, 0.01]), "1 row", "t = 0.01 s"),
    "scattered": (lambda rows: [t for k, t in enumerate(rows) if k % 97], "9 rows are missing", "and at 6 more places"),
    "thinned with a gap": (lambda rows: [*rows[:200:2], *rows[400::2]], "100 rows are missing", "at t = 0.004 s"),
    "most": (lambda rows: [*rows[:3], *rows[-3:]], "795 rows are missing", "from t = 6e-05 s"),
}


@pytest.mark.parametrize("name", CHANGES)
@pytest.mark.parametrize("is_swapped", [False, True])
def test_rows_that_only_one_has_are_told(name, is_swapped):
    change, count, place = CHANGES[name]
    changed = np.array(change(TIMES.tolist()))
    told = "\n".join(apart(*((TIMES, changed) if is_swapped else (changed, TIMES)), "one", "other"))
    assert count in told and place in told, told


@pytest.mark.parametrize("every", [1, 2, 3, 7, 100])
@pytest.mark.parametrize("offset", [0, 1])
def test_coarser_grids_lack_nothing(every, offset):
    assert apart(TIMES[offset * (every > 1) :: every], TIMES, "one", "other") == []
    assert apart(TIMES, TIMES[offset * (every > 1) :: every] * (1 + 1e-15), "one", "other") == []


@pytest.mark.parametrize("step", [3e-5, 2.5e-5, 7e-6, 1e-4])
def test_other_grids_lack_nothing_but_in_gaps(step):
    other = step * np.arange(int(16e-3 / step) + 1.0)
    assert apart(other, TIMES, "one", "other") == []
    gap = other[(other < 4e-3) | (other > 9e-3)]
    assert "one: " in "\n".join(apart(gap, TIMES, "one", "other"))


def lines_of(file) -> list[str]:
    return file.read_text().splitlines()


@pytest.mark.parametrize(
    ("change", "words", "code"),
    [
        (lambda rows: [*rows[:3], *rows[8:]], "5 rows are missing, which a.csv has, from t = 0.3 s to 0.7 s", 1),
        (lambda rows: rows[1:], "1 row is missing, which a.csv has, at t = 0 s", 1),
        (lambda rows: rows[:-1], "1 row is missing", 1),
        (lambda rows: [*rows[:4], *rows[2:]], "2 rows are at times of rows before", 2),
        (lambda rows: [*rows[:4], rows[3], *rows[4:]], "1 row is at times of rows before, at t = 0.3 s", 1),
        (lambda rows: [*rows[:4], rows[5], rows[4], *rows[6:]], "1 rows have a time before", 2),
        (lambda rows: rows[::-1], "10 rows have a time before that of the row above", 2),
    ],
)
def test_compare_tells_other_rows(results, change, words, code):  # noqa: F811
    head, *rows = lines_of(results / "a.csv")
    (results / "cut.csv").write_text("\n".join([head, *change(rows)]) + "\n")
    done = gapsense("compare", "cut.csv", "a.csv")
    said = " ".join(done.output.split())
    assert done.exit_code == code
    assert words in said or (code == 2 and "have a time before" in said), said
    if code == 1:
        assert gapsense("compare", "a.csv", "cut.csv").exit_code == 1


def test_unit_in_a_head_is_held_against_the_side_car(results):  # noqa: F811
    file, beside = results / "a.csv", results / "a.json"
    text = file.read_text().replace('"lag.y [V]"', '"lag.y [mV]"', 1)
    assert text != file.read_text()
    file.write_text(text)
    done = gapsense("compare", "same.csv", "a.csv")
    assert done.exit_code == 2 and "SHA-256" in done.output
    data = json.loads(beside.read_text())
    data = {name: value for name, value in data.items() if name != SEAL}
    beside.write_text(json.dumps(seal({**data, "sha256": hashlib.sha256(text.encode()).hexdigest()})))
    done = gapsense("compare", "same.csv", "a.csv")
    assert done.exit_code == 2 and "`lag.y` is in `mV`, `V` is expected" in " ".join(done.output.split())


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda rows: [*rows[:3], *rows[8:]], "5 rows are missing, which the run has, from t = 0.3 s to 0.7 s"),
        (lambda rows: rows[1:], "1 row is missing, which the run has, at t = 0 s"),
        (lambda rows: [*rows[:4], rows[3], *rows[4:]], "1 row is at times of rows before, at t = 0.3 s"),
        (lambda rows: [*rows[:4], rows[5], rows[4], *rows[6:]], "2 rows have other times: row 4 of the baseline"),
    ],
)
def test_baselines_with_other_rows_fail(write, chain, fmus, change, words):
    path = write(chain)
    file = update_baseline(path, fmus=fmus, write=True).file
    head, *rows = lines_of(file)
    file.write_text("\n".join([head, *change(rows)]) + "\n")
    (failure,) = test_scenario(path, fmus=fmus).failures
    assert words in failure.failure, failure


def test_results_in_memory_are_held_in_the_same_way(fmus, tmp_path):
    with Scenario("chain", tmp_path, fmus, stop=1.0, base_step=0.1) as s:
        s.add("source", "Source")
        whole = s.run()
    cut = replace(whole, times=whole.times[2:], signals={name: x[2:] for name, x in whole.signals.items()})
    assert compare_results(whole, whole).passed
    for pair in ((whole, cut), (cut, whole)):
        assert (
            "the result" in compare_results(*pair).problems[0] or "the reference" in compare_results(*pair).problems[0]
        )
