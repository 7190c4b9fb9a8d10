"""The benchmark of all estimators as text: a table for each condition, and one that sums it up, as Markdown."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from gapsense.studies.estimators.measures import CONTENDERS, Contender

Runs = Mapping[str, npt.NDArray[np.float64]]  # values by `component.number`, one per run


class Condition(NamedTuple):
    """A variant of the scenario; None is the plain one."""

    variant: str | None
    title: str


CONDITIONS = (
    Condition(None, "plain"),
    Condition("slow", "slowed"),
    Condition("soft", "soft landing"),
    Condition("quiet", "0.2 mA"),
    Condition("noisy", "20 mA"),
    Condition("wrong_5", "5 % wrong"),
    Condition("wrong_10", "10 % wrong"),
    Condition("warm", "warm coil"),
    Condition("cold", "cold coil"),
    Condition("together", "together"),
)
COLUMNS = {  # title, number, factor, digits
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


def text(found: Mapping[str | None, Runs]) -> str:
    """Tables of the conditions that were run, then the summary.

    Parameters
    ----------
    found : mapping
        By variant, the metrics of its runs that `estimators.measure` gives.
    """
    lines = [line for condition in CONDITIONS if condition.variant in found for line in table(condition, found)]
    return "\n".join([*lines, *summary(found)])


def table(condition: Condition, found: Mapping[str | None, Runs]) -> Iterator[str]:
    """Median over the runs of a condition, and the worst of them, by estimator."""
    runs = found[condition.variant]
    count = next(iter(runs.values())).size
    name = condition.variant or "the scenario itself"
    yield f"{condition.title} ({name}), {count} runs: root mean square errors, median (worst)"
    yield f"  {'':18}" + "".join(f"{title:>22}" for title in COLUMNS) + f"{'missed landings':>18}"
    for contender in CONTENDERS:
        cells = (
            spread(values(runs, contender, number) * factor, digits) for number, factor, digits in COLUMNS.values()
        )
        yield f"  {contender.label:18}" + "".join(f"{cell:>22}" for cell in cells) + f"{misses([runs], contender):>18}"
    yield ""


def values(runs: Runs, contender: Contender, number: str) -> npt.NDArray[np.float64]:
    """A number of an estimator in all runs."""
    return runs[f"{contender.component}.{number}"]


def spread(numbers: npt.NDArray[np.float64], digits: int) -> str:
    """Median and largest, or nothing where the estimator does not give the quantity."""
    if np.all(np.isnan(numbers)):
        return "-"
    return f"{np.median(numbers):.{digits}f} ({np.max(numbers):.{digits}f})"


def misses(of: Sequence[Runs], contender: Contender) -> str:
    """Missed landings of all landings."""
    lost, landings = (sum(float(values(runs, contender, n).sum()) for runs in of) for n in ("missed", "landings"))
    return "-" if np.isnan(lost) else f"{lost:.0f} of {landings:.0f}"


def summary(found: Mapping[str | None, Runs]) -> Iterator[str]:
    """The table of the README: medians (worst) of the runs; latency of the plain scenario, least cost of all runs."""
    titles = [title for title, _, variant, _, _ in SUMMED_UP if variant in found]
    head = ["", *titles, "missed", "latency / ms", "us per step", "needs beside u, i"]
    yield "| " + " | ".join(head) + " |"
    yield "| --- " * len(head) + "|"
    for contender in CONTENDERS:
        cells = [
            shown(variant)(values(found[variant], contender, number) * factor, digits)
            for _, number, variant, factor, digits in SUMMED_UP
            if variant in found
        ]
        late = median(values(next(iter(found.values())), contender, "latency") * 1e3, 1)
        cost = f"{min(float(values(runs, contender, 'cost').min()) for runs in found.values()):.0f}"
        row = [contender.label, *cells, misses(list(found.values()), contender), late, cost, contender.needs]
        yield "| " + " | ".join(row) + " |"
    yield ""
    yield from waits(next(iter(found.values())))


def shown(variant: str | None) -> Callable[[npt.NDArray[np.float64], int], str]:
    """Median alone where the runs differ by the noise only, with the worst where they differ by wrong parameters."""
    return spread if variant and variant.startswith("wrong") else median


def median(numbers: npt.NDArray[np.float64], digits: int) -> str:
    """Median, or nothing where the estimator does not give the quantity."""
    return "-" if np.all(np.isnan(numbers)) else f"{np.median(numbers):.{digits}f}"


def waits(runs: Runs) -> Iterator[str]:
    """How long after a landing those that are late have published its motion."""
    for contender in CONTENDERS:
        late = 1e3 * values(runs, contender, "after_landing")
        if contender.published and not np.all(np.isnan(late)):
            yield f"{contender.label}: a motion is published completely {np.median(late):.1f} ms after its landing."
