"""Loops: flux density over field in the core, and flux linkage over current ([SEMERA] Fig. 7), of every actuator."""

from __future__ import annotations

from typing import Any

from matplotlib.figure import Figure

from gapsense.cosim import Result
from gapsense.report.figures import legend, recorded

NEAR = 1.0  # half width of the middle of the B-H plane [kA/m]


def core(result: Result) -> Figure:
    """Flux density over field: all of it, and its middle."""
    drawn, axes = panels(result.run.title, 2)
    for axis in axes:
        draw(axis, result, ("core_field", 1e-3), ("flux_density", 1.0))
        axis.set_xlabel("field in the core / (kA/m)")
    axes[1].set_xlim(-NEAR, NEAR)
    axes[0].set_ylabel("flux density in the core / T")
    legend(axes[1])
    return drawn


def linkage(result: Result) -> Figure:
    """Flux linkage over current."""
    drawn, (axis,) = panels(result.run.title, 1)
    draw(axis, result, ("current", 1e3), ("flux_linkage", 1e3))
    axis.set_xlabel("current / mA")
    axis.set_ylabel("flux linkage / mWb")
    legend(axis)
    return drawn


def panels(title: str, count: int) -> tuple[Figure, Any]:
    """An empty figure with panels side by side that share their vertical axis."""
    figure = Figure(figsize=(1.0 + 5.0 * count, 5.0), layout="constrained")
    axes = figure.subplots(1, count, sharey=True, squeeze=False)[0]
    for axis in axes:
        axis.grid(True, color="#d0d7de", linewidth=0.5)
        axis.spines[["top", "right"]].set_visible(False)
    figure.suptitle(title)
    return figure, axes


def draw(axis: Any, result: Result, x: tuple[str, float], y: tuple[str, float]) -> None:
    """The second signal over the first, of each component that has both, times their factors."""
    names = [name.partition(".")[0] for name in result.signals if name.endswith(f".{x[0]}")]
    recorded(result, [f"{name}.{s}" for name in names or ["<actuator>"] for s in (x[0], y[0])])
    for k, name in enumerate(names):
        axis.plot(x[1] * result[f"{name}.{x[0]}"], y[1] * result[f"{name}.{y[0]}"], f"C{k}", label=name, linewidth=1.0)
