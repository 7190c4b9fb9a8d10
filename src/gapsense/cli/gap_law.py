"""The command that makes a gap law of measured inductances."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gapsense.cli.common import Assume, Column, Picture, SetFile, command, show, written


@command("gap-law")
def gap_law(
    data: Annotated[
        Path,
        typer.Argument(help="CSV file: gap [mm], inductance [mH], or inductance 100Hz [mH], ...", show_default=False),
    ],
    to: SetFile = Path("gap.toml"),
    turns: Annotated[
        float | None, typer.Option(help="Turns of the coil", show_default="of --parameters", min=1e-9)
    ] = None,
    parameters: Annotated[Path | None, typer.Option(help="What else is known of the valve", show_default=False)] = None,
    assume: Assume = False,
    figure: Picture = None,
    column: Column = None,
) -> None:
    """Make a gap law of the inductance of a coil, measured at known gaps.

    Of several frequencies the lowest is used. The law is linear, has fringes, or is a table, whichever foretells best
    the gaps that are left out; `gapsense identify --parameters gap.toml` goes on from there.
    """
    from gapsense.identification.assumptions import ask, list_values, meanings
    from gapsense.identification.gap_law.laws import best_law, candidates
    from gapsense.identification.gap_law.show import gap_law_figure, gap_law_tables, write_gap_law
    from gapsense.identification.gap_law.table import columns_given, read_inductances
    from gapsense.identification.identify import TABLE_I
    from gapsense.identification.parameter_set import parameters_of, read_sets
    from gapsense.identification.valve.show import BY_NAME
    from gapsense.report import plot

    if figure is not None:
        plot.check_file(figure)
    given, marked = read_sets([parameters] if parameters else [])
    par = parameters_of("solenoid_valve", parameters)
    if (is_assumed := turns is None and ("coil.turns" not in given or "coil.turns" in marked)) and not assume:
        ask(["coil.turns"], BY_NAME, "--turns", TABLE_I, ", or as `--turns`")
    turns = turns or float(par.coil_turns)
    measured = read_inductances(data, columns_given(column))
    found = candidates(measured.gap, turns**2 / measured.inductance)
    upper = float(measured.gap[-1])
    taken, upper = best_law(found), max(float(par.stop_upper), upper) if "stop.upper" in given else upper
    replaced = ("coil.turns", "core.reluctance", "gap.")
    assumed = [*["coil.turns"] * is_assumed, *(name for name in marked if not name.startswith(replaced))]
    files = write_gap_law(to, taken.law, turns, upper, given, f"gapsense gap-law {data.name}", assumed)
    show(*gap_law_tables(measured, turns, found, taken))
    if assumed:
        show(f"Assumed: {list_values({**given, 'coil.turns': turns}, BY_NAME, assumed)}.", *meanings(assumed))
    written(*files)
    if figure is not None:
        written(plot.save(gap_law_figure(measured, turns, taken), figure))
