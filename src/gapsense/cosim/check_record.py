"""Recorded signals, metrics and baseline of a scenario against the signals of its FMUs."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from gapsense.cosim.descriptions import Descriptions, Variable
from gapsense.cosim.metrics import KINDS
from gapsense.cosim.scenario import Metric, Scenario
from gapsense.cosim.signals import matching, recorded_signals, signals
from gapsense.problems import suggest


def check_record(scenario: Scenario, descriptions: Descriptions) -> Iterator[str]:
    """Problems with what is recorded and with what is made of it; all components must have a description."""
    recorded = recorded_signals(scenario, descriptions)
    yield from unmatched(scenario.record.signals, signals(descriptions), "record.signals")
    for metric in scenario.metrics:
        yield from MetricCheck(metric, recorded, descriptions).problems()
    yield from unmatched(scenario.baseline.signals or (), recorded, "baseline.signals")
    yield from unmatched(scenario.baseline.tolerances, recorded, "baseline.tolerances")


def unmatched(patterns: Iterable[str], names: Iterable[str], place: str) -> Iterator[str]:
    """Problem of each pattern that matches nothing."""
    for pattern in patterns:
        if not matching([pattern], names):
            yield f"{place}: `{pattern}` matches no input or output. {suggest(pattern, names)}"


class MetricCheck:
    """The checks of one metric: signals recorded, reference known, units equal."""

    def __init__(self, metric: Metric, recorded: Mapping[str, Variable], descriptions: Descriptions) -> None:
        self.metric, self.recorded, self.descriptions = metric, recorded, descriptions

    def problems(self) -> Iterator[str]:
        """All problems, each with its place."""
        names = {"signal": self.metric.signal, "where": self.metric.where, "time": self.metric.time}
        for key, name in names.items():
            if name is not None and name not in self.recorded:
                yield f"metrics.{self.metric.name}.{key}: {self.not_recorded(name)}"
        yield from self.time()
        yield from self.reference()

    def not_recorded(self, name: str) -> str:
        """Sentence for a signal that the run does not record."""
        if name in signals(self.descriptions):
            return f"`{name}` is not recorded. Add it to `record.signals`."
        return f"unknown signal `{name}`. {suggest(name, self.recorded)}"

    def time(self) -> Iterator[str]:
        """The signal that gives the time is in seconds."""
        unit = self.unit(self.metric.time)
        if unit not in (None, "s"):
            yield f"metrics.{self.metric.name}.time: `{self.metric.time}` is in {unit}, s expected. Correct the name."

    def unit(self, name: str | None) -> str | None:
        """Unit of a recorded signal, if it is one and has one."""
        variable = None if name is None else self.recorded.get(name)
        return variable.unit if variable else None

    def reference(self) -> Iterator[str]:
        """The reference is recorded or a parameter, and of the unit of the signal."""
        name = self.metric.reference
        if not isinstance(name, str):
            return
        target, unit = self.recorded.get(name), self.unit(self.metric.signal)
        is_axis = KINDS[self.metric.kind].reference == "axis"
        target = target if is_axis else target or self.parameter(name)
        if target is None:
            yield f"metrics.{self.metric.name}.reference: {self.not_recorded(name)}"
        elif target.unit and unit and target.unit != unit and not is_axis:
            yield (
                f"metrics.{self.metric.name}: {self.metric.signal} [{unit}] is compared with {name} [{target.unit}]: "
                "units differ. Correct the reference."
            )

    def parameter(self, name: str) -> Variable | None:
        """The numeric parameter called `component.parameter`, if there is one."""
        component, _, parameter = name.partition(".")
        description = self.descriptions.get(component)
        variable = description.variables.get(parameter) if description else None
        is_number = variable is not None and variable.is_parameter and variable.type in ("Real", "Integer")
        return variable if is_number else None
