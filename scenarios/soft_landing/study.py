"""Soft landing: a drive voltage for an actuator, the reference cycle of [RTS], and the studies of its smoother."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gapsense.cli.common import FigureFile, Out, Output, Workers, command, study
from gapsense.cli.console import bar, say_written, show
from gapsense.studies import FIGURES

from .trajectory import FIG_5, Trajectory

File = Annotated[Path | None, typer.Option(help="TOML file of ReluctanceActuator parameters")]

FIGURES["soft_landing"] = f"{__package__}.show:run_figure"
Runs = Annotated[int, typer.Option(help="Runs at each width", min=1, max=10**7)]
Seed = Annotated[int, typer.Option(help="Seed of parameter errors and noise", min=0, max=2**31 - 1)]
Core = Annotated[str, typer.Option(help="`fitted` to the reference cycle, or the `published` values of Table II")]
Widths = Annotated[
    str, typer.Option(help="Widths of the parameter errors in percent, separated by commas", show_default="13 of them")
]
DRAWN = 0.1  # the width nearest to this one is that of the worst case


@command("soft-landing")
def soft_landing(
    to: Annotated[Path, Output.FILE, typer.Option("--out", help="CSV file for DriveVoltage")] = Path("drive.csv"),
    parameters: File = None,
    period: Annotated[float, typer.Option(help="Period of the cycles [s]")] = FIG_5.period,
    making_start: Annotated[float, typer.Option(help="Start of the closing motion [s]")] = FIG_5.making_start,
    making_duration: Annotated[float, typer.Option(help="Duration of that motion [s]")] = FIG_5.making_duration,
    breaking_start: Annotated[float, typer.Option(help="Start of the opening motion [s]")] = FIG_5.breaking_start,
    breaking_duration: Annotated[float, typer.Option(help="Duration of that motion [s]")] = FIG_5.breaking_duration,
    hold_voltage: Annotated[float, typer.Option(help="Voltage while closed [V]")] = FIG_5.hold_voltage,
    lead: Annotated[float, typer.Option(help="Time of constant voltage before each motion [s]")] = FIG_5.lead,
    highest_voltage: Annotated[
        float, typer.Option(help="Largest voltage of the drive, in both directions [V]", min=1e-9, max=1e6)
    ] = 200.0,
) -> None:
    """Compute a voltage that moves a reluctance actuator without impact, as a table for DriveVoltage.

    The table has two cycles, from a core that is not magnetized; the second one repeats.
    """
    from gapsense.identification.parameter_set import parameters_of

    from . import cycle, table
    from .show import phases

    device = parameters_of("reluctance_actuator", parameters)
    motions = making_start, making_duration, breaking_start, breaking_duration
    wanted = Trajectory(period, *motions, hold_voltage, lead)
    with bar("finding the voltage") as progress:
        cycles = cycle.soft_landing(device, wanted, highest_voltage=highest_voltage, progress=progress)
    times, voltages = table.voltage_table(cycles)
    with bar("playing it") as progress:
        deviation = table.deviation(cycles, *table.played(device, times, voltages, progress=progress))
    table.write(to, times, voltages)
    show(
        phases(cycles[-1]),
        f"Simulated with steps of 1 us, the actuator follows within {1e9 * deviation:.2g} nm.",
        f'{to}: {times.size} rows. In DriveVoltage set waveform = "soft_landing", soft_landing.file = "{to}", '
        f"soft_landing.period = {period:g}, soft_landing.repeat_from = {period:g}.",
    )


@study("reference-cycle")
def reference_cycle(parameters: File = None, to: FigureFile = Path("results/reference_cycle.png")) -> None:
    """Figure 5 of [RTS]: the cycle with soft landing that its analyses take as the truth."""
    from gapsense.identification.parameter_set import parameters_of
    from gapsense.report import plot

    from .cycle import soft_landing
    from .show import figure, phases

    plot.check_file(to)
    with bar("finding the voltage") as progress:
        cycle = soft_landing(parameters_of("reluctance_actuator", parameters), progress=progress)[-1]
    show(phases(cycle))
    say_written(plot.save(figure(cycle), to))


@study("reduced-fit")
def reduced_fit(
    record: Annotated[
        Path | None,
        typer.Option(
            help="CSV file with the columns time, voltage, current, position of a cycle that starts at rest and "
            "without flux; without it, the reference cycle of the paper is simulated"
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

    from .core_fit import cores, of_record, of_reference_cycle

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


@study("observability-rts")
def observability_rts(to: FigureFile = Path("results/observability_rts.png")) -> None:
    """Figure 6 of [RTS]: samples that make the state of the reduced model observable, along the reference cycle."""
    from gapsense.report import plot

    from .observability import along_reference_cycle, counts, figure

    plot.check_file(to)
    with bar("samples") as progress:
        observed = along_reference_cycle(progress=progress)
    show(*counts(observed))
    say_written(plot.save(figure(observed), to))


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

    An interrupted study continues where it was: runs already in the folder are not repeated.
    """
    from gapsense._os.files import write_atomically, write_columns
    from gapsense.report import plot

    from .comparison import WIDTHS, compare
    from .setting import studied
    from .smoother_show import columns, errors, noises, orderings, tables, worst_case

    chosen, reference = numbers(widths) or WIDTHS, studied(core, seed)
    with bar("comparing") as progress:
        found = compare(reference, chosen, runs, workers, to / "monte_carlo.sqlite", progress)
    show(*tables(found), noises(found), *orderings(found), f"{found.computed} tasks computed now.")
    write_atomically(to / "monte_carlo.csv", lambda file: write_columns(file, columns(found)))
    k = min(range(len(chosen)), key=lambda k: abs(chosen[k] - DRAWN))
    drawn = {"monte_carlo": errors(found), "monte_carlo_worst": worst_case(reference, found, k)}
    say_written(*(plot.save(figure, to / f"{name}.png") for name, figure in drawn.items()))


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

    from . import consistency as covariances
    from .setting import studied
    from .smoother_show import single, squared, summary

    reference = studied(core, seed)
    with bar("running") as progress:
        found = covariances.consistency(reference, width / 100.0, runs, progress)
    show(summary(found))
    drawn = {"consistency_nees": squared(found), "consistency_nee": single(found)}
    say_written(*(plot.save(figure, to / f"{name}.png") for name, figure in drawn.items()))


def numbers(text: str) -> tuple[float, ...]:
    """Fractions from percents separated by commas."""
    try:
        return tuple(float(part) / 100.0 for part in text.split(",") if part.strip())
    except ValueError:
        raise ValueError(f"`--widths {text}`: numbers separated by commas expected, such as 0.1,1,10.") from None
