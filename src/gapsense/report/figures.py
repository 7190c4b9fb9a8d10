"""Figures of a run: stacked time plots that share their time axis."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure

from gapsense.cosim import Result
from gapsense.units import UNITS

Vector = npt.NDArray[np.float64]
ENDINGS = (".png", ".pdf", ".svg")
TRUE, FIRST, SECOND, THIRD, FAINT = "black", "#0969da", "#bc4c00", "#1a7f37", "#8c959f"


def check(kind: str, path: Path | None = None) -> None:
    """Refuse a figure that there is none of, or a file that it cannot be written to, before a long run."""
    if kind not in FIGURES:
        raise ValueError(
            f"the scenario asks for figure `{kind}`; there are {', '.join(FIGURES)}. Correct its key `figure`."
        )
    if path is not None and path.suffix not in ENDINGS:
        raise ValueError(f"`{path}`: figures are written as .png, .pdf or .svg. Change the ending.")


def draw(result: Result, kind: str) -> Figure:
    """The figure of a run: that of its scenario's `figure`, or all recorded signals stacked by unit."""
    check(kind)
    return FIGURES[kind](result)


def save(figure: Figure, path: Path) -> Path:
    """Write a figure under a temporary name first; the ending of `path` says the format."""
    check("overview", path)
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_suffix(f".part{path.suffix}")
    try:
        figure.savefig(temporary, dpi=120, metadata={"Software": None} if path.suffix == ".png" else None)
        return temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def stack(title: str, labels: list[str], heights: list[float] | None = None) -> tuple[Figure, list[Any]]:
    """An empty figure with one panel per label, sharing the time axis."""
    figure = Figure(figsize=(9.0, 0.9 + 1.25 * len(labels)), layout="constrained")
    axes = figure.subplots(len(labels), 1, sharex=True, squeeze=False, height_ratios=heights)[:, 0]
    for axis, label in zip(axes, labels):
        axis.set_ylabel(label)
        axis.grid(True, color="#d0d7de", linewidth=0.5)
        axis.spines[["top", "right"]].set_visible(False)
        axis.margins(x=0.01)
    axes[-1].set_xlabel("time / ms")
    figure.suptitle(title)
    figure.align_ylabels()
    return figure, list(axes)


def line(axis: Any, times: Vector, values: Vector, color: str, label: str | None = None, **style: Any) -> None:
    """A held signal: a step at each communication point."""
    axis.plot(
        1e3 * times,
        values,
        color=color,
        label=label,
        linewidth=style.pop("linewidth", 1.0),
        drawstyle="steps-post",
        **style,
    )


def display(unit: str) -> tuple[str, float]:
    """Unit for display and the factor to it."""
    shown = UNITS[unit].display if unit in UNITS else None
    return (shown.name, shown.factor) if shown else (unit, 1.0)


def legend(axis: Any) -> None:
    """A legend that stands beside the panel and hides nothing."""
    axis.legend(loc="center left", bbox_to_anchor=(1.005, 0.5), frameon=False, fontsize="small")


def recorded(result: Result, names: Iterable[str]) -> None:
    """Refuse to draw a run that does not record these signals; all that are missing are named."""
    missing = [name for name in names if name not in result.signals]
    if missing:
        raise ValueError(
            f"{result.run.scenario}: its figure needs {', '.join(f'`{m}`' for m in missing)}, not recorded. "
            'Add them to `[record]`, or choose `figure = "overview"`.'
        )


def overview(result: Result) -> Figure:
    """All recorded signals, one panel per unit."""
    units = list(dict.fromkeys(result.units[name] for name in result.signals))
    figure, axes = stack(result.run.title, [display(unit)[0] for unit in units])
    for unit, axis in zip(units, axes):
        for k, name in enumerate(n for n in result.signals if result.units[n] == unit):
            line(axis, result.times, display(unit)[1] * result[name], f"C{k}", name)
        legend(axis)
    return figure


def semera(result: Result) -> Figure:
    """Figure 3 of [SEMERA]: measurements, estimates against the truth, signal-to-noise ratios, observability."""
    from gapsense.report.semera import figure

    return figure(result)


def pot_magnet(result: Result) -> Figure:
    """Figures 4 to 7 of [HEKF]: current, position, velocity and mode of the magnet, true and estimated."""
    from gapsense.report.pot_magnet import figure

    return figure(result)


def hysteresis_loops(result: Result) -> Figure:
    """Flux density over field in the core."""
    from gapsense.report.loops import core

    return core(result)


def locked_plunger(result: Result) -> Figure:
    """Figure 7 of [SEMERA]: flux linkage over current."""
    from gapsense.report.loops import linkage

    return linkage(result)


def soft_landing(result: Result) -> Figure:
    """Cycles without impact, and the errors of four estimators."""
    from gapsense.report.soft_landing import figure

    return figure(result)


def profiles(result: Result) -> Figure:
    """Figure 12 of [RTS]: one cycle, and its making and breaking with the estimates."""
    from gapsense.report.profiles import cycle

    return cycle(result)


def estimators(result: Result) -> Figure:
    """Positions and flux linkages of all estimators against the truth."""
    from gapsense.report.estimators import run

    return run(result)


FIGURES: dict[str, Callable[[Result], Figure]] = {
    "overview": overview,
    "semera": semera,
    "pot_magnet": pot_magnet,
    "hysteresis_loops": hysteresis_loops,
    "locked_plunger": locked_plunger,
    "soft_landing": soft_landing,
    "profiles": profiles,
    "estimators": estimators,
}
