"""The command that compares results."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gapsense.cli import common as cli
from gapsense.problems import InputError

if TYPE_CHECKING:
    from gapsense.cosim.result.compare import Comparison
    from gapsense.cosim.scenario.records import Baseline

RTOL, EDGE_STEPS = 1e-9, 1


@cli.command("compare")
def compare(
    result: Annotated[Path, typer.Argument(help="CSV of a result, or a folder of results", show_default=False)],
    reference: Annotated[Path, typer.Argument(help="Reference to compare with, of the same kind", show_default=False)],
    rtol: Annotated[float, typer.Option(help="Allowed difference as a share of the nominal value")] = RTOL,
    atol: Annotated[float, typer.Option(help="Allowed difference in the unit of the signal, added to that")] = 0.0,
    tolerances: Annotated[
        list[str] | None,
        typer.Option("--tolerance", help="PATTERN=RTOL or PATTERN=RTOL,ATOL: for these signals", show_default=False),
    ] = None,
    edge_steps: Annotated[
        int, typer.Option(help="Steps of its component that an edge may come earlier or later", min=0)
    ] = EDGE_STEPS,
    signals: Annotated[
        list[str] | None,
        typer.Option("--signal", help="Signal or pattern; all others are left out", show_default=False),
    ] = None,
    after: Annotated[float, typer.Option(help="Only rows from this time on [s]", show_default=False)] = -math.inf,
    before: Annotated[float, typer.Option(help="Only rows up to this time [s]", show_default=False)] = math.inf,
    figure: cli.Picture = None,
) -> None:
    """Compare a result with another one, signal by signal: |result - reference| <= atol + rtol x nominal.

    Signals that differ come first, three lines each. Exit code 1 if something differs.
    """
    from gapsense.cosim.result.pairs import Window, compare_trajectories, paired, read_trajectories

    how = tolerance(rtol, atol, edge_steps, tolerances or ())
    window = Window(tuple(signals or ("*",)), after, before)
    pairs = [*paired(result, reference)]
    read = [(read_trajectories(ours), read_trajectories(theirs)) for ours, theirs in pairs]
    failed = 0
    for (ours, _), both in zip(pairs, read):
        found = compare_trajectories(*both, how, window)
        failed += not found.passed
        tell(found, str(ours) if len(pairs) > 1 else "")
        if figure:
            draw(found, figure_of(figure, ours, result), f"{both[0].name} against {both[1].name}")
    if len(pairs) > 1:
        cli.show(f"{len(pairs) - failed} results as before, {failed} differ")
    raise typer.Exit(cli.FAILED if failed else 0)


def tolerance(rtol: float, atol: float, edge_steps: int, exceptions: Sequence[str]) -> Baseline:
    """Tolerances of all signals; an InputError has all that is wrong with them."""
    from gapsense.cosim.scenario.records import Baseline, Tolerance

    own, problems = {}, []
    for text in exceptions:
        pattern, _, numbers = text.rpartition("=")
        values = parsed(numbers)
        if not pattern or not 1 <= len(values) <= 2 or not are_tolerances(values):
            problems.append(f"--tolerance, {text}: `PATTERN=RTOL` or `PATTERN=RTOL,ATOL` expected. Correct it.")
        else:
            own[pattern] = Tolerance(values[0], values[1] if len(values) == 2 else atol, edge_steps)
    for name, value in {"--rtol": rtol, "--atol": atol}.items():
        if not are_tolerances([value]):
            problems.append(f"{name}: {value} found, a number not below 0 expected. Correct the value.")
    if problems:
        raise InputError(problems)
    return Baseline(Path(), None, Tolerance(rtol, atol, edge_steps), own)


def parsed(text: str) -> list[float]:
    """Numbers with commas between; none if something else is there."""
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        return []


def are_tolerances(values: Sequence[float]) -> bool:
    """True for finite numbers not below 0."""
    return all(math.isfinite(value) and value >= 0.0 for value in values)


def tell(found: Comparison, name: str) -> None:
    """What differs, then what does not."""
    from gapsense.report import differences

    if name:
        cli.show(f"{'as before' if found.passed else 'DIFFERS'}  {name}")
    for sentence in found.sentences:
        cli.show(sentence)
    near = [d for d in found.within if d.share]
    if near:
        cli.show(differences.nearest(near))
    cli.show(found.summary)


def draw(found: Comparison, file: Path, title: str) -> None:
    """The picture of a comparison."""
    from gapsense.report import differences, plot

    cli.written(plot.save(differences.figure(found, title), file))


def figure_of(file: Path, result: Path, root: Path) -> Path:
    """File for the picture of one of several results: with its name at the end."""
    if not root.is_dir():
        return file
    name = result.relative_to(root).with_suffix("").as_posix().replace("/", "_")
    return file.with_name(f"{file.stem}_{name}{file.suffix}")
