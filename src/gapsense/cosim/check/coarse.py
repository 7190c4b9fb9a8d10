"""What a time grid is too coarse for: components, what drives them, events. It is told, and the run goes on."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from gapsense._os.files import read_columns
from gapsense.cosim.events.event import Event
from gapsense.cosim.fmu.descriptions import Description, Descriptions
from gapsense.cosim.scenario.elements import Component, Experiment
from gapsense.cosim.scenario.input_signals import Played
from gapsense.cosim.scenario.records import Scenario
from gapsense.parameters import is_file
from gapsense.tables import Value, is_number

FEW = 10  # base steps of a run, and rows of a record
ABOVE = 5.0  # steps of a component that are so many times its own are told
WITHIN = {"s": 10.0, "Hz": 1.0}  # steps that a period has, and one of a frequency, which drives give as means
PULSE = 0.25  # of the span of a signal: what rises so far between two steps is told
ROUNDING = 1e-9
ASKED = "Is `base_step` as it should be?"


def remarks(scenario: Scenario, descriptions: Descriptions) -> list[str]:
    """Sentences on what falls between the steps of a scenario that has no problems."""
    experiment = scenario.experiment
    told = [*few(experiment, scenario.record.decimation)]
    for name, component in scenario.components.items():
        told += own_step(component, descriptions[name], experiment)
        told += periods(component, descriptions[name], experiment)
    for port, played in scenario.played.items():
        told += pulses(f"inputs.{port}", played, experiment, experiment.base_step)
    for event in scenario.events.values():
        told += short(event, scenario)
    return told


def few(experiment: Experiment, decimation: int) -> Iterator[str]:
    """That a run has few steps, or its record few rows."""
    rows = experiment.count // decimation + 1
    if experiment.count < FEW:
        yield f"experiment: the run has {experiment.count} base steps, too few to show much. {ASKED}"
    elif rows < FEW:
        yield f"record: {rows} rows are recorded, too few to show much. Is `decimation` as it should be?"


def own_step(component: Component, description: Description, experiment: Experiment) -> Iterator[str]:
    """That a component steps much longer than it is made for: than its samples, or than its default experiment."""
    variable, step = description.variables.get("sample_time"), component.step * experiment.base_step
    given = component.values.get("sample_time", variable.start if variable else None)
    what, own = "`sample_time`", float(given or 0.0) if is_number(given) else 0.0
    if own <= 0.0 and description.step_size:
        what, own = "the step of its FMU's default experiment", description.step_size
    if own > 0.0 and step > ABOVE * own * (1.0 + ROUNDING):
        yield (
            f"components.{component.name}: its step is {step:.9g} s, {step / own:.4g} times {what}, {own:.9g} s: what "
            f"happens between is lost. {ASKED}"
        )


def periods(component: Component, description: Description, experiment: Experiment) -> Iterator[str]:
    """Periods and pulses of what a component generates that its steps do not resolve."""
    step = component.step * experiment.base_step
    values: dict[str, Value] = {v.name: v.start for v in description.of("parameter") if v.start is not None}
    values.update(component.values)
    ports = {port.name: port for port in description.rules.ports} if description.rules else {}
    choices = {choice: values.get(p.name) == choice for p in ports.values() for choice in p.choices}
    for variable in description.of("parameter"):
        name, value = variable.name, values.get(variable.name)
        group, _, last = name.rpartition(".")
        if not choices.get(group.partition(".")[0], True):  # of what is not chosen
            continue
        word = {"s": "period", "Hz": "frequency"}.get(variable.unit or "")
        if word and last.endswith(word) and is_number(value) and float(value or 0.0) > 0.0:
            period = float(value or 0.0) if word == "period" else 1.0 / float(value or 1.0)
            if period < WITHIN[variable.unit or ""] * step * (1.0 - ROUNDING):
                yield (
                    f"components.{component.name}: `{name}` is {value} {variable.unit}, a period of {period:.9g} s, and"
                    f" its step {step:.9g} s: its changes fall between two steps. {ASKED}"
                )
        columns = ports[name].columns if name in ports else ()
        if columns and isinstance(value, str) and name in component.values and is_file(name, value):
            yield from of_table(f"components.{component.name}.{name}", value, columns[0], experiment, step)


def of_table(place: str, file: str, first: str, experiment: Experiment, step: float) -> Iterator[str]:
    """Pulses of a table over time."""
    if not first.startswith("time"):
        return
    try:
        columns = read_columns(Path(file))
    except (OSError, ValueError):  # which the FMU tells
        return
    times = columns.pop("time", np.empty(0))
    for values in columns.values():
        yield from pulses(place, Played(times, values), experiment, step)


def pulses(place: str, played: Played, experiment: Experiment, step: float) -> Iterator[str]:
    """Samples of a signal that no step comes near: a pulse between two steps."""
    is_inside = (played.times > experiment.start) & (played.times < experiment.stop)
    times, values = played.times[is_inside], played.values[is_inside]
    if not times.size or not (span := float(np.ptp(played.values))) > 0.0:
        return
    before = np.floor((times - experiment.start) / step + ROUNDING)
    slack = ROUNDING * step
    ends = [played.at(experiment.start + (before + k) * step, slack) for k in (0, 1)]
    far = np.maximum(values - np.maximum(*ends), np.minimum(*ends) - values) > PULSE * span
    if far.any():
        yield (
            f"{place}: {int(far.sum())} samples, the first at {times[np.argmax(far)]:.9g} s, lie in pulses between two "
            f"steps of {step:.9g} s, so no component sees them. {ASKED}"
        )


def short(event: Event, scenario: Scenario) -> Iterator[str]:
    """An event that is over before the component of its target steps, or before a row is recorded."""
    experiment, component = scenario.experiment, scenario.components.get(event.target.component)
    length = event.duration
    if length is None and event.at is not None and event.until is not None:
        length = event.until - event.at
    every = max(component.step if component else 1, scenario.record.decimation) * experiment.base_step
    if event.enabled and length is not None and length < every * (1.0 - ROUNDING):
        yield (
            f"events.{event.name}: it lasts {length:.9g} s, and its target steps or is recorded every {every:.9g} s: "
            "it may be missed. Let it last longer, or step and record more often."
        )
