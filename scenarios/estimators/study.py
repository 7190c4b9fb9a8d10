"""One benchmark for all estimators."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gapsense import cosim
from gapsense.cli.common import Fmus, Out, Scenario, study
from gapsense.cli.console import COMPONENT_FAILED, INTERRUPTED, bar, problem, say_written, show
from gapsense.studies import FIGURES

Variants = Annotated[
    list[str] | None,
    typer.Option(
        "--variant", help="Variant beside the plain scenario; may be given several times", show_default="all of them"
    ),
]

FIGURES["estimators"] = f"{__package__}.show:run_figure"


@study("estimators")
def estimators(
    scenario: Scenario = Path("estimators"),
    variant: Variants = None,
    seeds: Annotated[
        int, typer.Option(help="Runs of each condition that does not draw wrong parameters", min=1, max=10**7)
    ] = 8,
    workers: Annotated[int, typer.Option(help="Processes; only the cost per step depends on it", min=1, max=1000)] = 2,
    fmus: Fmus = None,
    to: Out = Path("results"),
) -> None:
    """Run the FMUs of all estimators on one actuator, under ten conditions and eight on which nothing was tuned.

    Errors, missed landings, latency, cost per step, and what each needs. It continues after an interruption.
    """
    from gapsense._os.files import write_atomically
    from gapsense.report import plot

    from .show import CONDITIONS, HOLD_OUTS, TITLES, conditions, markdown, of, tables

    chosen = [None, *(variant or filter(None, TITLES))]
    for name in chosen:  # each takes minutes: an unknown one is told before the first
        cosim.load(scenario, name)
    found = {name: one(scenario, name, seeds, workers, fmus, to).metrics for name in chosen}
    show(*tables(found))
    drawn = {"estimators": of(found, CONDITIONS), "estimators_held_out": of(found, HOLD_OUTS)}
    pictures = [plot.save(conditions(runs), to / f"{name}.png") for name, runs in drawn.items() if runs]
    write_atomically(to / "estimators.md", lambda file: print(markdown(found), end="", file=file))
    say_written(*pictures, to / "estimators.md")


def one(scenario: Path, variant: str | None, seeds: int, workers: int, fmus: Path | None, to: Path) -> cosim.Sweep:
    """The runs of one condition."""
    from gapsense.cosim.scenario.records import recorded_signals

    from . import measures

    read, descriptions = cosim.prepare(scenario, variant, fmus)
    measures.require(recorded_signals(read, descriptions), read.name)
    runs = 1 if read.swept else seeds
    with bar(f"{variant or 'plain'}") as progress:
        # by FMUs, whose cost per step is measured
        swept = cosim.sweep(scenario, runs, variant, workers, to, fmus, measures.measure, progress, engine="fmu")
    for index, error in swept.errors.items():
        problem(f"{read.name}, run {index}: {error}")
    if swept.interrupted or swept.errors:
        raise SystemExit(INTERRUPTED if swept.interrupted else COMPONENT_FAILED)
    return swept
