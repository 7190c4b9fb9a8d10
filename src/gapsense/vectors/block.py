"""A few runs at once, as many as a vector of the processor has numbers: values, events, and what is recorded."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from time import perf_counter
from typing import Any

import numpy as np

from gapsense.cosim.run.events import Director
from gapsense.cosim.run.part import Stage, constants, player
from gapsense.cosim.run.recording import Recording, Take, new_marks, shape
from gapsense.cosim.scenario.read import vary_events
from gapsense.fmi.values import ValuesError
from gapsense.fmi.values import problems as refused
from gapsense.kernels.lanes.plan import columns_in_c
from gapsense.kernels.layout import names
from gapsense.problems import FmuError
from gapsense.tables import Value
from gapsense.vectors import library
from gapsense.vectors.library import aligned_zeros, table
from gapsense.vectors.model import Member, Model, of_parameters

Values = Mapping[str, Value]


class RunPart:
    """A part as the events of one run see it."""

    def __init__(self, block: Block, place: int, lane: int) -> None:
        self.block, self.place, self.lane = block, place, lane
        self.component, self.places = block.model.members[place]
        self.stages = {name: Stage(slot) for name, slot in block.model.layout.slots_of(self.component.name).items()}
        self.instance = self  # whose parameters events change

    def change(self, name: str, value: Value) -> None:
        """Set a tunable parameter during the run; FmuError if the component would refuse that."""
        given = self.block.given[self.lane][self.component.name]
        given[name] = float(value)
        found, table = self.places.functions, self.places.functions.component
        if wrong := refused(table, of_parameters(table, given)):
            raise FmuError(self.component.name, " ".join(wrong))
        field = next(port.field for port in table.of("parameter") if port.name == name)
        entry = names(found.kernel.module.Parameters).index(field)
        self.block.values[self.places.par[entry], self.lane] = value
        self.block.prepare(self.place)


class Block:
    """Runs of a model, one for each of `takes`; at most as many as a vector has numbers.

    `go_on` is called now and then. It may raise an exception, which ends the runs.
    """

    def __init__(self, model: Model, takes: Sequence[Take], go_on: Callable[[], None]) -> None:
        self.model, self.takes, self.go_on, self.c = model, takes, go_on, library.loop()
        self.width, self.count = self.c.width(), len(takes)
        self.values = aligned_zeros(model.room.size, self.width)
        self.data = np.empty((self.count, *reversed(shape(model.scenario, model.subject.columns))))
        self.arrays = [np.zeros((size, self.width)) for size in model.room.memories]
        self.given: list[dict[str, dict[str, Value]]] = []
        self.directors: list[Director] = []
        self.player = player(model.scenario.played, model.layout.inlets, model.experiment)
        self.runs = library.Runs(count=self.count, v=self.values.ctypes.data, data=self.data.ctypes.data)

    def run(self) -> list[Recording | None]:
        """What each run recorded; nothing of one that is lost."""
        begun = perf_counter()
        self.initialize()
        self.proceed()
        lost, wall = self.values[self.model.failed], (perf_counter() - begun) / self.count
        return [None if lost[lane] else self.recording(lane, wall) for lane in range(self.count)]

    def lose(self, lane: int) -> None:
        """Give up a run that would fail through FMUs, or whose parameters do not fit those of the others."""
        self.values[self.model.failed, lane] = 1.0

    def prepare(self, place: int) -> None:
        """Compute what steps of a part need of its parameters."""
        self.c.prepare(self.model.structures[place], self.runs)

    # --- start ---

    def initialize(self) -> None:
        """Bring all runs to their start, in the order of `Master.initialize`."""
        self.parametrize()
        self.direct()
        self.start_inputs()
        for place, structure in enumerate(self.model.structures):
            self.prepare(place)
            self.c.begin(self.model.loop, self.runs, structure, False)
        self.connect_inputs()
        for structure in self.model.structures:
            self.c.begin(self.model.loop, self.runs, structure, True)

    def parametrize(self) -> None:
        """Set all parameters; a run with values that a component does not take is lost."""
        for lane, take in enumerate(self.takes):
            given = {member.component.name: given_of(member, take, self.model) for member in self.model.members}
            self.given.append(given)
            try:
                for member in self.model.members:
                    self.set_parameters(member, lane)
            except (ValuesError, OSError):
                self.lose(lane)
        self.runs.columns = columns_in_c(self.arrays)

    def set_parameters(self, member: Member, lane: int) -> None:
        """Numbers and tables of a part's kernel; a table that is longer or shorter than the others' loses the run."""
        at, given = member.places, self.given[lane][member.component.name]
        for k, entry in enumerate(self.model.entries(member, given)):
            if k not in at.tables:
                self.values[at.par[k], lane] = entry
            elif lane == 0:
                self.arrays[at.tables[k]] = table(entry, self.width)
            elif len(entry) == len(self.arrays[at.tables[k]]):
                self.arrays[at.tables[k]][:, lane] = entry
            else:
                self.lose(lane)

    def direct(self) -> None:
        """Prepare the events of each run."""
        model, marks = self.model, new_marks()
        for lane, take in enumerate(self.takes if model.layout.events else ()):
            problems: list[str] = []
            parts: Any = [RunPart(self, place, lane) for place in range(len(model.members))]
            events = model.subject.prepare_events(vary_events(model.scenario.events, take.values, problems))
            if problems:
                self.lose(lane)
            view = self.values[:, lane]
            self.directors.append(
                Director(
                    events=events,
                    experiment=model.experiment,
                    parts=parts,
                    places=model.layout,
                    buffer=view,
                    seeds=take.seeds,
                    marks=marks,
                )
            )

    def start_inputs(self) -> None:
        """Set the inputs that components have before anything is connected."""
        for component, at in self.model.members:
            for k, port in enumerate(at.functions.component.of("input"), at.own):
                for lane in range(self.count):
                    self.values[k, lane] = self.given[lane][component.name].get(port.name, port.start or 0.0)
        self.alike()

    def connect_inputs(self) -> None:
        """Give inputs what the scenario says from now on: constants, signals, outputs that drive them."""
        model = self.model
        for _, at in model.members:
            self.values[at.buffered : at.buffered + len(at.functions.component.of("input"))] = 0.0
        for lane, take in enumerate(self.takes):
            for inlet, value in constants(model.scenario, model.subject.descriptions, take.values).items():
                self.values[model.layout.inlets[inlet], lane] = float(value)
            if self.directors:
                self.pass_events(lane)
        self.alike()
        self.provide(0)
        self.c.play_first(model.loop, self.runs)

    def alike(self) -> None:
        """Give places of the vector without a run what the first run has, for nothing to be odd there."""
        self.values[:, self.count :] = self.values[:, :1]

    # --- base steps ---

    def proceed(self) -> None:
        """Do base step after base step until the end. In between, events are prepared for the next one."""
        count = self.model.experiment.count
        self.parameters = [dict(parameters_of(self.model, given)) for given in self.given]
        for director, parameters in zip(self.directors, self.parameters):
            director.begin(parameters)
        done = self.advance(0)
        self.turn(done, is_first=True)
        while done < count:
            limits = (director.limit for director in self.directors)
            done = self.advance(min([count, *limits]))
            if done < count:
                self.turn(done)

    def advance(self, until: int) -> int:
        """Base steps up to the given one; the last one that was done."""
        self.go_on()
        self.c.advance(self.model.loop, self.runs, min(until, self.provide(self.runs.next)))
        return int(self.runs.next) - 1

    def provide(self, k: int) -> int:
        """Compute the values of played signals from a base step on. Returns the last base step that has values."""
        last = self.player.provide(k)
        self.runs.played, self.runs.played_from = self.player.block.ctypes.data, self.player.begin
        return last

    def turn(self, done: int, is_first: bool = False) -> None:
        """Prepare the events of the runs that have some now."""
        lost = self.values[self.model.failed]
        for lane, director in enumerate(self.directors):
            if lost[lane] or not (is_first or done == director.limit or director.has_news()):
                continue
            try:
                director.turn(done)
            except FmuError:
                self.lose(lane)
                director.limit = self.model.experiment.count
            self.pass_events(lane)

    def pass_events(self, lane: int) -> None:
        """Tell C what the events of a run do."""
        director, model = self.directors[lane], self.model
        for name, stage in director.stages.items():
            now = (stage.source == stage.slot.held, stage.converts, stage.factor, stage.bias)
            self.values[model.stages[name] : model.stages[name] + len(now), lane] = now
        for name, first in model.conditions.items():
            watch = director.actors[name].watch
            if watch:
                self.values[first : first + 3, lane] = watch.is_on, watch.holds, watch.level

    # --- end ---

    def recording(self, lane: int, wall: float) -> Recording:
        """What a run leaves behind."""
        data, count = self.data[lane].T, self.model.experiment.count
        found = Recording(data, rows=len(data), parameters=self.parameters[lane], wall=wall)
        found.start(len(self.model.members))
        found.calls = [(count - component.offset) // component.step for component, _ in self.model.members]
        if self.directors:
            found.events = self.directors[lane].happened
        return found


def given_of(member: Member, take: Take, model: Model) -> dict[str, Value]:
    """Values of parameters and inputs that a component of a run is given before its initialization."""
    component, description = member.component, model.subject.descriptions[member.component.name]
    own: dict[str, Value] = {"seed": take.seeds[component.name]} if component.name in take.seeds else {}
    own |= {port.variable: value for port, value in take.values.items() if port.component == component.name}
    variables = {name: description.variables[name] for name in (*component.values, *own)}
    values = {name: variables[name].number(value) for name, value in {**component.values, **own}.items()}
    return {name: float(value) if variables[name].type == "Real" else value for name, value in values.items()}


def parameters_of(model: Model, given: Mapping[str, Values]) -> Iterator[tuple[str, Value]]:
    """Values of all parameters, as they would be read back."""
    for component, _ in model.members:
        own = given[component.name]
        for v in model.subject.descriptions[component.name].of("parameter"):
            yield f"{component.name}.{v.name}", own.get(v.name, 0.0 if v.start is None else v.start)
