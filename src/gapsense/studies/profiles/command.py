"""The experiment of [RTS] with 35 voltage profiles, in simulation."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gapsense import cosim
from gapsense.cli.common import COMPONENT_FAILED, INTERRUPTED, Fmus, Scenario, bar, err, out, reported, stem, study
from gapsense.cosim.signals import recorded_signals

ALL = (None, "thresholds", "threshold_mode", "early")
Variants = Annotated[
    list[str] | None,
    typer.Option("--variant", help="Variant; may be given several times", show_default="the scenario and all variants"),
]


@study("profiles")
def profiles(
    scenario: Scenario = Path("scenarios/profiles"),
    variant: Variants = None,
    workers: Annotated[int, typer.Option(help="Processes; the numbers do not depend on it")] = 2,
    fmus: Fmus = None,
    to: Annotated[Path, typer.Option("--out", help="Folder for runs and figures")] = Path("results"),
) -> None:
    """Sweep the voltage profiles of [RTS] Section IV-F through the FMUs: Figs. 12, 14, 15 and percentiles.

    With the mode from exact contact, from the thresholds (68)-(69), and with earlier pulses. It goes on after an
    interruption.
    """
    for name in variant or ALL:
        with reported():
            one(scenario, name, workers, fmus, to)


def one(scenario: Path, variant: str | None, workers: int, fmus: Path | None, to: Path) -> None:
    """One variant: its sweep, figures and numbers."""
    from gapsense.report import plot as figures
    from gapsense.studies.profiles import experiment
    from gapsense.studies.profiles import show as drawn
    from gapsense.studies.profiles import text as profiles_report

    read, descriptions = cosim.prepare(scenario, variant, fmus)
    experiment.require(recorded_signals(read, descriptions), read.name)
    with bar("sweeping") as progress:
        swept = cosim.sweep(scenario, None, variant, workers, to, fmus, progress=progress, keep=True)
    for index, error in swept.errors.items():
        err.print(f"run {index}: {error}", style="red", markup=False)
    if swept.interrupted or not swept.kept:
        raise typer.Exit(INTERRUPTED if swept.interrupted else COMPONENT_FAILED)
    results = []
    with bar("smoothing") as progress:
        for done, file in enumerate(swept.kept):
            progress(done, len(swept.kept))
            results.append(experiment.line_up(cosim.read_result(file)))
    first = cosim.read_result(swept.kept[0])
    errors, title = experiment.errors(results), f"{first.run.scenario}: {first.run.title}"
    out.print(title, markup=False)
    out.print(profiles_report.text(results, errors), markup=False)
    drawings = {
        "12": drawn.run_figure(first),
        "14": drawn.trajectories(results, title),
        "15": drawn.boxes(errors, title),
    }
    for number, figure in drawings.items():
        out.print(f"{figures.save(figure, to / f'{stem(first)}_{number}.png')} written.", markup=False)
    if swept.errors:
        raise typer.Exit(COMPONENT_FAILED)
