"""A gap law from inductances for the user: its parameter set, tables, sentences and a figure.

Parameters of the solenoid valve by formula where the law has one, otherwise a table beside the set.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from rich.table import Table

from gapsense.actuators.magnetics import MU_0
from gapsense.identification.gap_law.laws import Candidate, Law, Vector, jackknife, reluctance, rows, total
from gapsense.identification.gap_law.table import Inductances, remarks
from gapsense.identification.parameter_set import GAPS, Entry, round_value, write_set, write_table
from gapsense.report.plot import SECOND, TRUE, legend, stack
from gapsense.report.table import percent, quantity, table
from gapsense.tables import Value


def fields(law: Law) -> dict[str, float]:
    """Fields of the valve's parameters that a law by formula has."""
    if law.name == "linear":
        return {"gap_slope": law.numbers[0]}
    if law.name == "fringing":
        r0, _, window = law.numbers
        return {"gap_area": 1.0 / (MU_0 * r0), "gap_window": 0.5 * window}
    return {}


def values(law: Law, turns: float) -> dict[str, Value]:
    """Parameters by name, but for the file of a table; all that is left without a gap is ascribed to the core."""
    numbers = {name.replace("_", "."): number for name, number in fields(law).items()}
    kind = law.name if numbers else "table"
    return {"coil.turns": turns, "core.reluctance": law.offset, "gap.law": kind, **numbers}


def standard_errors(taken: Candidate, turns: float) -> dict[str, float]:
    """By parameter that is a number, in its unit."""
    names = ["core.reluctance", *(name.replace("_", ".") for name in fields(taken.law))]
    each = [values(law, turns) for law in taken.others]
    return dict(zip(names, jackknife(np.array([[float(one[name]) for name in names] for one in each])).tolist()))


def write_gap_law(
    file: Path,
    law: Law,
    turns: float,
    upper: float,
    given: Mapping[str, Value],
    origin: str,
    assumed: Sequence[str] = (),
) -> list[Path]:
    """Write a parameter set, what was given and the law in its place, and the table that it needs; the files."""
    found, table = values(law, turns), file.with_name(f"{file.stem}_law.csv")
    if found["gap.law"] == "table":
        found["gap.file"] = str(write_table(table, rows(law._replace(offset=0.0), upper)).resolve())
    laws = {name for names in GAPS.values() for name in names}
    kept = {name: value for name, value in given.items() if name not in laws}
    if "coil.turns" in assumed:  # the law rests on them
        assumed = [*assumed, *(name for name in found if name in laws)]
    write_set(
        file,
        "Gap law from measured inductances",
        origin,
        [Entry(name, round_value(value)) for name, value in {**kept, **found}.items()],
        assumed=[*dict.fromkeys(assumed)],
    )
    return [file, *([table] if "gap.file" in found else [])]


POOR = 0.05  # relative error of the inductances left out from which a table is called coarse


def gap_law_tables(
    measured: Inductances, turns: float, found: Sequence[Candidate], taken: Candidate
) -> list[Table | str]:
    """The law that was taken, beside the others and the inductances."""
    return [choice(found, taken), law(measured, turns, taken), *remarks(measured), *said(turns, taken)]


def choice(found: Sequence[Candidate], taken: Candidate) -> Table:
    """All laws that were tried."""
    rows = []
    for each in found:
        mark = "taken" if each is taken else ""
        rows.append((each.law.name, f"{each.size}", percent(each.misfit), percent(each.foretold), mark))
    return table("Laws", ("", "numbers", "misfit", "of gaps left out", ""), rows)


def law(measured: Inductances, turns: float, taken: Candidate) -> Table:
    """The law at the measured gaps."""
    h = measured.gap
    L = turns**2 / total(taken.law, h)
    R, slope = reluctance(taken.law, h)
    errors = jackknife(np.array([reluctance(each, h)[1] for each in taken.others]))
    rows = []
    for gap, a, b, c, d, e in zip(*(x.tolist() for x in (h, measured.inductance, L, R, slope, errors))):
        steep = f"{quantity(d, '1/(H.m)')} +- {quantity(e, '')}"
        rows.append((quantity(gap, "m"), quantity(a, "H"), percent(b / a - 1.0), quantity(c, "1/H"), steep))
    return table("Gap law", ("gap", "inductance", "of the law", "reluctance of the gap", "slope"), rows, texts=1)


def said(turns: float, taken: Candidate) -> list[str]:
    """What the numbers are, and what they do not tell."""
    offset = jackknife(np.array([[each.offset] for each in taken.others]))[0]
    told = [
        f"Without gap {quantity(taken.law.offset, '1/H')} +- {quantity(float(offset), '')} is left. It is ascribed to"
        " the core; which part of it saturates, records of voltage and current show:"
        " `gapsense identify --inductance`.",
        f"Reluctances are those for {turns:g} turns. Inductances do not show the turns, and current, flux linkage and"
        " force do not depend on them if all reluctances go with their square.",
    ]
    if taken.foretold > POOR:
        told.append(
            f"A gap that is left out is predicted to {percent(taken.foretold)} only, and the force is the slope:"
            " measure at more gaps."
        )
    return told


def gap_law_figure(measured: Inductances, turns: float, taken: Candidate) -> Figure:
    """Inductance and slope by the gap."""
    figure, axes = stack("Gap law", ["inductance / mH", "slope / (1/(H.mm))"], [2.0, 1.0])
    h: Vector = np.linspace(0.0, float(measured.gap.max()), 201)
    for rate, L in sorted(measured.others.items()):
        axes[0].plot(1e3 * measured.gap, 1e3 * L, "o", ms=3, label=f"{rate:g} Hz, not used")
    axes[0].plot(1e3 * measured.gap, 1e3 * measured.inductance, "o", ms=5, color=TRUE, label="measured")
    axes[0].plot(1e3 * h, 1e3 * turns**2 / total(taken.law, h), color=SECOND, label=taken.law.name)
    axes[1].plot(1e3 * h, 1e-3 * reluctance(taken.law, h)[1], color=SECOND)
    legend(axes[0])
    axes[1].set_xlabel("gap / mm")
    return figure
