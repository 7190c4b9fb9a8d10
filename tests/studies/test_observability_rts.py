"""Observability of the reduced model: Jacobians against complex steps through the textbook model, ranks, Fig. 6."""

from __future__ import annotations

import numpy as np
import pytest
import reduced_model_textbook as textbook
from reduced_model_textbook import TABLE_I

from gapsense.report.table import text
from gapsense.scenarios.soft_landing.cycle import reference, sampled
from gapsense.scenarios.soft_landing.observability import (
    along_reference_cycle,
    counts,
    rank,
    samples_needed,
    scales,
    windows,
)
from gapsense.scenarios.soft_landing.reference import reference_states
from gapsense.scenarios.soft_landing.setting import nominal, unvaried

MODEL = nominal()
LANDINGS = [250, 750]
SOME = [0, 30, 49, 50, 51, 53, 120, 246, 248, 249, 250, 251, 400, 499, 550, 552, 650, 747, 749, 750, 751, 999]


@pytest.fixture(scope="module")
def cycle():
    s = sampled(reference())
    x = reference_states(s, unvaried(MODEL), MODEL)
    states = np.column_stack([x.position, x.position_prev, x.flux_linkage, x.current_error[0], x.force_error[0]])
    return states[:-1], s.current[:-1], s.voltage[:-1], s.mode[:-1]


@pytest.fixture(scope="module")
def needed(cycle):
    return samples_needed(*cycle, MODEL)


def outputs(x, i, count, voltage, mode):
    """(48) and (49), by the textbook model."""
    found = [] if mode[i - 1] == 2 else [x[1]]
    for k in range(i, i + count):
        q = int(mode[k % mode.size])
        found += [textbook.h(x, TABLE_I)] if q == 2 else [textbook.h(x, TABLE_I), x[0]]
        x = textbook.f(x, float(voltage[k % mode.size]), q, TABLE_I)
    return np.array(found)


def complex_step(x, i, count, voltage, mode):
    columns = []
    for k in range(5):
        moved = np.array(x, np.clongdouble)
        moved[k] += np.clongdouble(1e-40j)
        columns.append(outputs(moved, i, count, voltage, mode).imag / np.longdouble(1e-40))
    return np.array(columns).T


def rank_by_elimination(matrix, tolerance):
    """Rank in extended precision, by elimination with complete pivoting."""
    a = np.array(matrix, np.longdouble)
    for done in range(min(a.shape)):
        row, column = np.unravel_index(np.abs(a[done:, done:]).argmax(), a[done:, done:].shape)
        if abs(a[done + row, done + column]) <= tolerance * np.abs(matrix).max():
            return done
        a[[done, done + row]] = a[[done + row, done]]
        a[:, [done, done + column]] = a[:, [done + column, done]]
        a[done + 1 :] -= np.outer(a[done + 1 :, done] / a[done, done], a[done])
    return min(a.shape)


@pytest.mark.parametrize("i", SOME)
def test_matrices_and_ranks_equal_complex_steps_through_the_textbook_model(cycle, i):
    states, current, voltage, mode = cycle
    scale = scales(states, current)
    for count, window in zip(range(1, 7), windows(i, states, voltage, mode, MODEL, scale)):
        exact = complex_step(states[i], i, count, voltage, mode) * scale.state
        is_current = np.ones(len(exact), bool)
        is_current[0] = mode[i - 1] == 2
        position = 0 if is_current[0] else 1
        for k in range(i, i + count):
            position += 1
            if mode[k % mode.size] != 2:
                is_current[position] = False
                position += 1
        exact[is_current] /= scale.current
        assert np.abs(window.matrix - exact).max() < 1e-12 * np.abs(exact).max()
        assert rank(window.matrix) == rank_by_elimination(exact, 1e-13)


def test_counts_are_those_of_figure_6(cycle, needed):
    *_, mode = cycle
    assert np.flatnonzero(np.isinf(needed)).tolist() == LANDINGS
    resting, moving = needed[mode != 2], needed[mode == 2]
    assert np.sum(resting == 2) == resting.size - 4  # but the two landings, and the samples before each take-off
    assert sorted(resting[resting != 2]) == [3.0, 3.0, np.inf, np.inf]
    assert np.sum(moving == 5) >= moving.size - 8
    assert moving.min() >= 3 and moving.max() == 5


@pytest.mark.parametrize("tolerance", [1e-11, pytest.param(1e-13, marks=pytest.mark.slow), 1e-14])
def test_counts_do_not_hang_on_the_tolerance(cycle, needed, tolerance):
    assert np.array_equal(samples_needed(*cycle, MODEL, tolerance), needed)


def test_settled_coil_is_not_observable_without_motion_of_the_flux(cycle):
    """Two samples tell flux and current error apart by the curvature of the core only, while the flux changes."""
    states, current, _, mode = cycle
    x = states[400].copy()
    settled = np.full(mode.size, 48.0 * textbook.h(x, TABLE_I))  # the voltage that keeps the flux as it is
    needed = samples_needed(np.tile(x, (20, 1)), current[:20], settled[:20], np.full(20, 1.0), MODEL, 1e-12)
    assert np.isinf(needed).all()


def test_report_says_what_was_found():
    report = text(*counts(along_reference_cycle((1e-12, 1e-9))))
    assert "never observable: t = 5 ms, 15 ms" in report
    assert "tolerance 1e-12: 0 of 1000 counts differ, largest 5" in report
    assert report.count("counts differ") == 2
