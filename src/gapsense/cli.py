"""The command line.

Exit codes: 0 all well; 1 a test, a metric or a validation failed; 2 wrong input; 3 a component failed during a run;
130 interrupted (what was computed is kept).
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from gapsense import cosim
from gapsense.report import tables

FAILED, WRONG_INPUT, COMPONENT_FAILED, INTERRUPTED = 1, 2, 3, 130

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="markdown",
    help="""FMI co-simulation components for short-stroke reluctance actuators.

Start with `gapsense build`, `gapsense list` and `gapsense run scenarios/semera_valve`.

Exit codes: 0 all well, 1 a test or a metric failed, 2 wrong input, 3 a component failed, 130 interrupted.""",
)
WIDTH = None if sys.stdout.isatty() else 110  # of tables in files and logs
out = Console(highlight=False, soft_wrap=True, width=WIDTH)
err = Console(stderr=True, highlight=False, soft_wrap=True)

Scenario = Annotated[Path, typer.Argument(help="Folder of a scenario, or its scenario.toml", show_default=False)]
Variant = Annotated[str | None, typer.Option(help="Variant of the scenario", show_default=False)]
Fmus = Annotated[Path | None, typer.Option(help="Folder of the FMUs", show_default="build/fmus")]


@contextmanager
def reported() -> Iterator[None]:
    """Turn the errors a user can mend into one sentence and an exit code."""
    try:
        yield
    except cosim.ScenarioError as error:
        for problem in error.problems:
            err.print(problem, style="red", markup=False)
        raise typer.Exit(WRONG_INPUT) from None
    except typer.Exit:  # a RuntimeError too
        raise
    except RuntimeError as error:  # FmuError, or a worker process of a sweep that died
        err.print(str(error), style="red", markup=False)
        raise typer.Exit(COMPONENT_FAILED) from None
    except (OSError, ValueError) as error:
        err.print(sentence(error), style="red", markup=False)
        raise typer.Exit(WRONG_INPUT) from None
    except KeyboardInterrupt:
        err.print("interrupted.", style="yellow")
        raise typer.Exit(INTERRUPTED) from None


def sentence(error: OSError | ValueError) -> str:
    """What went wrong; the operating system's errors with the path first."""
    if isinstance(error, OSError) and error.filename:
        return f"`{error.filename}`: {error.strerror}. Correct the path, or make room for it."
    return str(error)


def stop_if_interrupted(result: cosim.Result) -> None:
    """Leave after a Ctrl-C, where half a run is of no use."""
    if result.interrupted:
        err.print(f"interrupted at t = {result.times[-1]:.6g} s; nothing was written.", style="yellow")
        raise typer.Exit(INTERRUPTED)


@contextmanager
def bar(title: str) -> Iterator[Callable[[int, int], None]]:
    """A progress bar on a terminal; calls with done and total elsewhere do nothing."""
    columns = (TextColumn(title), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=err, transient=True, disable=not err.is_terminal) as progress:
        task = progress.add_task(title, total=None)
        yield lambda done, total: progress.update(task, completed=done, total=total)


def checkout() -> Path:
    """The checkout that holds fmus/ and build_fmus.py: the working folder or one above it."""
    here = Path.cwd()
    found = next((p for p in (here, *here.parents) if (p / "build_fmus.py").is_file() and (p / "fmus").is_dir()), None)
    if found is None:
        raise FileNotFoundError(
            f"{here}: neither here nor above is a checkout of Gapsense (fmus/, build_fmus.py). Change there."
        )
    return found


@app.command()
def build(
    names: Annotated[
        list[str] | None, typer.Argument(help="Components; all if none is named", show_default=False)
    ] = None,
    to: Annotated[Path | None, typer.Option("--out", help="Where to write them", show_default="build/fmus")] = None,
) -> None:
    """Build and validate the FMUs of the components in fmus/."""
    with reported():
        command = [
            sys.executable,
            str(checkout() / "build_fmus.py"),
            *(names or []),
            *(["--out", str(to)] if to else []),
        ]
        raise typer.Exit(subprocess.run(command).returncode)


@app.command("list")
def list_() -> None:
    """List components, whether they are built, and scenarios with their variants."""
    from gapsense.fmi.package import find_components, load_component

    with reported():
        root = checkout()
        components = [load_component(p) for p in find_components(root / "fmus")]
        built = {p.stem for p in (root / "build" / "fmus").glob("*.fmu")}
        out.print(tables.components(components, built))
        scenarios = [(p.parent, cosim.load(p)) for p in cosim.find_scenarios(root / "scenarios")]
        out.print(tables.scenarios(root, scenarios))


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
    seeds: Annotated[int, typer.Option(help="Number of runs; run i adds i to every seed")] = 200,
    variant: Variant = None,
    workers: Annotated[int, typer.Option(help="Processes; the numbers do not depend on it")] = 2,
    fmus: Fmus = None,
    to: Annotated[Path, typer.Option("--out", help="Folder for the metrics of every run")] = Path("results"),
) -> None:
    """Run a scenario over many seeds; median and 5-95 % range of every metric beside published values.

    A sweep that was interrupted goes on where it was: runs that are in the folder are not computed again.
    """
    with reported(), bar("sweeping") as progress:
        swept = cosim.sweep(scenario, seeds, variant, workers, to, fmus, progress=progress)
        loaded = cosim.load(scenario, variant)
    for table in tables.sweep(loaded, swept):
        out.print(table)
    out.print(f"{swept.file}: {len(swept.indices)} runs, {swept.computed} of them computed now.", markup=False)
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


@app.command()
def observability(
    scenario: Scenario = Path("scenarios/semera_valve"), variant: Variant = None, fmus: Fmus = None
) -> None:
    """Observability of the SEMERA filter along a scenario: ranks (31)-(35), (39) and the count per sample."""
    from gapsense.studies import observability_report

    with reported():
        result = cosim.run(scenario, variant, fmus)
        stop_if_interrupted(result)
        out.print(observability_report.text(result), markup=False)


def keep(error: cosim.FmuError, folder: Path) -> None:
    """Save what was recorded before a component failed, and say where."""
    if error.result is not None and error.result.times.size:
        file = error.result.save(folder / f"{stem(error.result)}.csv")
        err.print(f"{file}: {error.result.times.size} rows from before the failure.", style="yellow", markup=False)


def stem(result: cosim.Result) -> str:
    """File name of a result, without its ending."""
    return result.run.scenario.replace("[", "_").rstrip("]")


if __name__ == "__main__":
    app()
