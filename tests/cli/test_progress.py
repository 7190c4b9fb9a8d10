"""A command that takes seconds tells how far it is; others do so in test_soft_landing.py."""

from __future__ import annotations

import pytest

from gapsense.scenarios.soft_landing import core_fit as fit


@pytest.mark.slow
def test_progress_rises_to_all_that_is_to_be_done(gapsense, rising, monkeypatch):
    monkeypatch.setattr(fit, "SIMPLER", dict(list(fit.SIMPLER.items())[:2]))
    assert gapsense("study", "reduced-fit").exit_code == 0
    rising()
