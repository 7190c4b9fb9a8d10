"""Recorded signals, metrics and baseline of a scenario against the signals of its FMUs."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping
from math import gcd, lcm

from gapsense.cosim.fmu.descriptions import Descriptions, Variable
from gapsense.cosim.result.metrics import KINDS
from gapsense.cosim.scenario.elements import Component
from gapsense.cosim.scenario.records import Metric, Scenario
from gapsense.cosim.scenario.signals import matching, recorded_signals, signals
from gapsense.problems import suggest

SLACK = 1e-9  # of a base step, as when the metric is computed
UNKNOWN = 4e9  # bytes, of a machine that does not tell


def check_record(scenario: Scenario, descriptions: Descriptions, knows_times: bool = True) -> Iterator[str]:
    """Problems with what is recorded and with what is made of it; all components must have a description."""
    recorded = recorded_signals(scenario, descriptions)
    yield from unmatched(scenario.record.signals, signals(descriptions), "record.signals")
    if knows_times:
        yield from check_size(scenario, len(recorded), memory())
    for metric in scenario.metrics:
        yield from metric_problems(metric, recorded, descriptions)
        if metric.event is not None and metric.event not in scenario.events:
            known = suggest(metric.event, scenario.events)
            yield f"metrics.{metric.name}.event: there is no event `{metric.event}`. {known}"
        if knows_times:
            yield from check_window(metric, scenario)
    yield from unmatched(scenario.baseline.signals or (), recorded, "baseline.signals")
    yield from unmatched(scenario.baseline.tolerances, recorded, "baseline.tolerances")


def check_size(scenario: Scenario, signals: int, most: float) -> Iterator[str]:
    """Problem of a record that does not fit into the memory."""
    rows = scenario.experiment.count // scenario.record.decimation + 1
    size = 8.0 * rows * (signals + 1)
    if size > most:
        found = f"{rows} rows of {signals} signals are {size / 1e9:.3g} GB, at most {most / 1e9:.3g} GB are kept"
        yield f"record: {found}, half the memory. Record fewer signals, or raise `decimation`."


def memory() -> float:
    """Half of the memory of this machine, where it can be asked [bytes]."""
    try:
        return 0.5 * os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, OSError, ValueError):
        return UNKNOWN


def unmatched(patterns: Iterable[str], names: Iterable[str], place: str) -> Iterator[str]:
    """Problem of each pattern that matches nothing."""
    for pattern in patterns:
        if not matching([pattern], names):
            yield f"{place}: `{pattern}` matches no input or output. {suggest(pattern, names)}"


def metric_problems(metric: Metric, recorded: Mapping[str, Variable], descriptions: Descriptions) -> Iterator[str]:
    """Problems of one metric: signals recorded, reference known, times in seconds, units equal."""
    place = f"metrics.{metric.name}"
    for key, signal in {"signal": metric.signal, "where": metric.where, "time": metric.time}.items():
        if signal is not None and signal not in recorded:
            yield f"{place}.{key}: {not_recorded(signal, recorded, descriptions)}"
    units = {name: variable.unit for name, variable in recorded.items() if variable.unit}
    if units.get(metric.time or "", "s") != "s":
        yield f"{place}.time: `{metric.time}` is in {units[metric.time or '']}, s expected. Correct the name."
    name = metric.reference
    if not isinstance(name, str):
        return
    is_axis = KINDS[metric.kind].reference == "axis"
    target = recorded.get(name) or (None if is_axis else parameter(name, descriptions))
    if target is None:
        yield f"{place}.reference: {not_recorded(name, recorded, descriptions)}"
    elif target.unit and not is_axis and units.get(metric.signal, target.unit) != target.unit:
        pair = f"{metric.signal} [{units[metric.signal]}] is compared with {name} [{target.unit}]"
        yield f"{place}: {pair}: units differ. Correct the reference."


def not_recorded(name: str, recorded: Iterable[str], descriptions: Descriptions) -> str:
    """Sentence for a signal that the run does not record."""
    if name in signals(descriptions):
        return f"`{name}` is not recorded. Add it to `record.signals`."
    return f"unknown signal `{name}`. {suggest(name, recorded)}"


def parameter(name: str, descriptions: Descriptions) -> Variable | None:
    """The numeric parameter called `component.parameter`, if there is one."""
    component, _, own = name.partition(".")
    variable = descriptions[component].variables.get(own) if component in descriptions else None
    return variable if variable and variable.is_parameter and variable.type in ("Real", "Integer") else None


# Whether the window of a metric has samples: recorded rows at which the component of its signal has just stepped.


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
            f"{place}: `{component.name}` never steps at a recorded row: its step is {component.step}, its "
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
