"""Good and bad records, and what they do to an identification."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gapsense.cli.common import Out, bar, show, study, written


@study("measuring")
def measuring(
    seeds: Annotated[int, typer.Option(help="Runs of each condition; 0: figures only", min=0, max=10**7)] = 2,
    to: Out = Path("results"),
) -> None:
    """How wrong `identify` is over sampling, converters, noise, filters and drives; figures of good and bad records."""
    from gapsense._os.files import write_atomically
    from gapsense.identification.inspection.facts import facts
    from gapsense.identification.inspection.show import inspection_figure
    from gapsense.identification.measuring import GOOD, bad, markdown, outcome_table, outcomes, record
    from gapsense.report import plot

    files = []
    for name, records in (("good", [record(*GOOD)]), ("bad", bad())):
        files.append(plot.save(inspection_figure(records, [*map(facts, records)]), to / f"measuring_{name}.png"))
    if seeds:
        with bar("identifying") as progress:
            found = outcomes(seeds, progress=progress)
        show(outcome_table(found))
        files.append(to / "measuring.md")
        write_atomically(files[-1], lambda file: print(markdown(found), end="", file=file))
    written(*files)
