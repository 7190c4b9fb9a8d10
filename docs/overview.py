"""The first figure of the README: `python docs/overview.py` runs the scenario that `gapsense new` writes and draws it.

The error is drawn on an axis of its own, since beside the stroke it is too small to be seen.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from gapsense import Result, run
from gapsense.cli.new import write

SIZE = (6.4, 5.6)  # in inches: text stays legible where a phone shows the figure 9 cm wide


def draw(result: Result) -> Figure:
    """Current; true and estimated position, with the error and its root mean square."""
    figure = Figure(figsize=SIZE, dpi=150, layout="constrained")
    above, below = figure.subplots(2, sharex=True, height_ratios=[2, 3])
    times = 1e3 * result.times
    above.plot(times, 1e3 * result["sensor.current_measured"], color="0.3", linewidth=1.2)
    above.set_title("Measured: coil current, with voltage and contact", loc="left", fontsize=13)
    above.set_ylabel("current / mA", fontsize=12)

    true, estimate = 1e3 * result["valve.position"], 1e3 * result["ekf.position"]
    error = 1e3 * (estimate - true)
    below.plot(times, true, color="0.75", linewidth=6, label="true")
    below.plot(times, estimate, color="C0", linewidth=1.6, label="estimated")
    below.set_title("Wanted: position of the armature", loc="left", fontsize=13)
    below.set_ylabel("gap / mm", fontsize=12)
    below.set_ylim(-0.75, 1.0)
    below.set_yticks([0.0, 0.3, 0.6, 0.9])
    below.set_xlabel("time / ms", fontsize=12)

    beside = below.twinx()
    beside.plot(times, error, color="C3", linewidth=1.2, label="error")
    beside.set_ylim(-75.0, 450.0)
    beside.set_yticks([-50, 0, 50])
    beside.set_ylabel("error / um", fontsize=12, color="C3", loc="bottom")
    beside.tick_params(colors="C3")
    text = f"error: {np.sqrt(np.mean(error**2)):.0f} um RMS"
    beside.text(39.5, 60.0, text, color="C3", fontsize=12, ha="right", va="bottom")
    below.legend(
        loc="center",
        bbox_to_anchor=(8.2, 0.5),
        bbox_transform=below.transData,
        fontsize=12,
        frameon=False,
        handlelength=1,
    )
    for axes in (above, below, beside):
        axes.tick_params(labelsize=11)
        axes.spines["top"].set_visible(False)
    return figure


def make(file: Path) -> None:
    """Run the scenario in a folder that is then removed, and save the figure."""
    with tempfile.TemporaryDirectory() as folder:
        write(Path(folder), Path("my_valve"))
        draw(run(folder)).savefig(file)


if __name__ == "__main__":
    make(Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).with_suffix(".png")))
