"""The study of `Monitor`: what it draws, and what must hold, by seeds that chose nothing."""

from __future__ import annotations

import numpy as np
import pytest

from gapsense.report.table import text
from gapsense.scenarios.condition.cases import CASES, COURSE, DEMANDED, LONG, devices, document, times
from gapsense.scenarios.condition.judge import NAMES, Alarms, Span, alarms, judged, said, shares, times_of
from gapsense.scenarios.condition.show import alarm_sentence, cases_table, causes_figure

FINE = Span(told=2.0, cause="spring", is_lasting=True, passed=2.0)


def quietly(done: int) -> None:
    """Nobody looks."""


def test_what_was_said_of_a_span_is_counted_in_operations() -> None:
    t = times_of(2000)
    verdict = np.where((t >= 0.115) & (t < 0.145), 3.0, 1.0)
    rows = np.column_stack([verdict, 5.0 * (verdict > 2.0), np.where(t < 0.115, 0.0, 1.0)])
    found = said(rows, 0.095, 0.125)
    assert (found.told, found.passed) == (pytest.approx(2.0, abs=0.02), pytest.approx(2.0, abs=0.02))
    assert (found.cause, found.is_lasting) == ("spring", True)
    assert shares([found, found._replace(cause="", told=np.inf)], CASES["spring broken"]) == (0.5, 0.5, 1.0)


def test_faults_begin_at_rest_and_devices_differ() -> None:
    assert all((begin < end) for case in CASES.values() for begin, end in times(case, COURSE))
    closed, opened = times(CASES["stuck at the lower stop"], COURSE), times(CASES["spring broken"], COURSE)
    assert closed[0][0] - opened[0][0] == pytest.approx(10e-3, abs=1e-9)
    drawn = devices(8, 1)
    assert len({d["actuator.mover.mass"] for d in drawn}) == 8 and drawn == devices(8, 1) != devices(8, 2)
    assert document(CASES["circuit open"], NAMES, COURSE).data["events"]["fault_1_0"]["value"] == 100e3


def test_table_and_figure_have_every_fault() -> None:
    found = {name: [[FINE, FINE._replace(cause="")]] for name in CASES}
    shown = text(*cases_table(found), alarm_sentence(Alarms(12000, 1, 2)))
    assert all(name in shown for name in CASES) and "1 false alarms in 12000 operations" in shown
    axis = causes_figure(found).axes[0]
    assert [label.get_text() for label in axis.get_yticklabels()] == [*CASES]
    assert {t.get_text() for t in axis.texts} == {"100"}


@pytest.mark.slow
@pytest.mark.parametrize("name", [*CASES][:DEMANDED])
def test_faults_are_told_named_and_pass(name: str) -> None:
    found = judged(CASES[name], 8, 700, quietly)
    assert len(found) == 8
    for spans in zip(*found):
        told, right, passed = shares(spans, CASES[name])
        assert told >= 0.85 and right >= 0.85 and passed >= 0.85


@pytest.mark.slow
def test_healthy_devices_are_healthy() -> None:
    found = alarms(13, 701, LONG, quietly)
    assert found.operations > 10_000 and found.faults <= 1
