"""A scenario as loop.c takes it: which number of a block stands for what, and who acts when."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any, NamedTuple

from gapsense.cosim.elements import Component
from gapsense.cosim.events.event import Event, resolved
from gapsense.cosim.part import Layout
from gapsense.cosim.signals import ports, texts
from gapsense.cosim.subject import Subject
from gapsense.fmi.steps import samples_due
from gapsense.vectors import library
from gapsense.vectors.library import Functions, functions, ints
from gapsense.vectors.places import Room, places, ranges

STAGE = 4  # numbers of a stage that differ between runs
WATCH = 3


class Placed(NamedTuple):
    """A component of the scenario: where its inputs are in the buffer, and the rest as in `Places`."""

    component: Component
    buffered: int  # first input in the buffer
    functions: Functions
    own: int  # first input that it has taken
    output: int
    time: int
    par: list[int]
    tables: dict[int, int]
    calls: list[Any]


class Model:
    """The structures of a scenario; `periods` are those of its components' samples [s], in order, 0 where none are."""

    def __init__(self, subject: Subject, periods: Sequence[float]) -> None:
        self.subject, self.scenario = subject, subject.scenario
        self.periods = dict(zip(subject.order.names, periods))
        self.experiment = self.scenario.experiment
        descriptions = subject.descriptions
        self.layout = Layout(ports(descriptions), texts(descriptions), self.resolved(self.scenario.events))
        self.room = Room(self.layout.size)
        self.stages = {name: self.room.take(STAGE) for name in self.layout.slots}
        self.conditions = {name: self.room.take(WATCH) for name, e in self.layout.events.items() if e.when}
        self.failed = self.room.take(1)
        self.parts = [self.placed(self.scenario.components[name]) for name in subject.order.names]
        self.structures = (library.Part * len(self.parts))(*map(self.part, self.parts))
        self.loop = self.whole()

    def resolved(self, events: Mapping[str, Event]) -> dict[str, Event]:
        """Events with one target each."""
        return resolved(events, self.scenario.connections)

    def placed(self, component: Component) -> Placed:
        """Places of a part; with Jacobi what it has taken may differ from what is in the buffer."""
        found = functions(self.subject.descriptions[component.name].name)
        assert found is not None
        inputs, outputs = (self.layout.of(component.name, causality) for causality in ("input", "output"))
        buffered, output = (self.layout.index[p[0]] if p else 0 for p in (inputs, outputs))
        own = self.room.take(len(inputs)) if self.experiment.method == "jacobi" else buffered
        return Placed(component, buffered, *places(found, self.room, own, output))

    def part(self, p: Placed) -> Any:
        """Structure of a part."""
        component, port_table = p.component, p.functions.component
        initial, constants, advance = p.calls
        links, stages = self.links(component), self.stages_of(component)
        spans = ranges(port_table, p.own)
        duration, period = component.step * self.experiment.base_step, self.periods[component.name]
        samples = self.samples(component, duration, period)
        played = {port.component for port in self.scenario.played}
        return library.Part(
            constants=constants,
            initial=initial,
            advance=advance,
            links=links,
            link_count=len(links),
            stages=stages,
            stage_count=len(stages),
            ranges=spans,
            range_count=len(spans),
            survives=port_table.survives,
            follows=bool(len(links) or len(stages) or component.name in played),
            buffered=p.buffered,
            own=p.own,
            input_count=len(port_table.of("input")),
            output=p.output,
            output_count=len(port_table.of("output")),
            time=p.time,
            dt=p.time + 1,
            duration=duration,
            period=period or duration,
            samples=samples,
            every=component.step,
            offset=component.offset,
        )

    def links(self, component: Component) -> Any:
        """Connections into a part, those that convert last."""
        found = [c for c in self.scenario.connections if c.target.component == component.name]
        return (library.Link * len(found))(
            *(
                library.Link(
                    target=self.layout.inlets[c.target],
                    source=self.layout.index[c.source],
                    converts=c.converts,
                    factor=1.0 if c.factor is None else c.factor,
                    bias=c.bias or 0.0,
                )
                for c in sorted(found, key=lambda c: c.converts)
            )
        )

    def stages_of(self, component: Component) -> Any:
        """What events do to inputs of a part."""
        slots, events = self.layout.slots, self.layout.events
        own = [name for name in slots if events[name].target.component == component.name]
        found = [library.Stage(*slots[name], *range(self.stages[name], self.stages[name] + STAGE)) for name in own]
        return (library.Stage * len(found))(*found)

    def samples(self, component: Component, duration: float, period: float) -> Any:
        """How many samples fall due in each step; none where it is always one, at its end."""
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
        columns = ints(self.subject.columns)
        played = ints(self.layout.inlets[port] for port in self.scenario.played)
        watches = [
            library.Watch(self.layout.index[e.when.signal], e.when.is_above, *range(first, first + WATCH))
            for name, first in self.conditions.items()
            if (e := self.layout.events[name]).when
        ]
        return library.Loop(
            parts=self.structures,
            part_count=len(self.parts),
            start=experiment.start,
            base_step=experiment.base_step,
            is_jacobi=experiment.method == "jacobi",
            decimation=decimation,
            rows=self.rows,
            columns=columns,
            column_count=len(columns),
            places=played,
            place_count=len(played),
            watches=(library.Watch * len(watches))(*watches),
            watch_count=len(watches),
            failed=self.failed,
        )

    @cached_property
    def rows(self) -> int:
        """Rows that a run records."""
        return self.experiment.count // self.scenario.record.decimation + 1
