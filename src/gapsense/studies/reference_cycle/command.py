"""The reference cycle of [RTS]."""

from __future__ import annotations

from pathlib import Path

from gapsense.cli.common import FigureFile, show, study, written
from gapsense.studies.soft_landing.command import File


@study("reference-cycle")
def reference_cycle(parameters: File = None, to: FigureFile = Path("results/reference_cycle.png")) -> None:
    """Figure 5 of [RTS]: the cycle with soft landing that its analyses take as the truth."""
    from gapsense.report import plot
    from gapsense.studies.identification.transfer import parameters_of
    from gapsense.studies.reference_cycle.show import figure
    from gapsense.studies.soft_landing.cycle import soft_landing
    from gapsense.studies.soft_landing.show import phases

    plot.check_file(to)
    cycle = soft_landing(parameters_of("reluctance_actuator", parameters))
    show(phases(cycle))
    written(plot.save(figure(cycle), to))
