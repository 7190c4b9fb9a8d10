"""The studies of `BoundedUkf` in tables and figures: Figs. 8 and 9 of [UKF], with what the paper leaves out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from rich.table import Table

from gapsense.cosim import Result
from gapsense.report import plot
from gapsense.report.plot import FAINT, FIRST, SECOND, THIRD, TRUE, legend, line
from gapsense.report.table import table

from .errors import NOISE, UNSEEN, VOLTAGES, Found

PARTS = ("closing", "opening")
STYLES = {
    "bounded UKF, robust": {"color": FIRST, "marker": "o"},
    "bounded UKF, paper": {"color": SECOND, "marker": "s"},
    "bounded EKF": {"color": THIRD, "marker": "^", "linestyle": "--"},
    "open loop": {"color": FAINT, "marker": "x"},
}


RUN = {
    "ukf": ("bounded UKF, robust", FIRST),
    "paper": ("bounded UKF, paper", SECOND),
    "ekf": ("bounded EKF", THIRD),
    "model": ("open loop", "#8250df"),
}
LABELS = (
    "voltage / V",
    "current / mA",
    "position / mm",
    "error of the\nposition / µm",
    "error of the flux\nlinkage / µWb",
)


def noise_tables(found: Found, levels: Sequence[float], seeds: int) -> list[Table | str]:
    """Numbers behind Fig. 8: rms over the seeds."""
    return [
        f"RMS error of the position / um over {seeds} seeds, right parameters; noise sigma_n (37)",
        "[UKF] shows Fig. 8 as curves and prints no numbers. `-` is a filter that leaves the device.\n",
        *_parts(found, [f"{x:g}" for x in levels], _rms),
    ]


def parameter_tables(found: Found, errors: Sequence[float], resistance: float) -> list[Table | str]:
    """Numbers behind Fig. 9: the worst of the sign combinations, closing and opening separately."""
    wrong = f", resistance wrong by {100 * resistance:+g} %" if resistance else ""
    return [
        f"RMS error of the position / um, worst of the 2^6 signs of wrong parameters{wrong}; sigma_n = {NOISE:g}",
        "[UKF] shows Fig. 9 as curves; in words: accurate enough with errors around 1 %.\n",
        *_parts(found, [f"{100 * x:g} %" for x in errors], np.max),
    ]


def resistance_table(found: Mapping[float, Found], error: float) -> Table:
    """What a wrong resistance does by itself, and together with all the other parameters."""
    title = (
        "Resistance wrong (not in the paper): worst RMS error of the position / um of all voltages, closing / opening,"
        f"\nalone and with the worst signs of {100 * error:g} % in six parameters; then the landings missed with these"
    )
    rows = []
    for name in next(iter(found.values())):
        rmse = [of[name].rmse for of in found.values()]
        for what, k in (("alone", 0), ("with the others", 1)):
            rows.append([f"{name}, {what}", *(_both(x[k], np.max) for x in rmse)])
        rows.append([f"{name}, missed", *(_share(of[name].missed[1]) for of in found.values())])
    return table(title, ["", *(f"{100 * r:+g} %" for r in found)], rows)


def unseen_table(found: Found) -> Table:
    """The check by cases that the tuning does not know."""
    title = (
        f"Cases that no tuning was made with: {', '.join(f'{v:g}' for v in UNSEEN)} V, random errors of all parameters"
        "\nand the resistance within +-5 and +-10 %. RMS error of the position / um, closing / opening; landings missed"
    )
    rows = ([name, *(_both(x, _rms) for x in e.rmse), *map(_share, e.missed)] for name, e in found.items())
    return table(title, ["", "5 %", "10 %", "missed 5 %", "missed 10 %"], rows)


def over_noise(found: Found, levels: Sequence[float]) -> Figure:
    """Fig. 8: rms error over the seeds, over the noise."""
    curves = {name: np.sqrt(np.mean(e.rmse**2, axis=2)) for name, e in found.items()}
    return _drawn("Right parameters: [UKF] Fig. 8", curves, levels, "noise $\\sigma_n$ (37)", "rms error / µm")


def over_errors(found: Found, errors: Sequence[float]) -> Figure:
    """Fig. 9: the worst of the sign combinations, over the relative error of six parameters."""
    curves = {name: e.rmse.max(axis=2) for name, e in found.items()}
    percent = [100 * x for x in errors]
    title = "Worst signs of six wrong parameters: [UKF] Fig. 9"
    return _drawn(title, curves, percent, "relative error of the parameters / %", "largest rms error / µm")


def run_figure(result: Result) -> Figure:
    """A run of the scenario: voltage, current, position, and the errors of the estimates with a band of the filter."""
    signals = ("drive.voltage_mean", "sensor.current_measured", "valve.position", "valve.flux_linkage")
    plot.require_recorded(result, [*signals, *(f"{c}.position" for c in RUN), "ukf.position_std", "ukf.flux_linkage"])
    figure, (voltage, current, position, error, flux) = plot.stack(
        result.run.title, [*LABELS], [1.0, 1.0, 1.6, 2.2, 1.2]
    )
    line(voltage, result.times, result["drive.voltage_mean"], TRUE)
    line(current, result.times, 1e3 * result["sensor.current_measured"], TRUE)
    line(position, result.times, 1e3 * result["valve.position"], TRUE, "true", linewidth=2.5, alpha=0.4)
    for name, (title, color) in RUN.items():
        wrong = result[f"{name}.position"] - result["valve.position"]
        line(position, result.times, 1e3 * result[f"{name}.position"], color, title)
        line(error, result.times, 1e6 * wrong, color, title)
    band = 2e6 * result["ukf.position_std"]
    error.fill_between(
        1e3 * result.times, -band, band, color=FIRST, alpha=0.15, step="post", label="robust, 2 std", linewidth=0
    )
    line(flux, result.times, 1e6 * (result["ukf.flux_linkage"] - result["valve.flux_linkage"]), *reversed(RUN["ukf"]))
    for axis in (position, error, flux):
        legend(axis)
    return figure


def _parts(found: Found, heads: Sequence[str], over_runs: Any) -> list[Table]:
    """A table for each voltage and part of the cycle, and one of the landings missed."""
    made = []
    for j, volts in enumerate(VOLTAGES):
        for p, part in enumerate(PARTS):
            rows = ([name, *(_micro(over_runs(x)) for x in e.rmse[:, j, :, p])] for name, e in found.items())
            made.append(table("", [f"{volts:g} V, {part}", *heads], rows))
    count = next(iter(found.values())).missed[0].size
    missed = ([name, *(str(m.sum()) for m in e.missed)] for name, e in found.items())
    return [*made, table("", [f"landings missed, of {count}", *heads], missed)]


def _rms(values: Any) -> Any:
    return np.sqrt(np.mean(values**2))


def _both(rmse: Any, over_runs: Any) -> str:
    """Closing / opening."""
    return "/".join(_micro(over_runs(rmse[..., p])) for p in range(len(PARTS)))


def _share(missed: Any) -> str:
    return f"{missed.sum()} of {missed.size}"


def _micro(value: float) -> str:
    shown = f"{1e6 * value:.3g}" if value < 1e-3 else f"{1e6 * value:.0f}"
    return shown if value < 1e-2 else "-"


def _drawn(title: str, curves: Mapping[str, Any], x: Sequence[float], xlabel: str, ylabel: str) -> Figure:
    """One panel per part of the cycle and voltage; the unbounded filter lies far above all of them."""
    figure, axes = plot.panels(title, len(PARTS), len(VOLTAGES), size=(plot.PAGE, 6.0), sharex=True, sharey=True)
    for p, part in enumerate(PARTS):
        for j, volts in enumerate(VOLTAGES):
            for name, style in STYLES.items():
                axes[p, j].loglog(x, 1e6 * curves[name][:, j, p], label=name, markersize=4, linewidth=1.2, **style)
            axes[p, j].set_title(f"{part}, {volts:g} V", fontsize="medium")
        axes[p, 0].set_ylabel(ylabel)
    for axis in axes[-1]:
        axis.set_xlabel(xlabel)
    plot.legend_below(figure)
    return figure
