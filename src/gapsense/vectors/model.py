"""A scenario as loop.c takes it: which number of a block stands for what, and who acts when."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from math import inf
from typing import Any, NamedTuple

from gapsense.cosim.elements import Component
from gapsense.cosim.events.event import Event, resolved
from gapsense.cosim.part import Layout
from gapsense.cosim.signals import ports, texts
from gapsense.cosim.subject import Subject
from gapsense.emit.lanes import held, is_array
from gapsense.fmi.steps import samples_due
from gapsense.lanes import Code
from gapsense.records import fields, names
from gapsense.vectors import library
from gapsense.vectors.library import Functions, functions, ints

STAGE = 4  # numbers of a stage that differ between runs
WATCH = 3


class Places(NamedTuple):
    """Where the numbers of a part are in a block, and its arrays among the columns."""

    component: Component
    functions: Functions
    buffered: int  # first input in the buffer
    own: int  # first input that the part has taken
    output: int  # first output
    time: int
    par: list[int]  # of each entry of its parameters
    tables: dict[int, int]  # column of each entry of its parameters that is a table
    calls: list[Any]


class Model:
    """The structures of a scenario; `periods` are those of its components' samples [s], in order, 0 where none are."""

    def __init__(self, subject: Subject, periods: Sequence[float]) -> None:
        self.subject, self.scenario = subject, subject.scenario
        self.periods = dict(zip(subject.order.names, periods))
        self.experiment = self.scenario.experiment
        descriptions = subject.descriptions
        self.layout = Layout(ports(descriptions), texts(descriptions), self.resolved(self.scenario.events))
        self.room = self.layout.size
        self.memories: list[int] = []  # numbers in each column that is array memory; 0 for a table
        self.stages = {name: self.take(STAGE) for name in self.layout.slots}
        self.conditions = {name: self.take(WATCH) for name, e in self.layout.events.items() if e.when}
        self.failed = self.take(1)
        self.parts = [self.placed(self.scenario.components[name]) for name in subject.order.names]
        self.structures = (library.Part * len(self.parts))(*map(self.part, self.parts))
        self.loop = self.whole()

    def resolved(self, events: Mapping[str, Event]) -> dict[str, Event]:
        """Events with one target each."""
        return resolved(events, self.scenario.connections)

    def take(self, count: int) -> int:
        """First of so many places that nobody had."""
        self.room += count
        return self.room - count

    def column(self, size: int) -> int:
        """A new column; array memory has a size."""
        self.memories.append(size)
        return len(self.memories) - 1

    def placed(self, component: Component) -> Places:
        """Places of a part."""
        found = functions(self.subject.descriptions[component.name].name)
        assert found is not None
        inputs, outputs = (self.layout.of(component.name, causality) for causality in ("input", "output"))
        buffered, output = (self.layout.index[p[0]] if p else 0 for p in (inputs, outputs))
        own = self.take(len(inputs)) if self.experiment.method == "jacobi" else buffered
        time = self.take(2)
        module = found.kernel.module
        clock = [name for name in ("time", "dt") if name in fields(module.Inputs)]
        given = [*(time + ("time", "dt").index(name) for name in clock), *range(own, own + len(inputs))]
        kinds = fields(module.Parameters)
        entries = names(module.Parameters)
        par = [self.column(0) if n in kinds and kinds[n].kind == "table" else self.take(1) for n in entries]
        tables = {k: par[k] for k, n in enumerate(entries) if n in kinds and kinds[n].kind == "table"}
        state = [self.of_state(entry) for entry in results(found.codes.initial)[: len(names(module.State))]]
        made = [*state, *range(output, output + len(outputs))]
        constants = [*self.of_constants(found.codes.constants, par)]
        calls = [
            called(found, 0, [*given, *par], made),
            called(found, 1, par, constants),
            called(found, 2, [*state, *given, *constants], made),
        ]
        return Places(
            component=component,
            functions=found,
            buffered=buffered,
            own=own,
            output=output,
            time=time,
            par=par,
            tables=tables,
            calls=calls,
        )

    def of_state(self, entry: Any) -> int:
        """Place of an entry of a state."""
        return self.column(len(entry)) if isinstance(entry, list) else self.take(1)

    def of_constants(self, code: Code, par: Sequence[int]) -> Iterator[int]:
        """Places of what a step needs of the parameters; a table stays where it is."""
        taken = {symbol.id: place for symbol, place in zip(code.symbols, par)}
        for entry in results(code):
            table = held(entry)
            yield taken[table.id] if table is not None else self.take(1)

    def part(self, p: Places) -> Any:
        """Structure of a part."""
        component, port_table = p.component, p.functions.component
        initial, constants, advance = p.calls
        links, stages = self.links(component), self.stages_of(component)
        spans = self.ranges(p)
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

    def ranges(self, p: Places) -> Any:
        """Inputs of a part that have a range."""
        ports = () if p.functions.component.survives else p.functions.component.of("input")
        found = [(k, port) for k, port in enumerate(ports, p.own) if (port.min, port.max) != (None, None)]
        return (library.Range * len(found))(
            *(
                library.Range(k, -inf if port.min is None else port.min, inf if port.max is None else port.max)
                for k, port in found
            )
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


def results(code: Code) -> list[Any]:
    """Entries of all that a function returns."""
    return [entry for _, row in code.graph.results for entry in row]


def called(found: Functions, which: int, taken: Sequence[int], made: Sequence[int]) -> Any:
    """A call of C of a function; arrays that it returns stay where they are."""
    code: Code = found.codes[which]
    at = ints([*taken, *(place for entry, place in zip(results(code), made) if not is_array(entry))])
    return library.Call(found.addresses[which], at, code.c.constants.ctypes.data_as(library.Doubles))
