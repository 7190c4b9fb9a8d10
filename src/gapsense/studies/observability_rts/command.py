"""Observability of the reduced model of [RTS]."""

from __future__ import annotations

from pathlib import Path

from gapsense.cli.common import FigureFile, bar, show, study, written


@study("observability-rts")
def observability_rts(to: FigureFile = Path("results/observability_rts.png")) -> None:
    """Figure 6 of [RTS]: samples that make the state of the reduced model observable, along the reference cycle."""
    from gapsense.report import plot
    from gapsense.studies.observability_rts.samples import along_reference_cycle
    from gapsense.studies.observability_rts.show import counts, figure

    plot.check_file(to)
    with bar("samples") as progress:
        observed = along_reference_cycle(progress=progress)
    show(*counts(observed))
    written(plot.save(figure(observed), to))
