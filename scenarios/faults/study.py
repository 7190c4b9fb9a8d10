"""What estimators do with faults of the current's sensor and of the coil."""

from __future__ import annotations

from pathlib import Path

from gapsense.cli.common import Fmus, Out, Scenario, study
from gapsense.cli.console import APART, say_written, show, stop_if_interrupted
from gapsense.studies import FIGURES

SENSOR = ("bias", "drift", "stuck", "dropout", "noise")  # variants drawn side by side

FIGURES["faults"] = f"{__package__}.show:run_figure"


@study("faults")
def faults(scenario: Scenario = Path("faults"), fmus: Fmus = None, to: Out = Path("results")) -> None:
    """Run estimators under every fault of a scenario: errors, time until `health` shows it, a figure."""
    from gapsense import cosim
    from gapsense.report import plot

    from .show import metrics_table, side_by_side

    results = {}
    for variant in (None, *cosim.load(scenario).variants):
        results[variant or "none"] = cosim.run(scenario, variant, fmus, **APART)
        stop_if_interrupted(results[variant or "none"])
    show(metrics_table(results))
    chosen = {name: results[name] for name in SENSOR if name in results} or results
    figure = side_by_side(chosen, "Faults of the current sensor (grey), and what three estimators do with them")
    say_written(plot.save(figure, to / "faults.png"))
