"""Soft landing: a drive voltage for an actuator, and the reference cycle of [RTS]."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gapsense.cli.common import FigureFile, Output, bar, command, show, study, written
from gapsense.studies.soft_landing.trajectory import FIG_5, Trajectory

File = Annotated[Path | None, typer.Option(help="TOML file of ReluctanceActuator parameters", show_default=False)]


@command("soft-landing")
def soft_landing(
    to: Annotated[Path, Output.FILE, typer.Option("--out", help="CSV file for DriveVoltage")] = Path("drive.csv"),
    parameters: File = None,
    period: Annotated[float, typer.Option(help="Period of the cycles [s]")] = FIG_5.period,
    making_start: Annotated[float, typer.Option(help="Start of the closing motion [s]")] = FIG_5.making_start,
    making_duration: Annotated[float, typer.Option(help="Its duration [s]")] = FIG_5.making_duration,
    breaking_start: Annotated[float, typer.Option(help="Start of the opening motion [s]")] = FIG_5.breaking_start,
    breaking_duration: Annotated[float, typer.Option(help="Its duration [s]")] = FIG_5.breaking_duration,
    hold_voltage: Annotated[float, typer.Option(help="While it is closed [V]")] = FIG_5.hold_voltage,
    lead: Annotated[float, typer.Option(help="Constant voltage so long before each motion [s]")] = FIG_5.lead,
    highest_voltage: Annotated[float, typer.Option(help="What the drive can give, and its negative [V]")] = 200.0,
) -> None:
    """Voltage that moves a reluctance actuator without impact, as a table for DriveVoltage.

    The table has two cycles, from a core that is not magnetized; the second one repeats.
    """
    from gapsense.identification.parameter_set import parameters_of
    from gapsense.studies.soft_landing import cycle, table
    from gapsense.studies.soft_landing.show import phases

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
    from gapsense.studies.soft_landing.cycle import soft_landing
    from gapsense.studies.soft_landing.show import figure, phases

    plot.check_file(to)
    with bar("finding the voltage") as progress:
        cycle = soft_landing(parameters_of("reluctance_actuator", parameters), progress=progress)[-1]
    show(phases(cycle))
    written(plot.save(figure(cycle), to))
