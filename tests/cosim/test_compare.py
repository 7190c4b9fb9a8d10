"""Two results are held against each other: tolerances, edges that move, other grids, what only one of them has."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from gapsense.cosim import run
from gapsense.cosim.result.compare import Difference, edges, find_moved_edges, reach, resample
from gapsense.cosim.result.pairs import (
    Trajectories,
    Window,
    compare_results,
    compare_trajectories,
    of_result,
    pair_files,
    read_trajectories,
)
from gapsense.cosim.result.result import Run, Signal
from gapsense.cosim.scenario.records import Baseline, Tolerance
from gapsense.problems import InputError

TIMES = np.arange(101) * 1e-3
SQUARE = np.where((TIMES > 0.0305) & (TIMES < 0.0605), 30.0, 0.0)
SINE = np.sin(40.0 * TIMES)
NUMBERS = st.floats(-1e6, 1e6)
RUN = Run("t", "s", None, "jacobi", 0.0, 0.1, 1e-3, 1, {}, {"a": {"step": 1, "offset": 0}}, ("a",), (), {}, {})


def how(rtol: float = 1e-6, atol: float = 0.0, edge_steps: int = 1, **own: Tolerance) -> Baseline:
    return Baseline(Path(), None, Tolerance(rtol, atol, edge_steps), own)


def trajectories(name: str, times=TIMES, nominal: float = 1.0, **signals) -> Trajectories:
    about = {f"a.{key}": Signal("V", nominal, "output") for key in signals}
    return Trajectories(name, times, {f"a.{key}": value for key, value in signals.items()}, about, RUN)


def held(values, reference=SQUARE, **options):
    found = compare_trajectories(
        trajectories("new", y=values), trajectories("old", y=reference), how(**options), Window()
    )
    assert not found.problems
    return found.signals[0]


def shifted(values, rows: int):
    return (
        np.concatenate([np.full(rows, values[0]), values[:-rows]]) if rows > 0 else shifted(values[::-1], -rows)[::-1]
    )


@pytest.mark.parametrize("rows", [-1, 1])
def test_an_edge_may_come_one_step_earlier_or_later(rows):
    found = held(shifted(SQUARE, rows))
    assert found.passed and found.edges == 2
    assert not held(shifted(SQUARE, rows), edge_steps=0).passed


@pytest.mark.parametrize("rows", [-2, 2])
def test_an_edge_that_comes_two_steps_earlier_or_later_fails_at_the_rows_between(rows):
    found = held(shifted(SQUARE, rows))
    assert found.failing.sum() == 4
    assert held(shifted(SQUARE, rows), edge_steps=2).passed


def test_what_moves_besides_edges_fails():
    assert not held(shifted(SINE, 1), SINE).passed  # a smooth signal that is late
    noise = np.random.default_rng(1).normal(size=TIMES.size)
    assert not edges(noise).any()
    assert not held(shifted(noise, 1), noise).passed


@pytest.mark.parametrize("row", [10, 30, 31, 45])
def test_a_pulse_too_many_or_one_too_few_fails_wherever_it_is(row):
    glitch = SQUARE.copy()
    glitch[row] = 30.0 - glitch[row]
    apart = row not in (30, 31)  # beside an edge it is an edge that has moved
    assert held(glitch).passed is not apart
    assert held(SQUARE, glitch).passed is not apart


def test_an_edge_to_another_level_fails():
    assert not held(np.where(SQUARE > 0.0, 29.0, 0.0)).passed
    overshoot = SQUARE.copy()
    overshoot[31] = 31.0
    assert held(overshoot).failing.sum() == 1


@given(arrays(np.float64, 30, elements=NUMBERS), st.integers(0, 3))
def test_a_signal_is_never_moved_from_itself(values, rows):
    """Whatever lies between neighbours of its own: each row is between the least and the greatest around it."""
    difference = Difference("a", "V", TIMES[:30], values, values, Tolerance(0.0, 0.0), 1.0, rows)
    assert difference.passed and difference.is_equal and difference.share == 0.0


@given(arrays(np.float64, 20, elements=NUMBERS), arrays(np.float64, 20, elements=NUMBERS), st.floats(0, 10))
def test_excuses_are_the_same_both_ways_round(values, reference, allowed):
    assert (find_moved_edges(values, reference, allowed, 2) == find_moved_edges(reference, values, allowed, 2)).all()


@given(arrays(np.float64, 20, elements=NUMBERS), st.floats(0, 1e3), st.integers(0, 19))
def test_without_edges_the_tolerance_decides_alone(reference, by, row):
    values = reference.copy()
    values[row] += by
    expected = not abs(values[row] - reference[row]) <= 1.0 + 0.5 * 4.0
    difference = Difference("a", "V", TIMES[:20], values, reference, Tolerance(0.5, 1.0), 4.0)
    assert difference.failing.any() == expected


@pytest.mark.parametrize(("value", "reference"), [(math.nan, 0.0), (0.0, math.nan), (math.nan, math.nan)])
def test_nan_differs_from_everything(value, reference):
    difference = Difference("a", "V", TIMES[:1], np.array([value]), np.array([reference]), Tolerance(1.0, 1e9), 1.0, 1)
    assert not difference.passed and difference.share == math.inf
    assert "nan instead of" in str(difference) or "instead of nan" in str(difference)


def test_infinities_of_one_sign_are_equal():
    both = np.array([math.inf, -math.inf])
    assert Difference("a", "V", TIMES[:2], both, both, Tolerance(), 1.0).passed


def test_three_lines_tell_what_where_and_by_how_much():
    values = SINE.copy()
    values[[20, 50]] += [0.1, -0.5]
    lines = str(held(values, SINE, rtol=1e-2)).splitlines()
    assert lines[0] == "a.y [V]: 2 of 101 rows differ from old by more than 0.01"
    assert lines[1].startswith("  first t = 0.02 s: ") and "; worst t = 0.05 s: " in lines[1]
    assert lines[2].startswith("  worst by 0.5 V, 50 times the 0.01 V allowed: atol 0 + rtol 0.01 x nominal 1")
    assert len(lines) == 3


def test_failing_signals_come_first_and_the_worst_of_them_at_the_top():
    new = trajectories("new", a=SINE, b=SINE + 0.1, c=SINE + 0.5)
    old = trajectories("old", a=SINE, b=SINE, c=SINE, d=SINE)
    found = compare_trajectories(new, old, how(), Window())
    heads = [line for sentence in found.sentences for line in sentence.splitlines() if line[0] != " "]
    assert [head.partition(" ")[0] for head in heads] == ["a.c", "a.b", "only"]
    assert "only in old: `a.d`" in heads[2] and not found.passed
    assert found.summary.startswith("1 of 3 signals within their tolerance, 1 of them equal")


def test_tolerances_of_patterns_go_before_the_general_one():
    new, old = trajectories("new", x=SINE + 0.1, y=SINE + 0.1), trajectories("old", x=SINE, y=SINE)
    found = compare_trajectories(new, old, how(**{"a.x*": Tolerance(0.0, 0.2)}), Window())
    assert [d.name for d in found.failing] == ["a.y"]


@pytest.mark.parametrize("every", [2, 5])
def test_rows_of_a_finer_grid_are_compared_where_the_coarser_one_has_rows(every):
    fine, coarse = trajectories("fine", y=SINE), trajectories("coarse", TIMES[::every], y=SINE[::every])
    for pair in ((fine, coarse), (coarse, fine)):
        found = compare_trajectories(*pair, how(0.0), Window())
        assert found.passed and found.signals[0].is_equal  # no interpolation where there are rows
        assert found.signals[0].times.size == TIMES[::every].size


def test_between_rows_lines_are_drawn_and_whole_numbers_hold():
    at = np.array([0.0, 0.25, 0.5, 1.5, 2.0])
    assert resample(np.arange(3.0), np.array([0.0, 0.5, 0.0]), at).tolist() == [0.0, 0.125, 0.25, 0.25, 0.0]
    assert resample(np.arange(3.0), np.array([0.0, 1.0, 4.0]), at).tolist() == [0.0, 0.0, 0.0, 1.0, 4.0]
    assert resample(np.array([0.0, 1.0, 1.0, 2.0]), np.array([0.0, 1.5, 3.0, 3.0]), np.array([1.0, 1.5])).tolist() == [
        3.0,
        3.0,
    ]  # at a time that is there twice the second row counts


@given(st.floats(0.1, 50.0), st.integers(2, 9))
def test_a_line_is_the_same_line_on_any_grid(slope, count):
    times = np.linspace(0.0, 1.0, count)
    found = resample(times, slope * times + 0.5, np.linspace(0.0, 1.0, 23))
    assert np.allclose(found, slope * np.linspace(0.0, 1.0, 23) + 0.5, rtol=1e-12)


def test_other_lengths_differ_unless_a_window_leaves_them_out():
    long, short = trajectories("long", y=SINE), trajectories("short", TIMES[:51], y=SINE[:51])
    found = compare_trajectories(long, short, how(), Window())
    assert "long goes from 0 s to 0.1 s, short from 0 s to 0.05 s" in found.problems[0]
    assert compare_trajectories(long, short, how(), Window(before=0.04)).passed
    wrong = trajectories("wrong", y=np.where(TIMES < 0.05, SINE, 9.0))
    assert compare_trajectories(wrong, long, how(), Window(before=0.04)).passed
    assert not compare_trajectories(wrong, long, how(), Window(after=0.04)).passed
    assert "no times in common" in compare_trajectories(long, short, how(), Window(after=0.07)).problems[-1]


def test_other_units_differ():
    old = trajectories("old", y=SINE)
    new = old._replace(name="new", about={"a.y": replace(old.about["a.y"], unit="mV")})
    assert compare_trajectories(new, old, how(), Window()).problems == (
        "a.y: it is in mV in new, in V in old. Nothing is converted.",
    )


def test_steps_are_those_of_the_component_and_at_least_a_row():
    assert reach(1, 1e-3, TIMES) == 1
    assert reach(1, 2e-3, TIMES) == 2
    assert reach(1, 1e-3, TIMES[::4]) == 1
    assert reach(0, 1e-3, TIMES) == 0


def test_a_result_equals_itself_on_disk_and_not_another_run(write, chain, fmus, tmp_path):
    result, other = (run(write(chain.replace("2.0", slope)), fmus=fmus) for slope in ("2.0", "2.1"))
    file = result.save(tmp_path / "a.csv")
    same = compare_trajectories(of_result(result, "run"), read_trajectories(file), how(0.0), Window())
    assert same.passed and all(d.is_equal for d in same.signals) and len(same.signals) == 7
    found = compare_trajectories(of_result(other, "other"), read_trajectories(file), how(), Window())
    assert {"source.y", "lag.u", "lag.y"} <= {d.name for d in found.failing}
    assert compare_results(result, result, 0.0).passed and not compare_results(other, result).passed
    assert compare_results(other, result, atol=1.0).passed
    stopped = compare_trajectories(of_result(replace(result, interrupted=True), "run"), same_as(file), how(), Window())
    assert stopped.problems == ("run: the run was interrupted.",)


def same_as(file: Path) -> Trajectories:
    return read_trajectories(file)


def test_a_csv_file_of_others_has_units_and_no_nominal_values(tmp_path):
    file = tmp_path / "other.csv"
    file.write_text('time,"a.y [V]"\n' + "".join(f"{t!r},{v!r}\n" for t, v in zip(TIMES.tolist(), SINE.tolist())))
    read = read_trajectories(file)
    assert read.about["a.y"].unit == "V" and math.isnan(read.about["a.y"].nominal)
    found = compare_trajectories(trajectories("new", nominal=20.0, y=SINE + 0.1), read, how(1e-2), Window())
    assert found.passed and found.signals[0].nominal == 20.0


@pytest.mark.parametrize(
    ("text", "word"),
    [("time,y\n1.0,2.0\n", "at least two rows"), ("y\n1\n2\n", "time [s]"), ("time,y\n1,1\n0,1\n", "do not fall")],
)
def test_a_csv_file_without_rising_times_is_refused(tmp_path, text, word):
    file = tmp_path / "wrong.csv"
    file.write_text(text)
    with pytest.raises(InputError, match=word.replace("[", r"\[").replace("]", r"\]")):
        read_trajectories(file)


def test_folders_are_compared_file_by_file(write, chain, fmus, tmp_path):
    result = run(write(chain), fmus=fmus)
    for name in ("old/x.csv", "old/deep/y.csv", "new/x.csv", "new/deep/y.csv"):
        result.save(tmp_path / name)
    (tmp_path / "new" / "table.csv").write_text("a,b\n1,2\n")  # no result
    pairs = [*pair_files(tmp_path / "new", tmp_path / "old")]
    assert [(a.name, b.name) for a, b in pairs] == [("y.csv", "y.csv"), ("x.csv", "x.csv")]
    (tmp_path / "old" / "x.csv").unlink()
    result.save(tmp_path / "old" / "z.csv")
    with pytest.raises(InputError) as caught:
        [*pair_files(tmp_path / "new", tmp_path / "old")]
    assert len(caught.value.problems) == 2
    with pytest.raises(InputError, match="is a folder"):
        [*pair_files(tmp_path / "new", tmp_path / "old" / "z.csv")]
    with pytest.raises(InputError, match="no result"):
        [*pair_files(write(chain, "empty").parent, write(chain, "none").parent)]


def test_signals_that_nobody_has_are_refused():
    with pytest.raises(InputError, match=r"Did you mean `a\.yy`"):
        compare_trajectories(*2 * [trajectories("new", yy=SINE)], how(), Window(("a.yx",)))
