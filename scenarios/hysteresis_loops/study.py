"""Loops of flux density over field in the core of every actuator."""

from __future__ import annotations

from typing import Any

from gapsense import cosim
from gapsense.studies import FIGURES

FIGURES["hysteresis_loops"] = f"{__name__}:run_figure"
NEAR = 1.0  # half width of the middle of the B-H plane [kA/m]


def run_figure(result: cosim.Result) -> Any:
    """Flux density over field: all of it, and its middle."""
    from gapsense.report.plot import legend, over, panels

    figure, ((whole, middle),) = panels(result.run.title, 1, 2, sharey=True)
    for axis in (whole, middle):
        over(axis, result, ("core_field", 1e-3), ("flux_density", 1.0))
        axis.set_xlabel("field in the core / (kA/m)")
    middle.set_xlim(-NEAR, NEAR)
    middle.set_xticks([-NEAR, 0.0, NEAR])
    whole.set_ylabel("flux density in the core / T")
    legend(middle)
    return figure
