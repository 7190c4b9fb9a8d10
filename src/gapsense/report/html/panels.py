"""The panels of a result: by physical quantity, estimates with what they are held to, errors below."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from gapsense.cosim import Result
from gapsense.cosim.scenario.records import Metric
from gapsense.report.html import curves
from gapsense.report.html.curves import Curve, Panel, Strip
from gapsense.report.html.pairs import GUESSED, Key, own_key, pairs
from gapsense.report.html.subject import Shown
from gapsense.units import QUANTITIES

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
