"""How soon `Monitor` tells faults, which cause it names, and how often it is wrong about healthy devices."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gapsense.cli.common import Out, study
from gapsense.cli.console import bar, say_written, show
from gapsense.studies import FIGURES

FIGURES["condition"] = f"{__package__}.show:run_figure"


@study("condition")
def condition(
    devices: Annotated[int, typer.Option(help="Devices with each fault", min=1, max=10**5)] = 24,
    healthy: Annotated[int, typer.Option(help="Devices without one, 820 operations each", min=1, max=10**5)] = 48,
    seed: Annotated[int, typer.Option(help="Seed of the devices; those below 100 chose the signatures", min=0)] = 1200,
    to: Out = Path("results"),
) -> None:
    """Faults of a valve that Monitor is to tell: after how many operations, with which cause, and false alarms."""
    from gapsense.report import plot
    from gapsense.studies.runs import after

    from .cases import CASES, COURSE, LONG
    from .judge import alarms, judged
    from .show import alarm_sentence, cases_table, causes_figure

    found = {}
    for name, case in CASES.items():
        with bar(f"{name}, runs") as progress:
            found[name] = judged(case, devices, seed, after(progress, 0, devices), COURSE)
    with bar("healthy, runs") as progress:
        said = alarms(healthy, seed + 1, LONG, after(progress, 0, healthy))
    show(*cases_table(found, COURSE), alarm_sentence(said))
    say_written(plot.save(causes_figure(found, COURSE), to / "condition.png"))
