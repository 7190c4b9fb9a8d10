"""Soft landing: a drive voltage for an actuator."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any

import typer

from gapsense.actuators.parameters import RTS_VALVE
from gapsense.actuators.reluctance_actuator import Parameters
from gapsense.cli.common import checkout, command, show
from gapsense.cosim import ScenarioError
from gapsense.cosim.parameters import read_parameters
from gapsense.fmi.package import load_component
from gapsense.fmi.settings import fields_of, unknown
from gapsense.studies.soft_landing.trajectory import FIG_5, Trajectory

File = Annotated[Path | None, typer.Option(help="TOML file of ReluctanceActuator parameters", show_default=False)]


@command("soft-landing")
def soft_landing(
    to: Annotated[Path, typer.Option("--out", help="CSV file for DriveVoltage")] = Path("drive.csv"),
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
    from gapsense.studies.soft_landing import table
    from gapsense.studies.soft_landing.cycle import run
    from gapsense.studies.soft_landing.show import phases

    device = actuator(parameters)
    motions = making_start, making_duration, breaking_start, breaking_duration
    cycles = run(device, Trajectory(period, *motions, hold_voltage, lead), highest_voltage=highest_voltage)
    times, voltages = table.voltage_table(cycles)
    deviation = table.deviation(cycles, *table.played(device, times, voltages))
    table.write(to, times, voltages)
    show(
        phases(cycles[-1]),
        f"Simulated with steps of 1 us, the actuator follows within {1e9 * deviation:.2g} nm.",
        f'{to}: {times.size} rows. In DriveVoltage set waveform = "soft_landing", soft_landing.file = "{to}", '
        f"soft_landing.period = {period:g}, soft_landing.repeat_from = {period:g}.",
    )


def actuator(parameters: Path | None) -> Parameters:
    """The actuator of a parameter set, or that of [RTS] Table I."""
    return _actuator(parameters) if parameters else RTS_VALVE


def _actuator(path: Path) -> Parameters:
    """Parameters of the actuator from a parameter set; what is not in the file is that of [RTS] Table I."""
    folder = checkout() / "fmus" / "reluctance_actuator"
    component = load_component(folder)
    ports, problems = {p.name: p for p in component.of("parameter")}, list[str]()
    values = read_parameters(path, problems)
    fields: dict[str, Any] = {}
    for name, value in values.items():
        where = f"{path.name}, values.{name}: "
        if name not in ports:
            problems.append(where + unknown(name, component.name, ports))
            continue
        try:
            fields |= fields_of(ports[name], value, folder)
        except ValueError as error:
            problems.append(f"{where}{value!r} found; {error}. Correct it.")
    given = {name: ports[name].start for name in ports} | values
    for limit in component.limits if not problems else ():
        if not math.prod(given[name] ** power for name, power in limit.powers) < limit.below:
            problems.append(f"{path.name}: {limit.text()} must be below {limit.below:g}: {limit.reason}.")
    if problems:
        raise ScenarioError(problems)
    return RTS_VALVE._replace(**fields)
