"""Studies of the smoother of [RTS]."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gapsense.cli.common import bar, out, reported, study

if TYPE_CHECKING:
    from gapsense.studies.monte_carlo.comparison import Study

Runs = Annotated[int, typer.Option(help="Runs at each width", min=1)]
Seed = Annotated[int, typer.Option(help="Of the parameter errors and of the noise", min=0)]
Core = Annotated[str, typer.Option(help="`fitted` to the reference cycle, or the `published` values of Table II")]
Out = Annotated[Path, typer.Option("--out", help="Folder for figures and numbers")]


@study("monte-carlo")
def monte_carlo(
    runs: Runs = 10_000,
    widths: Annotated[
        str,
        typer.Option(help="Widths of the parameter errors in percent, separated by commas", show_default="13 of them"),
    ] = "",
    workers: Annotated[int, typer.Option(help="Processes; the numbers do not depend on it", min=1)] = 2,
    seed: Seed = 1,
    core: Core = "fitted",
    to: Out = Path("results"),
) -> None:
    """Errors of EKF, ERTSS, its ablations and the open loop over parameter errors: Figs. 9 and 10 of [RTS].

    A run that was interrupted goes on where it was: what is in the folder is not computed again.
    """
    from gapsense.files import write_atomically, write_columns
    from gapsense.report import plot as figures
    from gapsense.studies.monte_carlo import show as report
    from gapsense.studies.monte_carlo.comparison import WIDTHS, compare

    with reported():
        chosen = numbers(widths) or WIDTHS
        reference = studied(core, seed)
        with bar("comparing") as progress:
            found = compare(reference, chosen, runs, workers, to / "monte_carlo.jsonl", progress)
        for table in (*report.tables(found), report.noises(found)):
            out.print(table)
        out.print("\n".join(report.orderings(found)), markup=False)
        write_atomically(to / "monte_carlo.csv", lambda file: write_columns(file, report.columns(found)))
        k = min(range(len(chosen)), key=lambda k: abs(chosen[k] - 0.1))
        files = [
            figures.save(report.errors(found), to / "monte_carlo.png"),
            figures.save(report.worst_case(reference, found, k), to / "monte_carlo_worst.png"),
        ]
        out.print(f"{found.computed} tasks computed now. {', '.join(map(str, files))} written.", markup=False)


@study("consistency")
def consistency(
    runs: Runs = 10_000,
    width: Annotated[float, typer.Option(help="Width of the parameter errors in percent", min=0.0)] = 1.0,
    seed: Seed = 1,
    core: Core = "fitted",
    to: Out = Path("results"),
) -> None:
    """Normalised errors of the smoother against its covariances: Figs. 7 and 8 of [RTS]."""
    from gapsense.report import plot as figures
    from gapsense.studies.consistency import show as report
    from gapsense.studies.consistency.errors import consistency as study_consistency

    with reported():
        reference = studied(core, seed)
        with bar("running") as progress:
            found = study_consistency(reference, width / 100.0, runs, progress)
        out.print(report.table(found))
        files = [
            figures.save(report.squared(found), to / "consistency_nees.png"),
            figures.save(report.single(found), to / "consistency_nee.png"),
        ]
        out.print(f"{', '.join(map(str, files))} written.", markup=False)


def studied(core: str, seed: int) -> Study:
    """The soft-landing cycle of Fig. 5, with the core of the reduced model as asked for."""
    from gapsense.studies.monte_carlo.comparison import Study
    from gapsense.studies.smoother.nominal import fitted, nominal
    from gapsense.studies.soft_landing.cycle import sampled, soft_landing

    if core not in ("fitted", "published"):
        raise ValueError(f"`--core {core}`: `fitted` or `published` expected. Correct it.")
    samples = sampled(soft_landing())
    return Study(samples, fitted(samples, nominal()) if core == "fitted" else nominal(), seed)


def numbers(text: str) -> tuple[float, ...]:
    """Fractions from percents separated by commas."""
    try:
        return tuple(float(part) / 100.0 for part in text.split(",") if part.strip())
    except ValueError:
        raise ValueError(f"`--widths {text}`: numbers separated by commas expected, such as 0.1,1,10.") from None
