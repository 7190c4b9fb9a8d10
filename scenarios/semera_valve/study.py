"""Observability of the filters along a scenario; good and bad records of the valve, and what they do to `identify`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gapsense import cosim
from gapsense.cli.common import Fmus, Out, Scenario, Variant, study
from gapsense.cli.console import APART, bar, say_written, show, stop_if_interrupted
from gapsense.studies import FIGURES

FIGURES["semera"] = f"{__package__}.show:run_figure"


@study("observability")
def observability(scenario: Scenario = Path("semera_valve"), variant: Variant = None, fmus: Fmus = None) -> None:
    """Observability of the SEMERA filter along a scenario: ranks (31)-(35), (39) and the count per sample."""
    from .show import run_tables

    result = cosim.run(scenario, variant, fmus, **APART)
    stop_if_interrupted(result)
    show(*run_tables(result))


@study("measuring")
def measuring(
    seeds: Annotated[int, typer.Option(help="Runs of each condition; 0: figures only", min=0, max=10**7)] = 2,
    to: Out = Path("results"),
) -> None:
    """How wrong `identify` is over sampling, converters, noise, filters and drives; figures of good and bad records."""
    from gapsense._os.files import write_atomically
    from gapsense.identification.inspection.facts import facts
    from gapsense.identification.inspection.show import inspection_figure
    from gapsense.report import plot

    from .measuring import GOOD, bad, markdown, outcome_table, outcomes, record

    files = []
    for name, records in (("good", [record(*GOOD)]), ("bad", bad())):
        files.append(plot.save(inspection_figure(records, [*map(facts, records)]), to / f"measuring_{name}.png"))
    if seeds:
        with bar("identifying") as progress:
            found = outcomes(seeds, progress=progress)
        show(outcome_table(found))
        files.append(to / "measuring.md")
        write_atomically(files[-1], lambda file: print(markdown(found), end="", file=file))
    say_written(*files)
