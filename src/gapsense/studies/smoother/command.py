"""The studies of the smoother of [RTS]: the comparison of the estimators, and the consistency of its covariances."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gapsense.cli.common import Out, Workers, bar, show, study, written

Runs = Annotated[int, typer.Option(help="Runs at each width", min=1, max=10**7)]
Seed = Annotated[int, typer.Option(help="Of the parameter errors and of the noise", min=0, max=2**31 - 1)]
Core = Annotated[str, typer.Option(help="`fitted` to the reference cycle, or the `published` values of Table II")]
Widths = Annotated[
    str, typer.Option(help="Widths of the parameter errors in percent, separated by commas", show_default="13 of them")
]
DRAWN = 0.1  # the width nearest to this one is that of the worst case


@study("monte-carlo")
def monte_carlo(
    runs: Runs = 10_000,
    widths: Widths = "",
    workers: Workers = 2,
    seed: Seed = 1,
    core: Core = "fitted",
    to: Out = Path("results"),
) -> None:
    """Errors of EKF, ERTSS, its ablations and the open loop over parameter errors: Figs. 9 and 10 of [RTS].

    A run that was interrupted goes on where it was: what is in the folder is not computed again.
    """
    from gapsense._os.files import write_atomically, write_columns
    from gapsense.report import plot
    from gapsense.studies.smoother.comparison import WIDTHS, compare
    from gapsense.studies.smoother.show import columns, errors, noises, orderings, tables, worst_case
    from gapsense.studies.smoother.study import studied

    chosen, reference = numbers(widths) or WIDTHS, studied(core, seed)
    with bar("comparing") as progress:
        found = compare(reference, chosen, runs, workers, to / "monte_carlo.sqlite", progress)
    show(*tables(found), noises(found), *orderings(found), f"{found.computed} tasks computed now.")
    write_atomically(to / "monte_carlo.csv", lambda file: write_columns(file, columns(found)))
    k = min(range(len(chosen)), key=lambda k: abs(chosen[k] - DRAWN))
    drawn = {"monte_carlo": errors(found), "monte_carlo_worst": worst_case(reference, found, k)}
    written(*(plot.save(figure, to / f"{name}.png") for name, figure in drawn.items()))


@study("consistency")
def consistency(
    runs: Runs = 10_000,
    width: Annotated[float, typer.Option(help="Width of the parameter errors in percent", min=0.0)] = 1.0,
    seed: Seed = 1,
    core: Core = "fitted",
    to: Out = Path("results"),
) -> None:
    """Normalised errors of the smoother against its covariances: Figs. 7 and 8 of [RTS]."""
    from gapsense.report import plot
    from gapsense.studies.smoother import consistency as covariances
    from gapsense.studies.smoother.show import single, squared, summary
    from gapsense.studies.smoother.study import studied

    reference = studied(core, seed)
    with bar("running") as progress:
        found = covariances.consistency(reference, width / 100.0, runs, progress)
    show(summary(found))
    drawn = {"consistency_nees": squared(found), "consistency_nee": single(found)}
    written(*(plot.save(figure, to / f"{name}.png") for name, figure in drawn.items()))


def numbers(text: str) -> tuple[float, ...]:
    """Fractions from percents separated by commas."""
    try:
        return tuple(float(part) / 100.0 for part in text.split(",") if part.strip())
    except ValueError:
        raise ValueError(f"`--widths {text}`: numbers separated by commas expected, such as 0.1,1,10.") from None
