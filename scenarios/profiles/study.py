"""The experiment of [RTS] with 35 voltage profiles, in simulation."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from gapsense.cli import common, console
from gapsense.cli.common import Fmus, Out, Scenario, Workers, study
from gapsense.cli.console import bar, problem, say_written, show
from gapsense.studies import FIGURES, refuse_unrecorded

ALL = (None, "thresholds", "threshold_mode", "early")
Variants = Annotated[
    list[str] | None,
    typer.Option("--variant", help="Variant; may be given several times", show_default="the scenario and all variants"),
]

FIGURES["profiles"] = f"{__package__}.show:run_figure"


@study("profiles")
def profiles(
    scenario: Scenario = Path("profiles"),
    variant: Variants = None,
    workers: Workers = 2,
    fmus: Fmus = None,
    to: Out = Path("results"),
) -> None:
    """Sweep the voltage profiles of [RTS] Section IV-F through the FMUs: Figs. 12, 14, 15 and percentiles.

    The mode comes from exact contact or the thresholds (68)-(69); pulses also come earlier. It continues after an
    interruption.
    """
    for name in variant or ALL:
        one(scenario, name, workers, fmus, to)


def one(scenario: Path, variant: str | None, workers: int, fmus: Path | None, to: Path) -> None:
    """One variant: its sweep, then what came out."""
    from gapsense import cosim
    from gapsense.cosim.scenario.records import recorded_signals

    from .experiment import SIGNALS

    read, descriptions = cosim.prepare(scenario, variant, fmus)
    refuse_unrecorded(SIGNALS, recorded_signals(read, descriptions), read.name, "profiles")
    with bar("sweeping") as progress:
        swept = cosim.sweep(scenario, None, variant, workers, to, fmus, progress=progress, keep=True)
    for index, error in swept.errors.items():
        problem(f"run {index}: {error}")
    if swept.interrupted or not swept.kept:
        raise SystemExit(console.INTERRUPTED if swept.interrupted else console.COMPONENT_FAILED)
    evaluated(swept.kept, to)
    if swept.errors:
        raise SystemExit(console.COMPONENT_FAILED)


def evaluated(files: Sequence[Path], to: Path) -> None:
    """Numbers and figures of the runs in some files."""
    from gapsense.cosim import read_result
    from gapsense.report import plot

    from . import experiment
    from .show import boxes, run_figure, summary, trajectories

    lined_up = []
    with bar("smoothing") as progress:
        for done, file in enumerate(files):
            progress(done, len(files))
            lined_up.append(experiment.line_up(read_result(file)))
    first, errors = read_result(files[0]), experiment.errors(lined_up)
    title = f"{first.run.scenario}: {first.run.title}"
    show(title, *summary(lined_up, errors))
    drawn = {12: run_figure(first), 14: trajectories(lined_up, title), 15: boxes(errors, title)}
    say_written(*(plot.save(figure, to / f"{common.stem(first)}_{number}.png") for number, figure in drawn.items()))
