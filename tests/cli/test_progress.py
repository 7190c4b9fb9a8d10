"""Commands that take seconds tell how far they are."""

from __future__ import annotations

from contextlib import contextmanager

import pytest

from gapsense.scenarios.soft_landing import core_fit as fit

COMMANDS = ("soft-landing", "study reference-cycle", "study observability-rts", "study reduced-fit")


@pytest.mark.parametrize("command", COMMANDS)
def test_progress_rises_to_all_that_is_to_be_done(gapsense, monkeypatch, command):
    told = []

    @contextmanager
    def bar(title):
        told.append([])
        yield lambda done, total: told[-1].append((done, total))

    monkeypatch.setattr("gapsense.scenarios.soft_landing.study.bar", bar)
    monkeypatch.setattr(fit, "SIMPLER", dict(list(fit.SIMPLER.items())[:2]))
    assert gapsense(*command.split()).exit_code == 0
    for steps in told:
        totals = {total for _, total in steps}
        shares = [done / total for done, total in steps]
        assert len(totals) == 1 and len(shares) > 1
        assert shares == sorted(shares) and 0.8 < shares[-1] <= 1.0
    assert told
