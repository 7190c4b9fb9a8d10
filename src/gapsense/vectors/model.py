"""A scenario as loop.c takes it: what each number of a block is, and which component acts when."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

from gapsense.cosim.run.part import Layout
from gapsense.cosim.run.recording import Subject, shape
from gapsense.cosim.scenario.records import Component, ports, texts
from gapsense.fmi.ports import Component as PortTable
from gapsense.fmi.steps import samples_due
from gapsense.fmi.values import fields
from gapsense.tables import Value
from gapsense.vectors import library
from gapsense.vectors.library import (
    Functions,
    Places,
    Room,
    entries_of,
    fill_structure,
    functions,
    ints,
    places,
    structure,
)

KNOWN = 256  # sets of values of a component that are remembered
STAGE = 4  # numbers of a stage that differ between runs
WATCH = 3


class Member(NamedTuple):
    """A component of the scenario, and its places."""

    component: Component
    places: Places


class Model:
    """The structures of a scenario; `periods` are those of its components' samples [s], in order, 0 where none are."""

    def __init__(self, subject: Subject, periods: Sequence[float]) -> None:
        self.subject, self.scenario = subject, subject.scenario
        self.periods = dict(zip(subject.order.names, periods))
        self.experiment = self.scenario.experiment
        descriptions = subject.descriptions
        self.layout = Layout(ports(descriptions), texts(descriptions), subject.prepare_events(self.scenario.events))
        self.room = Room(self.layout.size)
        self.stages = {name: self.room.take(STAGE) for name in self.layout.slots}
        self.conditions = {name: self.room.take(WATCH) for name, e in self.layout.events.items() if e.when}
        self.failed = self.room.take(1)
        self.members = [self.member(self.scenario.components[name]) for name in subject.order.names]
        self.structures = (library.Part * len(self.members))(*map(self.part, self.members))
        self.loop = self.whole()
        self.known_entries = lru_cache(KNOWN)(known_entries)

    def entries(self, member: Member, given: Mapping[str, Value]) -> Sequence[Any]:
        """Entries of the parameters of a component with some values; those that many runs share are made once."""
        found = member.places.functions
        own = tuple(of_parameters(found.component, given).items())
        return self.known_entries(found, own, repr(own))

    def member(self, component: Component) -> Member:
        """A component with its places. With Jacobi, the inputs it has taken may differ from those in the buffer."""
        found = functions(self.subject.descriptions[component.name].name)
        assert found is not None
        inputs, outputs = (self.layout.of(component.name, causality) for causality in ("input", "output"))
        buffered, output = (self.layout.index[p[0]] if p else 0 for p in (inputs, outputs))
        own = self.room.take(len(inputs)) if self.experiment.method == "jacobi" else buffered
        return Member(component, places(found, self.room, buffered, own, output))

    def part(self, member: Member) -> Any:
        """Structure of a part."""
        component = member.component
        wires = self.layout.wires(self.scenario.connections, component.name)
        slots = self.layout.slots_of(component.name)
        places = {name: range(self.stages[name], self.stages[name] + STAGE) for name in slots}
        stages = [library.Stage(*slot, *places[name]) for name, slot in slots.items()]
        duration, period = component.step * self.experiment.base_step, self.periods[component.name]
        played = {port.component for port in self.scenario.played}
        return structure(
            member.places,
            period or duration,
            links=[library.Link(*wire) for wire in wires],
            stages=stages,
            follows=bool(wires or stages or component.name in played),
            duration=duration,
            samples=self.samples(component, duration, period),
            every=component.step,
            offset=component.offset,
        )

    def samples(self, component: Component, duration: float, period: float) -> Any:
        """How many samples fall due in each step; None if it is always one, at the end of the step."""
        if not period or period == duration:
            return None
        start, base, elapsed, found = self.experiment.start, self.experiment.base_step, 0.0, []
        for k in range(component.offset, self.experiment.count - component.step + 1, component.step):
            count, elapsed = samples_due(start + k * base + duration, duration, period, elapsed)
            found.append(count)
        return ints(found)

    def whole(self) -> Any:
        """Structure of the scenario."""
        experiment, decimation = self.experiment, self.scenario.record.decimation
        columns = [*self.subject.columns]
        watches = [
            library.Watch(self.layout.index[e.when.signal], e.when.is_above, *range(first, first + WATCH))
            for name, first in self.conditions.items()
            if (e := self.layout.events[name]).when
        ]
        return fill_structure(
            library.Loop,
            parts=self.structures,
            part_count=len(self.members),
            start=experiment.start,
            base_step=experiment.base_step,
            is_jacobi=experiment.method == "jacobi",
            decimation=decimation,
            rows=shape(self.scenario, columns)[0],
            columns=columns,
            places=[self.layout.inlets[port] for port in self.scenario.played],
            watches=watches,
            failed=self.failed,
        )


def of_parameters(component: PortTable, given: Mapping[str, Value]) -> dict[str, Value]:
    """Those of some values that are of parameters."""
    named = {port.name for port in component.of("parameter")}
    return {name: value for name, value in given.items() if name in named}


def known_entries(found: Functions, given: tuple[tuple[str, Value], ...], _: object) -> Sequence[Any]:
    """Entries of parameters, checked, with their tables read; a text tells 1 and true, 0.0 and -0.0 apart."""
    return entries_of(found, fields(found.component, dict(given), found.folder))
