"""What is compared with what: by the metrics of the scenario, else by equal names and units."""

from __future__ import annotations

from collections.abc import Iterator

from gapsense.cosim import Result
from gapsense.cosim.result.metrics import KINDS
from gapsense.cosim.scenario.records import Metric
from gapsense.report.html.subject import Shown

Key = tuple[str, str]  # unit and variable
GUESSED = "guessed"  # name of a comparison that no metric makes
COMPARING = ("required", "optional")  # use of a reference by metrics that take a difference


def pairs(shown: Shown) -> list[Metric]:
    """An estimate and its reference each, as metrics over the whole run; a number is no reference.

    Of quantities that no metric compares, equal names are.
    """
    stated = [of_metric(m) for m in (shown.scenario.metrics if shown.scenario else ()) if compares(m, shown)]
    found = {(m.signal, m.time): m for m in reversed(stated)}
    known = {own_key(shown.result, signal) for signal, _ in found}
    named = (m for m in by_name(shown.result) if own_key(shown.result, m.signal) not in known)
    return [*reversed(found.values()), *named]


def compares(metric: Metric, shown: Shown) -> bool:
    """True for a metric of the difference of two things of which one is recorded, the other recorded or constant."""
    known = {*shown.result.signals, *shown.result.parameters}
    is_difference = KINDS[metric.kind].reference in COMPARING
    return is_difference and isinstance(metric.reference, str) and metric.reference in known


def of_metric(metric: Metric) -> Metric:
    """The comparison of a metric, without its window."""
    return Metric(
        metric.name, "rmse", metric.signal, metric.reference, where=metric.where, time=metric.time, label=metric.label
    )


def by_name(result: Result) -> Iterator[Metric]:
    """Outputs that are called like one of a component that drives theirs, and have its unit."""
    place = {name: k for k, name in enumerate(result.run.order)}
    outputs = [name for name, about in result.about.items() if about.causality == "output"]
    first: dict[Key, str] = {}
    for name in sorted(outputs, key=lambda name: place.get(name.partition(".")[0], 0)):
        key = own_key(result, name)
        truth = first.setdefault(key, name)
        if truth != name and is_quantity(key[0]) and drives(result, truth, name):
            yield Metric(GUESSED, "rmse", name, truth)


def drives(result: Result, source: str, target: str) -> bool:
    """True if there is a way from the component of one signal to that of another; also if no wires are known."""
    ways = [tuple(end.partition(".")[0] for end in wire.split(" -> ")) for wire in result.run.wires]
    seen, fresh = set[str](), {source.partition(".")[0]}
    while fresh:
        seen |= fresh
        fresh = {b for a, b in ways if a in fresh} - seen
    return not ways or target.partition(".")[0] in seen - {source.partition(".")[0]}


def own_key(result: Result, name: str) -> Key:
    """Unit and variable of a signal."""
    return result.units.get(name, ""), name.partition(".")[2]


def is_quantity(unit: str) -> bool:
    """True for a unit that says what is measured: numbers without one have equal names by chance."""
    return unit not in ("", "1")
