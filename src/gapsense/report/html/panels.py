"""The panels of a result: by physical quantity, estimates with what they are held to, errors below.

What is compared with what the metrics of the scenario say, or else equal names and units.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from gapsense.cosim import Result
from gapsense.cosim.result.metrics import KINDS
from gapsense.cosim.scenario.records import Metric
from gapsense.report.html import curves
from gapsense.report.html.curves import Curve, Panel, Strip
from gapsense.report.html.subject import Shown
from gapsense.units import QUANTITIES

Key = tuple[str, str]  # unit and variable
GUESSED = "guessed"  # name of a comparison that no metric makes
COMPARING = ("required", "optional")  # use of a reference by metrics that take a difference
TOGETHER = 6  # curves in a panel that has no truth
INNOVATION = "innovation"


def panels(shown: Shown) -> list[Panel]:
    """All panels but the strips, in the order in which the signals are recorded."""
    result, compared = shown.result, pairs(shown)
    made: list[Panel] = []
    for key, names in groups(shown, compared).items():
        own = [p for p in compared if p.signal in names]
        if key[1] == INNOVATION:
            made.append(innovations(result, names))
            continue
        made.append(panel(result, key, names, own))
        if own:
            made.append(errors(result, made[-1], own))
    return [panel for panel in made if any(c.values.size for c in panel.curves)]


def strips(shown: Shown) -> list[Strip]:
    """Modes, flags and codes."""
    result = shown.result
    return [curves.strip(result, name) for name in result.signals if is_strip(result, name)]


def is_strip(result: Result, name: str) -> bool:
    """True for a signal that is no curve."""
    return curves.is_discrete(result[name], result.units.get(name, ""))


def groups(shown: Shown, compared: list[Metric]) -> dict[Key, list[str]]:
    """Signals by panel."""
    result, helpers = shown.result, {p.time for p in compared}
    drawn = [
        name
        for name in result.signals
        if not (is_strip(result, name) or curves.is_deviation(result, name) or name in helpers)
    ]
    keys = keys_of(result, compared)
    matched = {*keys.values()}
    found: dict[Key, list[str]] = {}
    for name in drawn:
        key = keys.get(name) or own_key(result, name)
        together = key in matched or key[1] == INNOVATION or key[0] in ("", "1")
        found.setdefault(key if together else (key[0], ""), []).append(name)
    return dict(parted(found))


def keys_of(result: Result, compared: Iterable[Metric]) -> dict[str, Key]:
    """Panel of each signal that is compared, and of what it is compared with: that of the latter."""
    found: dict[str, Key] = {}
    for pair in compared:
        truth = str(pair.reference)
        found[pair.signal] = own_key(result, truth if truth in result.signals else pair.signal)
        if truth in result.signals:
            found.setdefault(truth, own_key(result, truth))
    return found


def parted(found: Mapping[Key, list[str]]) -> Iterator[tuple[Key, list[str]]]:
    """Groups of equal units that are too large, by variable."""
    for (unit, variable), names in found.items():
        if variable or len(names) <= TOGETHER:
            yield (unit, variable), names
            continue
        for own in dict.fromkeys(name.partition(".")[2] for name in names):
            yield (unit, own), [name for name in names if name.partition(".")[2] == own]


def panel(result: Result, key: Key, names: list[str], compared: list[Metric]) -> Panel:
    """Signals, and the parameters that they are held to."""
    later = {p.signal: p for p in compared if p.time is not None}
    truths = dict.fromkeys(str(p.reference) for p in compared)
    constants = [curves.constant(result, name) for name in truths if name not in result.signals]
    drawn = [
        curves.published(result, later[name]) if name in later else curves.recorded(result, name, name in truths)
        for name in names
    ]
    ordered = sorted([*constants, *drawn], key=lambda curve: not curve.is_truth)
    return Panel(title(key, ordered), key[0], tuple(ordered))


def title(key: Key, drawn: Iterable[Curve]) -> str:
    """Title of a panel."""
    unit, variable = key
    names = sorted({curve.name.partition(".")[2] for curve in drawn})
    usual = names[0] if len(names) == 1 else QUANTITIES.get(unit)
    return (variable or usual or ", ".join(names)).replace("_", " ")


def errors(result: Result, of: Panel, compared: list[Metric]) -> Panel:
    """Estimates minus their references."""
    drawn = tuple(curves.error(result, pair) for pair in compared)
    told = dict.fromkeys(f"{p.reference}{', by its name' if p.name == GUESSED else ''}" for p in compared)
    note = f"estimate less {', '.join(told)}"
    return Panel(f"error of the {of.title}", of.unit, drawn, is_error=True, note=note)


def innovations(result: Result, names: list[str]) -> Panel:
    """Innovations, with the expected band."""
    drawn = tuple(curves.error(result, Metric(name, "max_abs", name)) for name in names)  # less nothing
    return Panel("innovation", result.units.get(names[0], ""), drawn, is_error=True, note="measured less predicted")


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
