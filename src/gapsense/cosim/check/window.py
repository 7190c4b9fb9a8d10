"""Whether the window of a metric has samples: recorded rows at which the component of its signal has just stepped."""

from __future__ import annotations

from collections.abc import Iterator
from math import gcd, lcm

from gapsense.cosim.scenario.elements import Component
from gapsense.cosim.scenario.records import Metric, Scenario

SLACK = 1e-9  # of a base step, as when the metric is computed


def check_window(metric: Metric, scenario: Scenario) -> Iterator[str]:
    """Problem of a metric that would have no samples, whatever its signals are."""
    component = scenario.components.get(metric.signal.partition(".")[0])
    if component is None:
        return
    place = f"metrics.{metric.name}"
    decimation, experiment = scenario.record.decimation, scenario.experiment
    first = first_row(component, decimation)
    if first is None:
        yield (
            f"{place}: `{component.name}` never steps at a row that is recorded: its step is {component.step}, its "
            f"offset {component.offset}, and `record.decimation` {decimation} base steps. Change one of them."
        )
        return
    if metric.time is not None or metric.event is not None:  # times that are known only then
        return
    every, base = lcm(component.step, decimation), experiment.base_step
    if metric.after is not None:
        steps = (metric.after - experiment.time(first)) / base + SLACK
        first += every * (1 + int(min(steps, experiment.count) // every)) if steps >= 0.0 else 0
    is_late = metric.before is not None and experiment.time(first) >= metric.before - SLACK * base
    if first > experiment.count or is_late:
        limits = {"after": metric.after, "before": metric.before}
        window = " and ".join(f"`{key}` = {limit:.9g} s" for key, limit in limits.items() if limit is not None)
        span = f"from {experiment.start:.9g} s to {experiment.stop:.9g} s with a sample every {every * base:.9g} s"
        yield f"{place}: no sample has {window or 'its place'} in a run {span}. Correct the window."


def first_row(component: Component, decimation: int) -> int | None:
    """First base step that is recorded and ends a step of the component; None if there is never one."""
    step, offset = component.step, component.offset
    common = gcd(step, decimation)
    if offset % common:
        return None
    turns = decimation // common  # offset + step * j is a multiple of the decimation for one j of so many
    j = -(offset // common) * pow(step // common, -1, turns) % turns if turns > 1 else 0
    return offset + step * (j or turns)
