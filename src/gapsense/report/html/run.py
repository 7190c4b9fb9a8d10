"""A single run as a chapter of the page: what the template `run.html` asks for."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from gapsense.cosim import Measured, Result
from gapsense.cosim.result.metrics import KINDS
from gapsense.cosim.scenario.records import Metric
from gapsense.report.html import curves, figures, style
from gapsense.report.html.curves import SIGMAS, Curve, Panel, Strip, most
from gapsense.report.html.figures import Axes, Chapter, Drawn, Verdict, limits
from gapsense.report.html.subject import Regression, Shown, regression
from gapsense.report.html.wiring import picture
from gapsense.report.runs import BOARD, board_rows, per_step
from gapsense.report.table import quantity
from gapsense.units import QUANTITIES

Key = tuple[str, str]  # unit and variable
GUESSED = "guessed"  # name of a comparison that no metric makes
COMPARING = ("required", "optional")  # use of a reference by metrics that take a difference
TOGETHER = 6  # curves in a panel that has no truth
INNOVATION = "innovation"
NEAR = 0.1  # of the range between two bounds
TUBES = 6  # that are drawn
LIMIT = 1.96  # standard deviations, for 95 %
FEWEST = 20  # samples that say anything


class Consistency(NamedTuple):
    """An error or innovation in terms of the deviation that its estimator states."""

    name: str
    samples: int  # with a deviation above 0: at a stop, some filters know the position exactly
    inside: float  # share within the band
    square: float  # mean of the square, 1 where the deviation is right
    correlation: float  # of neighbours, 0 for white noise

    @property
    def limit(self) -> float:
        """Correlation below which white noise stays in 95 % of records."""
        return LIMIT / float(np.sqrt(self.samples))


def chapter_of_run(shown: Shown, key: str) -> Chapter:
    """Everything about one run; plots, metrics, tubes and timing if it has any rows to show."""
    result, run, compared = shown.result, shown.result.run, regression(shown)
    has_time = result.times.size >= 2
    drawn = panels(shown) if has_time else []
    axes, stack = time_plots(shown, drawn, key) if has_time else (None, ())
    tubes = tube_plots(compared, axes, key) if axes else ()
    tables: dict[str, list[Measured]] = {}
    for m in result.metrics.values():
        tables.setdefault(m.table or "Metrics", []).append(m)
    content = {
        "shown": shown,
        "regression": compared,
        "span": span(result),
        "seeds": ", ".join(f"{name} {seed}" for name, seed in run.seeds.items()) or "none",
        "wiring": picture(run),
        "has_time": has_time,
        "figures": stack,
        "tubes": tubes,
        "metrics": tables,
        "consistency": [c for p in drawn if p.is_error for c in map(consistency, p.curves) if c],
        "hashes": {**run.files, **{fact["fmu"]: fact["sha256"] for fact in run.components.values()}},
        "bounds": lambda m: limits(m.bounds, lambda end: quantity(end, m.unit)),
        "share": share,
        "status": status,
        "per_step": per_step,
        "boards": (BOARD, board_rows(result)),
    }
    return Chapter(
        key=key,
        title=(run.title or run.scenario) + (f": {run.variant}" if run.variant else ""),
        name=run.scenario,
        about=shown.scenario.variants.get(run.variant or "", "") if shown.scenario else "",
        verdict=verdict(shown, compared),
        template="run.html",
        content=content,
        figures=(*stack, *tubes),
    )


def verdict(shown: Shown, regression: Regression) -> Verdict:
    """Judge a run by its end, its metrics and its baseline."""
    result = shown.result
    outside = [m for m in result.metrics.values() if not m.passed]
    bounded = sum(m.bounds is not None for m in result.metrics.values())
    sentences = []
    if result.failure:
        sentences.append(f"A component failed: {result.failure}")
    if result.interrupted:
        sentences.append(f"Interrupted: recorded is {span(result)}.")
    if outside:
        sentences.append(f"{len(outside)} of {len(result.metrics)} metrics are outside of their bounds.")
    elif bounded:
        subject = "The metric with bounds is" if bounded == 1 else f"All {bounded} metrics with bounds are"
        sentences.append(f"{subject} within them.")
    else:
        sentences.append("No metric has bounds.")
    if regression.problems:
        sentences.append(f"It differs from its baseline: {len(regression.problems)} findings.")
    elif regression.tubes:
        sentences.append(f"All {len(regression.tubes)} signals of the baseline are within their tolerances.")
    else:
        sentences.append(regression.note)
    sentences += [f"Note: {remark}" for remark in result.run.remarks]
    bad = result.failure or result.interrupted or outside or regression.problems
    return Verdict(not bad, tuple(sentences))


def span(result: Result) -> str:
    """First and last time of the record."""
    ends = (result.times[0], result.times[-1]) if result.times.size else (result.run.start, result.run.start)
    return " to ".join(quantity(float(end), "s") for end in ends)


def share(m: Measured) -> float:
    """Where between its bounds a metric is: 0 at the lower, 1 at the upper one; NaN without two of them."""
    if m.bounds is None or not all(map(math.isfinite, (*m.bounds, m.value))) or m.bounds[0] == m.bounds[1]:
        return math.nan
    return (m.value - m.bounds[0]) / (m.bounds[1] - m.bounds[0])


def status(m: Measured) -> str:
    """How a metric that is within its bounds stands, in words; no words if it has no bounds."""
    found = share(m)
    is_close = found < NEAR and m.bounds is not None and m.bounds[0] != 0.0  # an error may well be near 0
    return "near a bound" if is_close or found > 1.0 - NEAR else "within" if m.bounds else ""


def consistency(curve: Curve) -> Consistency | None:
    """How a curve lies in its band around zero; None without a band, or with hardly any samples."""
    if curve.band is None:
        return None
    deviation = curve.band / SIGMAS
    known = (deviation > 0.0) & np.isfinite(curve.values)
    if known.sum() < FEWEST:
        return None
    scaled = curve.values[known] / deviation[known]
    neighbours = float(np.sum(scaled[1:] * scaled[:-1]))
    total = float(np.sum(scaled**2))
    return Consistency(
        name=curve.name,
        samples=scaled.size,
        inside=float(np.mean(np.abs(scaled) <= SIGMAS)),
        square=total / scaled.size,
        correlation=neighbours / total if total else float("nan"),
    )


def time_plots(shown: Shown, drawn: Sequence[Panel], key: str) -> tuple[Axes, tuple[Drawn, ...]]:
    """All plots over time of a result, and the axis that they share."""
    flags = strips(shown)
    names = [c.component for p in drawn for c in p.curves if not c.is_truth]
    truths = [c.component for p in drawn for c in p.curves]
    columns = sum(4 if c.band is not None else 2 for p in drawn for c in p.curves) // 2  # times, values, two for a band
    axes = figures.make_time_axis(shown, style.colours([*names, *truths]), most(columns))
    made = [figures.panel(p, axes, f"{key}-p{k}") for k, p in enumerate(drawn)]
    return axes, (*made, *([figures.strips(flags, axes, f"{key}-s")] if flags else []))


def tube_plots(regression: Regression, axes: Axes, key: str) -> tuple[Drawn, ...]:
    """Tubes of the signals that fail, or of the one that is nearest to its tolerance, if it is not the same."""
    failing = [tube for tube in regression.tubes if tube.failing.any()]
    nearest = [tube for tube in regression.tubes[:1] if tube.share]
    chosen = failing[:TUBES] or nearest
    return tuple(drawn for k, tube in enumerate(chosen) for drawn in figures.tube(tube, axes, f"{key}-t{k}"))


# The panels of a result: by physical quantity, estimates with what they are held to, errors below.
#
# What is compared with what the metrics of the scenario say, or else equal names and units.


def panels(shown: Shown) -> list[Panel]:
    """All panels but the strips, in the order in which the signals are recorded."""
    result, compared = shown.result, pairs(shown)
    made: list[Panel] = []
    for key, names in groups(shown, compared).items():
        own = [p for p in compared if p.signal in names]
        if key[1] == INNOVATION:
            made.append(innovations(result, names))
            continue
        made.append(panel(result, key, names, own, published_later(names, compared)))
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
    return dict(split_groups(found))


def keys_of(result: Result, compared: Iterable[Metric]) -> dict[str, Key]:
    """Panel of each signal that is compared, and of what it is compared with: that of the latter."""
    found: dict[str, Key] = {}
    for pair in compared:
        truth = str(pair.reference)
        found[pair.signal] = own_key(result, truth if truth in result.signals else pair.signal)
        if truth in result.signals:
            found.setdefault(truth, own_key(result, truth))
    return found


def split_groups(found: Mapping[Key, list[str]]) -> Iterator[tuple[Key, list[str]]]:
    """Split groups of equal units that are too large, by variable."""
    for (unit, variable), names in found.items():
        if variable or len(names) <= TOGETHER:
            yield (unit, variable), names
            continue
        for own in dict.fromkeys(name.partition(".")[2] for name in names):
            yield (unit, own), [name for name in names if name.partition(".")[2] == own]


def published_later(names: list[str], compared: list[Metric]) -> dict[str, Metric]:
    """Signals of earlier times, as metrics tell: of `a.smoothed_time` are `a.smoothed_position` and all such names."""
    timed = [(p, p.time.removesuffix("time")) for p in compared if p.time is not None]
    return {n: replace(p, signal=n) for n in names for p, begin in timed if p.signal == n or n.startswith(begin)}


def panel(result: Result, key: Key, names: list[str], compared: list[Metric], later: Mapping[str, Metric]) -> Panel:
    """Signals, and the parameters that they are held to; those published `later` at the times that they are about."""
    truths = dict.fromkeys(str(p.reference) for p in compared)
    constants = [curves.constant(result, name) for name in truths if name not in result.signals]
    drawn = [
        curves.from_samples(result, later[name]) if name in later else curves.from_signal(result, name, name in truths)
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
    note = f"estimate minus {', '.join(told)}"
    return Panel(f"error of the {of.title}", of.unit, drawn, is_error=True, note=note)


def innovations(result: Result, names: list[str]) -> Panel:
    """Innovations, with the expected band."""
    drawn = tuple(curves.error(result, Metric(name, "max_abs", name)) for name in names)  # less nothing
    return Panel("innovation", result.units.get(names[0], ""), drawn, is_error=True, note="measured less predicted")


def pairs(shown: Shown) -> list[Metric]:
    """An estimate and its reference each, as metrics over the whole run; a number is no reference.

    Of quantities that no metric compares, equal names are.
    """
    given = shown.scenario.metrics if shown.scenario else ()
    stated = [replace(m, kind="rmse", after=None, before=None, event=None) for m in given if compares(m, shown)]
    found = {(m.signal, m.time): m for m in reversed(stated)}
    known = {own_key(shown.result, signal) for signal, _ in found}
    named = (m for m in by_name(shown.result) if own_key(shown.result, m.signal) not in known)
    return [*reversed(found.values()), *named]


def compares(metric: Metric, shown: Shown) -> bool:
    """True for a metric of the difference of two things of which one is recorded, the other recorded or constant."""
    known = {*shown.result.signals, *shown.result.parameters}
    is_difference = KINDS[metric.kind].reference in COMPARING
    return is_difference and isinstance(metric.reference, str) and metric.reference in known


def by_name(result: Result) -> Iterator[Metric]:
    """Outputs that are called like one of a component that drives theirs, and have its unit.

    Numbers without one have equal names by chance.
    """
    place = {name: k for k, name in enumerate(result.run.order)}
    outputs = [name for name, about in result.about.items() if about.causality == "output"]
    first: dict[Key, str] = {}
    for name in sorted(outputs, key=lambda name: place.get(name.partition(".")[0], 0)):
        key = own_key(result, name)
        truth = first.setdefault(key, name)
        if truth != name and key[0] not in ("", "1") and drives(result, truth, name):
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
