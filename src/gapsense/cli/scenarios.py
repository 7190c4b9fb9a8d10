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
    Scenario,
    Variant,
    app,
    bar,
    err,
    keep,
    out,
    reported,
    stem,
    stop_if_interrupted,
)
from gapsense.report import tables


@app.command()
def check(scenario: Scenario, variant: Variant = None, fmus: Fmus = None) -> None:
    """Check a scenario and all its variants without running it; every problem is told at once."""
    with reported():
        problems = cosim.check(scenario, variant, fmus)
        if problems:
            raise cosim.ScenarioError(problems)
        out.print(f"{scenario}: no problems.", markup=False)


@app.command()
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
    with reported():
        try:
            with bar("running") as progress:
                result = cosim.run(scenario, variant, fmus, progress=progress)
        except cosim.FmuError as error:
            keep(error, to)
            raise
        file = result.save(to / f"{stem(result)}.csv")
    for table in tables.metrics(result):
        out.print(table)
    out.print(tables.timing(result))
    out.print(f"{file}: {result.times.size} rows, {len(result.signals)} signals.", markup=False)
    if result.interrupted:
        err.print(f"interrupted at t = {result.times[-1]:.6g} s; what was computed is in {file}.", style="yellow")
        raise typer.Exit(INTERRUPTED)
    failures = [m for m in result.metrics.values() if not m.passed]
    for measured in failures:
        err.print(f"outside its bounds: {measured}", style="red", markup=False)
    raise typer.Exit(FAILED if failures else 0)


@app.command()
def sweep(
    scenario: Scenario,
    seeds: Annotated[
        int | None,
        typer.Option(
            help="Runs of each combination; run i adds i to every seed", show_default="1, or 200 without `[sweep]`"
        ),
    ] = None,
    variant: Variant = None,
    workers: Annotated[int, typer.Option(help="Processes; the numbers do not depend on it")] = 2,
    fmus: Fmus = None,
    to: Annotated[Path, typer.Option("--out", help="Folder for the metrics of every run")] = Path("results"),
    signals: Annotated[bool, typer.Option("--signals", help="Keep the recorded signals of every run too")] = False,
) -> None:
    """Run a scenario over its `[sweep]` and over seeds; median and 5-95 % range of every metric.

    A sweep that was interrupted goes on where it was: runs that are in the folder are not computed again.
    """
    with reported(), bar("sweeping") as progress:
        swept = cosim.sweep(scenario, seeds, variant, workers, to, fmus, progress=progress, keep=signals)
        loaded = cosim.load(scenario, variant)
    for table in tables.sweep(loaded, swept):
        out.print(table)
    out.print(f"{swept.file}: {len(swept.indices)} runs, {swept.computed} of them computed now.", markup=False)
    if swept.kept:
        out.print(f"{swept.kept[0].parent}: their signals.", markup=False)
    for index, error in swept.errors.items():
        err.print(f"run {index}: {error}", style="red", markup=False)
    if swept.interrupted:
        err.print("interrupted; the same command goes on from here.", style="yellow")
    raise typer.Exit(INTERRUPTED if swept.interrupted else COMPONENT_FAILED if swept.errors else 0)


@app.command()
def figure(
    scenario: Scenario,
    variant: Variant = None,
    fmus: Fmus = None,
    to: Annotated[
        Path | None, typer.Option("--out", help="PNG, PDF or SVG file", show_default="results/<scenario>.png")
    ] = None,
) -> None:
    """Run a scenario and draw its figure."""
    from gapsense.report import figures

    with reported():
        loaded = cosim.load(scenario, variant)
        figures.check(loaded.figure, to)
        with bar("running") as progress:
            result = cosim.run(scenario, variant, fmus, progress=progress)
        stop_if_interrupted(result)
        file = figures.save(figures.draw(result, loaded.figure), to or Path("results") / f"{stem(result)}.png")
    out.print(f"{file} written.", markup=False)


@app.command()
def test(
    folder: Annotated[Path, typer.Argument(help="Folder with scenarios at any depth")] = Path("scenarios"),
    fmus: Fmus = None,
    junit: Annotated[Path | None, typer.Option(help="JUnit XML file to write", show_default=False)] = None,
) -> None:
    """Run every scenario and variant; hold metrics against bounds and trajectories against baselines."""
    with reported():
        outcomes = cosim.test_scenarios(folder, fmus, lambda outcome: out.print(tables.outcome(outcome), markup=False))
        if junit:
            cosim.write_junit(outcomes, junit)
    failed = sum(not o.passed for o in outcomes)
    out.print(f"{len(outcomes) - failed} passed, {failed} failed")
    raise typer.Exit(INTERRUPTED if any(o.interrupted for o in outcomes) else FAILED if failed else 0)


@app.command()
def baseline(
    scenario: Scenario,
    variant: Variant = None,
    fmus: Fmus = None,
    write: Annotated[bool, typer.Option("--write", help="Write it; without this only the changes are shown")] = False,
) -> None:
    """Show what a new baseline of a scenario would change, and write it only with --write."""
    with reported():
        update = cosim.update_baseline(scenario, variant, fmus, write)
        out.print(str(update), markup=False)
    raise typer.Exit(INTERRUPTED if update.interrupted else 0)
