"""Commands for scenarios: check, run, sweep, draw, test, baseline."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gapsense import cosim
from gapsense.cli.common import (
    COMPONENT_FAILED,
    FAILED,
    INTERRUPTED,
    Fmus,
    Out,
    Scenario,
    Variant,
    Workers,
    bar,
    command,
    keep,
    problem,
    show,
    stem,
    stop_if_interrupted,
    written,
)
from gapsense.report import runs


@command("check")
def check(scenario: Scenario, variant: Variant = None, fmus: Fmus = None) -> None:
    """Check a scenario and all its variants without running it; every problem is told at once."""
    if problems := cosim.check(scenario, variant, fmus):
        raise cosim.ScenarioError(problems)
    show(f"{scenario}: no problems.")


@command("run")
def run(
    scenario: Scenario,
    variant: Variant = None,
    fmus: Fmus = None,
    to: Annotated[Path, typer.Option("--out", help="Folder for the CSV and its JSON side-car")] = Path("results"),
    only_check: Annotated[bool, typer.Option("--check", help="Check only, do not run")] = False,
) -> None:
    """Run a scenario: metrics beside published values, time per component, results as CSV and JSON."""
    if only_check:
        return check(scenario, variant, fmus)
    try:
        with bar("running") as progress:
            result = cosim.run(scenario, variant, fmus, progress=progress)
    except cosim.FmuError as error:
        keep(error, to)
        raise
    file = result.save(to / f"{stem(result)}.csv")
    show(*runs.metrics(result), runs.timing(result))
    show(f"{file}: {result.times.size} rows, {len(result.signals)} signals.")
    if result.interrupted:
        problem(f"interrupted at t = {result.times[-1]:.6g} s; what was computed is in {file}.", "yellow")
        raise typer.Exit(INTERRUPTED)
    failures = [m for m in result.metrics.values() if not m.passed]
    for measured in failures:
        problem(f"outside its bounds: {measured}")
    raise typer.Exit(FAILED if failures else 0)


@command("sweep")
def sweep(
    scenario: Scenario,
    seeds: Annotated[
        int | None,
        typer.Option(
            help="Runs of each combination; run i adds i to every seed", show_default="1, or 200 without `[sweep]`"
        ),
    ] = None,
    variant: Variant = None,
    workers: Workers = 2,
    fmus: Fmus = None,
    to: Out = Path("results"),
    signals: Annotated[bool, typer.Option("--signals", help="Keep the recorded signals of every run too")] = False,
) -> None:
    """Run a scenario over its `[sweep]` and over seeds; median and 5-95 % range of every metric.

    A sweep that was interrupted goes on where it was: runs that are in the folder are not computed again.
    """
    with bar("sweeping") as progress:
        swept = cosim.sweep(scenario, seeds, variant, workers, to, fmus, progress=progress, keep=signals)
    show(*runs.sweep(cosim.load(scenario, variant), swept))
    show(f"{swept.file}: {len(swept.indices)} runs, {swept.computed} of them computed now.")
    if swept.kept:
        show(f"{swept.kept[0].parent}: their signals.")
    for index, error in swept.errors.items():
        problem(f"run {index}: {error}")
    if swept.interrupted:
        problem("interrupted; the same command goes on from here.", "yellow")
    raise typer.Exit(INTERRUPTED if swept.interrupted else COMPONENT_FAILED if swept.errors else 0)


@command("figure")
def figure(
    scenario: Scenario,
    variant: Variant = None,
    fmus: Fmus = None,
    to: Annotated[
        Path | None, typer.Option("--out", help="PNG, PDF or SVG file", show_default="results/<scenario>.png")
    ] = None,
) -> None:
    """Run a scenario and draw its figure."""
    from gapsense.report import plot
    from gapsense.studies.figures import drawer

    draw = drawer(cosim.load(scenario, variant).figure)
    if to is not None:
        plot.check_file(to)
    with bar("running") as progress:
        result = cosim.run(scenario, variant, fmus, progress=progress)
    stop_if_interrupted(result)
    written(plot.save(draw(result), to or Path("results") / f"{stem(result)}.png"))


@command("test")
def test(
    folder: Annotated[Path, typer.Argument(help="Folder with scenarios at any depth")] = Path("scenarios"),
    fmus: Fmus = None,
    junit: Annotated[Path | None, typer.Option(help="JUnit XML file to write", show_default=False)] = None,
) -> None:
    """Run every scenario and variant; hold metrics against bounds and trajectories against baselines."""
    outcomes = cosim.test_scenarios(folder, fmus, lambda outcome: show(runs.outcome(outcome)))
    if junit:
        cosim.write_junit(outcomes, junit)
    failed = sum(not o.passed for o in outcomes)
    show(f"{len(outcomes) - failed} passed, {failed} failed")
    raise typer.Exit(INTERRUPTED if any(o.interrupted for o in outcomes) else FAILED if failed else 0)


@command("baseline")
def baseline(
    scenario: Scenario,
    variant: Variant = None,
    fmus: Fmus = None,
    write: Annotated[bool, typer.Option("--write", help="Write it; without this only the changes are shown")] = False,
) -> None:
    """Show what a new baseline of a scenario would change, and write it only with --write."""
    update = cosim.update_baseline(scenario, variant, fmus, write)
    show(str(update))
    raise typer.Exit(INTERRUPTED if update.interrupted else 0)
