"""The benchmark of all estimators: a table for each condition, one that sums it up, also as Markdown, and figures."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure
from rich.table import Table

from gapsense.cosim import Result
from gapsense.report import plot
from gapsense.report.plot import FIRST, SECOND, THIRD, TRUE, line
from gapsense.report.table import add_row, table

from .contenders import CONTENDERS, Contender
from .measures import estimate, learnt, lined_up, signals, truth

Runs = Mapping[str, npt.NDArray[np.float64]]  # values by `component.number`, one per run
Found = Mapping[str | None, Runs]  # by variant; None is the scenario itself
CONDITIONS = {  # title by variant
    None: "plain",
    "slow": "slowed",
    "soft": "soft landing",
    "quiet": "0.2 mA",
    "noisy": "20 mA",
    "wrong_5": "5 % wrong",
    "wrong_10": "10 % wrong",
    "warm": "warm coil",
    "cold": "cold coil",
    "together": "together",
}
HOLD_OUTS: dict[str | None, str] = {  # conditions that no estimator was tuned on
    "volts_27": "27 V",
    "other_gap": "other gap",
    "other_table": "other table",
    "all_wrong": "all wrong",
    "bounce": "bounce",
    "offset": "3 mA offset",
    "friction": "friction",
    "other_physics": "other physics",
}
TITLES = {**CONDITIONS, **HOLD_OUTS}
DRAWN = ("wrong_5", "wrong_10", "together", "all_wrong")  # where the runs differ by wrong parameters
COLUMNS = {  # number, factor and digits by title
    "position / um": ("position", 1e6, 1),
    "velocity / (mm/s)": ("velocity", 1e3, 0),
    "flux linkage / uWb": ("flux_linkage", 1e6, 0),
    "resistance / mOhm": ("resistance", 1e3, 0),
}
SUMMED_UP = (  # title, number, variant, factor, digits
    ("z / um", "position", None, 1e6, 1),
    ("20 mA", "position", "noisy", 1e6, 0),
    ("5 % wrong", "position", "wrong_5", 1e6, 0),
    ("warm coil", "position", "warm", 1e6, 0),
    ("cold coil", "position", "cold", 1e6, 0),
    ("v / (mm/s)", "velocity", None, 1e3, 0),
    ("flux / uWb", "flux_linkage", None, 1e6, 0),
    ("cold coil", "flux_linkage", "cold", 1e6, 0),
    ("R / mOhm, warm coil", "resistance", "warm", 1e3, 0),
)
MEANT = (  # signal, label and factor
    ("sensor.voltage_measured", "voltage / V", 1.0),
    ("sensor.current_measured", "current / mA", 1e3),
    ("actuator.position", "true position\n/ mm", 1e3),
    ("actuator.flux_linkage", "true flux linkage\n/ mWb", 1e3),
)
ERRORS = {"position": "error of the\nposition / µm", "flux_linkage": "error of the flux\nlinkage / µWb"}
HUES = (FIRST, SECOND, THIRD, "#8250df", "#bf8700")
PANELS = {"position": ("position / um", 1e6), "flux_linkage": ("flux linkage / mWb", 1e3)}


def tables(found: Found) -> list[Table | str]:
    """Tables of the conditions that were run, the plain scenario first, then what sums them up."""
    first = next(iter(found.values()))
    short = [table(title, head, rows) for title, (head, *rows) in summaries(found).items()]
    return [*(condition(v, found[v]) for v in TITLES if v in found), *short, *waits(first)]


def summaries(found: Found) -> dict[str, list[list[str]]]:
    """By title the rows, headings first, of the tables that sum up all conditions that were run."""
    made = {
        "Summed up, medians (worst)": summary(of(found, CONDITIONS)),
        "Conditions that nobody tuned on, medians (worst)": held_out(of(found, HOLD_OUTS)),
    }
    return {title: rows for title, rows in made.items() if rows}


def of(found: Found, chosen: Mapping[Any, str]) -> Found:
    """The conditions that were run of some."""
    return {variant: found[variant] for variant in chosen if variant in found}


def condition(variant: str | None, runs: Runs) -> Table:
    """Median over the runs of a condition, and the worst of them, by estimator."""
    size = next(iter(runs.values())).size
    title = f"{TITLES[variant]} ({variant or 'the scenario itself'}), {size} runs: root mean square errors, "
    made = table(f"{title}median (worst)", ["", *COLUMNS, "missed landings"])
    for c in CONTENDERS:
        cells = (spread(values(runs, c, number) * factor, digits) for number, factor, digits in COLUMNS.values())
        add_row(made, c.label, *cells, misses([runs], c))
    return made


def values(runs: Runs, contender: Contender, number: str) -> npt.NDArray[np.float64]:
    """A number of an estimator in all runs."""
    return runs[f"{contender.component}.{number}"]


def median(numbers: npt.NDArray[np.float64], digits: int) -> str:
    """Median, or nothing where the estimator does not give the quantity."""
    return "-" if np.all(np.isnan(numbers)) else f"{np.median(numbers):.{digits}f}"


def spread(numbers: npt.NDArray[np.float64], digits: int) -> str:
    """Median and largest, or nothing where the estimator does not give the quantity."""
    return "-" if np.all(np.isnan(numbers)) else f"{median(numbers, digits)} ({np.max(numbers):.{digits}f})"


def misses(found: Sequence[Runs], contender: Contender) -> str:
    """Missed landings of all landings."""
    lost, landings = (sum(float(values(runs, contender, n).sum()) for runs in found) for n in ("missed", "landings"))
    return "-" if np.isnan(lost) else f"{lost:.0f} of {landings:.0f}"


def summary(found: Found) -> list[list[str]]:
    """Errors and costs: medians (worst) of the runs; latency of the plain scenario, least cost of all runs."""
    if not found:
        return []
    titles = [title for title, _, variant, _, _ in SUMMED_UP if variant in found]
    head = ["", *titles, "missed", "latency / ms", "us per step", "needs beside u, i"]
    return [head, *(summed_up(c, found) for c in CONTENDERS)]


def held_out(found: Found) -> list[list[str]]:
    """Errors of the position [um] under the conditions that nobody tuned on, medians (worst) of the runs."""
    if not found:
        return []
    head = ["z / um", *(HOLD_OUTS[variant] for variant in found), "missed"]
    giving = [c for c in CONTENDERS if "position" in c.gives]
    rows = [
        [
            c.label,
            *(typical(variant, runs, c, "position", 1e6, 0) for variant, runs in found.items()),
            misses([*found.values()], c),
        ]
        for c in giving
    ]
    return [head, *rows]


def markdown(found: Found) -> str:
    """What sums up the conditions, for a page: tables in Markdown."""
    ruled = ([head, ["---"] * len(head), *rows] for head, *rows in summaries(found).values())
    return "\n".join("".join(f"| {' | '.join(row)} |\n" for row in rows) for rows in ruled)


def typical(variant: str | None, runs: Runs, contender: Contender, number: str, factor: float, digits: int) -> str:
    """The worst run is shown where the runs differ by wrong parameters, not where they differ by the noise only."""
    return (spread if variant in DRAWN else median)(factor * values(runs, contender, number), digits)


def summed_up(contender: Contender, found: Found) -> list[str]:
    """The row of an estimator."""
    cells = [
        typical(variant, found[variant], contender, number, factor, digits)
        for _, number, variant, factor, digits in SUMMED_UP
        if variant in found
    ]
    late = median(1e3 * values(next(iter(found.values())), contender, "latency"), 1)
    cost = f"{min(float(values(runs, contender, 'cost').min()) for runs in found.values()):.0f}"
    return [contender.label, *cells, misses(list(found.values()), contender), late, cost, contender.needs]


def waits(runs: Runs) -> Iterator[str]:
    """How long after a landing those that are late have published its motion."""
    for contender in CONTENDERS:
        late = median(1e3 * values(runs, contender, "after_landing"), 1)
        if contender.published and late != "-":
            yield f"{contender.label}: a motion is published completely {late} ms after its landing."


def conditions(found: Found) -> Figure:
    """Medians over the runs of the root mean square errors, a row for each estimator: dark is small."""
    shown = [variant for variant in TITLES if variant in found]
    giving = {quantity: [c for c in CONTENDERS if quantity in c.gives] for quantity in PANELS}
    counts = [len(contenders) for contenders in giving.values()]
    size, title = (plot.PAGE, 1.6 + 0.29 * sum(counts)), "All estimators on the same actuator: median of the runs"
    figure, axes = plot.panels(title, len(PANELS), size=size, height_ratios=counts)
    for axis, (quantity, (label, factor)) in zip(axes[:, 0], PANELS.items()):
        rows = [[factor * np.median(values(found[v], c, quantity)) for v in shown] for c in giving[quantity]]
        coloured(axis, np.array(rows))
        axis.set_title(f"RMS error of the {label}", loc="left", fontsize="medium")
        axis.set_yticks(range(len(rows)), [c.label for c in giving[quantity]])
        axis.set_xticks(range(len(shown)), [re.sub(r" (?=[a-z]{3})", "\n", TITLES[variant]) for variant in shown])
    return figure


def coloured(axis: Any, numbers: npt.NDArray[np.float64]) -> None:
    """A table of numbers with two digits, each on a colour by its logarithm."""
    logs = np.log10(numbers)
    least, span = np.nanmin(logs), np.nanmax(logs) - np.nanmin(logs)
    axis.imshow(logs, cmap="viridis", aspect="auto", vmax=least + span / 0.9)
    for (row, column), number in np.ndenumerate(numbers):
        color = "white" if logs[row, column] < least + 0.55 * span else "black"
        axis.text(column, row, short(number), color=color, ha="center", va="center", fontsize="small")
    axis.grid(False)
    axis.tick_params(length=0)
    axis.spines[:].set_visible(False)


def short(number: float) -> str:
    """A number with two digits: `0.012`, `1.2`, `12`, `120`."""
    return "" if np.isnan(number) else f"{float(f'{number:.2g}'):g}"


def run_figure(result: Result) -> Figure:
    """The second cycle of a run: voltage, current and the truth, then the errors of a few estimators per row."""
    plot.require_recorded(result, [*signals(), "sensor.voltage_measured", "sensor.current_measured"])
    groups, seen = families(), (result.times >= learnt(result)) & (result.times < 2.0 * learnt(result))
    title = f"{result.run.scenario}: {result.run.title}"
    size = (plot.PAGE, 2.5 + 1.9 * len(groups))
    figure, axes = plot.panels(title, 2 + len(groups), 2, size=size, sharex=True)
    for axis, (name, label, factor) in zip(axes[:2].flat, MEANT):
        line(axis, result.times[seen], factor * result[name][seen], TRUE)
        axis.set_ylabel(label)
    for row, group in zip(axes[2:], groups):
        for axis, (quantity, label) in zip(row, ERRORS.items()):
            shown = [error(result, contender, quantity)[seen] for contender in group]
            for contender, color, values in zip(group, HUES, shown):
                line(axis, result.times[seen], values, color, contender.label)
            axis.set_ylabel(label)
            axis.set_visible(not np.all(np.isnan(shown)))
        plot.legend(row[-1])
    for axis in axes[-1]:
        axis.set_xlabel("time / ms")
    figure.align_ylabels()
    return figure


def families(most: int = plot.MOST) -> list[list[Contender]]:
    """The contenders that share an FMU together, small families side by side."""
    groups: list[list[Contender]] = []
    for fmu in dict.fromkeys(c.fmu for c in CONTENDERS):
        family = [c for c in CONTENDERS if c.fmu == fmu]
        if groups and len(groups[-1]) + len(family) <= most:
            groups[-1] += family
        else:
            groups += [family[k : k + most] for k in range(0, len(family), most)]
    return groups


def error(result: Result, contender: Contender, quantity: str) -> npt.NDArray[np.float64]:
    """Error in micro-units at each row that an estimate is about; nan where there is none."""
    found, errors = estimate(result, contender, quantity), np.full(result.times.size, np.nan)
    if found is not None:
        came, about = lined_up(result, contender)
        errors[about] = 1e6 * (found[came] - truth(result, quantity)[about])
    return errors
