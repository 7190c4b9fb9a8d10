"""Fit of the core of the reduced model of [RTS]."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gapsense.cli.common import bar, show, study


@study("reduced-fit")
def reduced_fit(
    record: Annotated[
        Path | None,
        typer.Option(
            help="CSV file with the columns time, voltage, current, position of a cycle that starts at rest and "
            "without flux; without it, the reference cycle of the paper is simulated",
            show_default=False,
        ),
    ] = None,
    parameters: Annotated[
        Path | None,
        typer.Option(
            help="Parameter set of Ekf: coil, stops and gap law of the device",
            show_default="[RTS] Table I for its own cycle",
        ),
    ] = None,
    held: Annotated[
        bool, typer.Option(help="The recorded voltage holds from sample to sample, instead of straight lines")
    ] = False,
) -> None:
    """Fit R_c0* and lambda_sat of the reduced model, Table II of [RTS], with standard errors."""
    from gapsense.estimators.reduced_model import GapLaw
    from gapsense.fmi.components import load_component, own
    from gapsense.identification.actuator.show import GAPS
    from gapsense.identification.assumptions import ask
    from gapsense.identification.parameter_set import parameters_of, read_sets
    from gapsense.studies.reduced_fit.fit import of_record, of_reference_cycle
    from gapsense.studies.reduced_fit.show import cores

    par = parameters_of("ekf", parameters)
    if record is not None:
        given, assumed = read_sets([parameters] if parameters else [])
        needed = ("coil.resistance", "coil.turns", "stop.lower", "stop.upper", *GAPS[GapLaw(int(par.gap_law))])
        names = [name for name in needed if name not in given or name in assumed]
        ask(
            names,
            {port.name: port for port in load_component(own("ekf")).of("parameter")},
            parameters.name if parameters else "--parameters",
        )
    with bar("fitting") as progress:
        fits = of_record(record, par, held) if record else of_reference_cycle(par, progress)
    show(*cores(fits, is_reference=record is None))
