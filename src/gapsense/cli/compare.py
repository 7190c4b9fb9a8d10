"""The commands that compare results, and a run with those of smaller steps."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gapsense import cosim
from gapsense._os.files import refuse_export
from gapsense.cli import common as cli
from gapsense.cli import console
from gapsense.functions import EDGE_STEPS, RTOL

if TYPE_CHECKING:
    from gapsense.cosim.result.compare import Comparison


@cli.command("compare")
def compare(
    result: Annotated[Path, typer.Argument(help="CSV file of a result, or a folder of results")],
    reference: Annotated[Path, typer.Argument(help="Reference to compare with, of the same kind")],
    rtol: Annotated[float, typer.Option(help="Allowed difference as a share of the nominal value")] = RTOL,
    atol: Annotated[float, typer.Option(help="Allowed difference in the unit of the signal, in addition")] = 0.0,
    tolerances: Annotated[
        list[str] | None, typer.Option("--tolerance", help="PATTERN=RTOL or PATTERN=RTOL,ATOL: for these signals")
    ] = None,
    edge_steps: Annotated[
        int, typer.Option(help="Steps of its component by which an edge may come earlier or later", min=0)
    ] = EDGE_STEPS,
    signals: Annotated[
        list[str] | None, typer.Option("--signal", help="Signal or pattern to compare; all others are ignored")
    ] = None,
    after: Annotated[float, typer.Option(help="Only rows from this time on [s]", show_default=False)] = -math.inf,
    before: Annotated[float, typer.Option(help="Only rows up to this time [s]", show_default=False)] = math.inf,
    figure: cli.Picture = None,
) -> None:
    """Compare two results signal by signal: |result - reference| <= atol + rtol x nominal.

    Signals that differ come first, three lines each. Exit code 1 if something differs.
    """
    from gapsense import functions

    window: dict[str, Any] = {"signal": signals or (), "after": after, "before": before}
    made = functions.compare(
        result, reference, rtol=rtol, atol=atol, tolerance=tolerances or (), edge_steps=edge_steps, **window
    )
    for name, found in made.items():
        tell(found, name if len(made) > 1 else "")
        if figure:
            theirs = reference / Path(name).relative_to(result) if result.is_dir() else reference
            draw(found, figure_of(figure, Path(name), result), f"{name} against {theirs}")
    failed = sum(not found.passed for found in made.values())
    if len(made) > 1:
        console.show(f"{len(made) - failed} results as before, {failed} differ")
    raise SystemExit(console.FAILED if failed else 0)


def tell(found: Comparison, name: str) -> None:
    """What differs, then what does not."""
    from gapsense.report import differences

    if name:
        console.show(f"{'as before' if found.passed else 'DIFFERS'}  {name}")
    for sentence in found.sentences:
        console.show(sentence)
    if near := [d for d in found.within if d.share]:
        console.show(differences.nearest(near))
    console.show(found.summary)


def draw(found: Comparison, file: Path, title: str) -> None:
    """The picture of a comparison."""
    from gapsense.report import differences, plot

    console.say_written(plot.save(differences.figure(found, title), file))


def figure_of(file: Path, result: Path, root: Path) -> Path:
    """File for the picture of one of several results: with its name at the end."""
    if not root.is_dir():
        return file
    name = result.relative_to(root).with_suffix("").as_posix().replace("/", "_")
    return file.with_name(f"{file.stem}_{name}{file.suffix}")


@cli.command("converge")
def converge(
    scenario: cli.Scenario,
    variant: cli.Variant = None,
    fmus: cli.Fmus = None,
    runs: Annotated[int, typer.Option(help="Runs at most, 4 to 16; each takes twice the steps of the one before")] = 6,
    budget: Annotated[
        float, typer.Option(help="Wall time [s] beyond which no further run begins", show_default="none")
    ] = math.inf,
    tolerance: Annotated[float, typer.Option(help="Largest error, as a share of the range of a signal")] = 1e-3,
    keep: Annotated[
        list[str] | None, typer.Option(help="Component that keeps its instants, as those with a `sample_time` do")
    ] = None,
    settings: cli.Set = None,
    native: cli.Native = False,
    write: Annotated[
        bool, typer.Option("--write", help="Write what was measured beside the scenario; `check` then reminds no more")
    ] = False,
    export: Annotated[
        Path | None, cli.Output.FILE, typer.Option(help="CSV or JSON file to write, one row per signal")
    ] = None,
    figure: cli.Picture = None,
) -> None:
    """Run a scenario with its base step halved again and again, and tell the error of each recorded signal.

    Sampled components keep their instants. Exit code 1 if an error is beyond the tolerance at the step that the
    scenario has, or if no signal converges.
    """
    from gapsense.cosim.check import measured_file
    from gapsense.cosim.convergence import EXPORTED
    from gapsense.report import convergence, plot

    fmus, source = console.choose_fmus(scenario, fmus, native), cosim.changed(scenario, settings or ())
    if export:
        refuse_export(export, *EXPORTED)
    if figure:
        plot.check_file(figure)
    with console.bar("running") as progress:
        found = cosim.converge(
            source, variant, fmus, runs, budget, tolerance, keep or (), write, isolation="process", progress=progress
        )
    console.show(*convergence.tabulate(found))
    if write:
        console.say_written(measured_file(cosim.load(source, variant)))
    if export:
        console.say_written(found.export(export))
    if figure:
        console.say_written(plot.save(found.plot(), figure))
    raise SystemExit(0 if found.passed else console.FAILED)
