"""One benchmark for all estimators."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gapsense import cosim
from gapsense.cli.common import COMPONENT_FAILED, INTERRUPTED, Fmus, Scenario, bar, err, out, reported, study
from gapsense.cosim.signals import recorded_signals

Variants = Annotated[
    list[str] | None,
    typer.Option(
        "--variant", help="Variant beside the plain scenario; may be given several times", show_default="all of them"
    ),
]


@study("estimators")
def estimators(
    scenario: Scenario = Path("scenarios/estimators"),
    variant: Variants = None,
    seeds: Annotated[int, typer.Option(help="Runs of a condition without draws of wrong parameters")] = 8,
    workers: Annotated[int, typer.Option(help="Processes; only the cost per step depends on it")] = 2,
    fmus: Fmus = None,
    to: Annotated[Path, typer.Option("--out", help="Folder for runs and figure")] = Path("results"),
) -> None:
    """Run all estimators on the same actuator under ten conditions, through the FMUs: one table, one figure.

    Errors, missed landings, latency, cost per step, and what each needs. It goes on after an interruption.
    """
    from gapsense.report import plot as figures
    from gapsense.studies.estimators import show as drawn
    from gapsense.studies.estimators import text as report

    with reported():
        chosen = [None, *(variant or [c.variant for c in report.CONDITIONS if c.variant])]
        found = {name: one(scenario, name, seeds, workers, fmus, to).metrics for name in chosen}
        out.print(report.text(found), markup=False)
        out.print(f"{figures.save(drawn.conditions(found), to / 'estimators.png')} written.", markup=False)


def one(scenario: Path, variant: str | None, seeds: int, workers: int, fmus: Path | None, to: Path) -> cosim.Sweep:
    """The runs of one condition."""
    from gapsense.studies.estimators import measures as benchmark

    read, descriptions = cosim.prepare(scenario, variant, fmus)
    benchmark.require(recorded_signals(read, descriptions), read.name)
    runs = 1 if read.swept else seeds
    with bar(f"{variant or 'plain'}") as progress:
        swept = cosim.sweep(scenario, runs, variant, workers, to, fmus, benchmark.measure, progress)
    for index, error in swept.errors.items():
        err.print(f"{read.name}, run {index}: {error}", style="red", markup=False)
    if swept.interrupted or swept.errors:
        raise typer.Exit(INTERRUPTED if swept.interrupted else COMPONENT_FAILED)
    return swept
