"""A single run as a chapter of the page: what the template `run.html` asks for."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from gapsense.cosim import Measured, Result
from gapsense.report.html import figures, style
from gapsense.report.html.chapter import Chapter, Verdict, limits
from gapsense.report.html.curves import SIGMAS, Curve, Panel, most
from gapsense.report.html.figures import Axes, Drawn
from gapsense.report.html.panels import panels, strips
from gapsense.report.html.subject import Regression, Shown, regression
from gapsense.report.html.wiring import picture
from gapsense.report.runs import per_step
from gapsense.report.table import quantity

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
    """How a metric stands that is within its bounds, if it has any."""
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
    axes = figures.shared(shown, style.colours([*names, *truths]), most(columns))
    last = len(drawn) - 1 if not flags else None
    made = [figures.panel(p, axes, f"{key}-p{k}", k == last) for k, p in enumerate(drawn)]
    return axes, (*made, *([figures.strips(flags, axes, f"{key}-s")] if flags else []))


def tube_plots(regression: Regression, axes: Axes, key: str) -> tuple[Drawn, ...]:
    """Tubes of the signals that fail, or of the one that is nearest to its tolerance, if it is not the same."""
    failing = [tube for tube in regression.tubes if tube.failing.any()]
    nearest = [tube for tube in regression.tubes[:1] if tube.share]
    chosen = failing[:TUBES] or nearest
    return tuple(drawn for k, tube in enumerate(chosen) for drawn in figures.tube(tube, axes, f"{key}-t{k}"))
