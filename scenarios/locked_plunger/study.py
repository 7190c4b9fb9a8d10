"""Flux linkage over current of every actuator, [SEMERA] Fig. 7."""

from __future__ import annotations

from typing import Any

from gapsense import cosim
from gapsense.studies import FIGURES

FIGURES["locked_plunger"] = f"{__name__}:run_figure"


def run_figure(result: cosim.Result) -> Any:
    """Flux linkage over current."""
    from gapsense.report.plot import legend, over, panels

    figure, ((axis,),) = panels(result.run.title, 1)
    over(axis, result, ("current", 1e3), ("flux_linkage", 1e3))
    axis.set_xlabel("current / mA")
    axis.set_ylabel("flux linkage / mWb")
    legend(axis)
    return figure
