"""Flux linkage over current of every actuator, [SEMERA] Fig. 7."""

from __future__ import annotations

from matplotlib.figure import Figure

from gapsense.cosim import Result
from gapsense.report.plot import legend, over, panels


def run_figure(result: Result) -> Figure:
    """Flux linkage over current."""
    figure, ((axis,),) = panels(result.run.title, 1)
    over(axis, result, ("current", 1e3), ("flux_linkage", 1e3))
    axis.set_xlabel("current / mA")
    axis.set_ylabel("flux linkage / mWb")
    legend(axis)
    return figure
