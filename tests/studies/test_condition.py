"""The study of `Monitor`: what it draws, and what must hold, by seeds that chose nothing."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from gapsense.cli import app
from gapsense.report.table import text
from gapsense.scenarios.condition import cases
from gapsense.scenarios.condition.cases import CASES, COURSE, DEMANDED, LONG, Course, devices, document, times
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
    shown = text(*cases_table(found, COURSE), alarm_sentence(Alarms(12000, 1, 2)))
    assert all(name in shown for name in CASES) and "1 false alarms in 12000 operations" in shown
    axis = causes_figure(found, COURSE).axes[0]
    assert [label.get_text() for label in axis.get_yticklabels()] == [*CASES]
    assert {t.get_text() for t in axis.texts} == {"100"}


@pytest.mark.slow
@pytest.mark.usefixtures("wide")
def test_command_judges_two_devices(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One fault for eight operations, and a short time without one."""
    name = "spring 40 % weaker"
    monkeypatch.setattr(cases, "CASES", {name: CASES[name]})
    monkeypatch.setattr(cases, "COURSE", Course(rests={}, spans=((74, 82),), operations=90))
    monkeypatch.setattr(cases, "LONG", Course(rests={}, spans=(), operations=80))
    words = ["study", "condition", "--devices", "2", "--healthy", "1", "--seed", "702", "--out", str(tmp_path)]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.output
    (row,) = [line.split() for line in done.output.splitlines() if name in line and "%" in line.split(name)[1]]
    assert row[len(name.split()) :] == ["8", "100", "%", "2", "100", "%", "100", "%", "2"]
    assert "0 false alarms in" in done.output and "0 were called worn" in done.output
    assert (tmp_path / "condition.png").stat().st_size > 10_000


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
    assert found.operations > 10_000 and found.faults <= 1 and found.worn <= 1
