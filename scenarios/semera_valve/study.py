"""Observability of the filters along a scenario."""

from __future__ import annotations

from pathlib import Path

from gapsense import cosim
from gapsense.cli.common import APART, Fmus, Scenario, Variant, show, stop_if_interrupted, study
from gapsense.studies.figures import FIGURES

FIGURES["semera"] = f"{__package__}.show:run_figure"


@study("observability")
def observability(scenario: Scenario = Path("semera_valve"), variant: Variant = None, fmus: Fmus = None) -> None:
    """Observability of the SEMERA filter along a scenario: ranks (31)-(35), (39) and the count per sample."""
    from .show import run_tables

    result = cosim.run(scenario, variant, fmus, **APART)
    stop_if_interrupted(result)
    show(*run_tables(result))
