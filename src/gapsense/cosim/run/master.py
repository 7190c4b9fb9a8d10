"""The co-simulation master: initialise, step on an integer grid, record; one set, step and get per component-step."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import nullcontext, suppress
from dataclasses import replace
from time import perf_counter, sleep
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
import numpy.typing as npt

from gapsense._os.files import sha256
from gapsense._os.processes import Marks
from gapsense.cosim.fmu.descriptions import Description, Descriptions
from gapsense.cosim.fmu.instance import ENDS_WITHIN, Instance, folder_kept, instance_of, unpack_fmu
from gapsense.cosim.fmu.remote import RemoteInstance, RemoteInstance3
from gapsense.cosim.run.events import Director
from gapsense.cosim.run.iterate import start_loop
from gapsense.cosim.run.loop.compiled import advancer
from gapsense.cosim.run.part import Advance, Layout, Part, Texts, Work, constants, place, player
from gapsense.cosim.run.recording import (
    COMPONENT,
    ENDING,
    LOADING,
    MASTER,
    PHASE,
    ROWS,
    STARTING,
    STEP,
    STEPPING,
    STOP,
    Recording,
    Subject,
    new_marks,
    shape,
    varied_events,
)
from gapsense.cosim.scenario.records import (
    ITERATIVE,
    JACOBI,
    Component,
    Event,
    Experiment,
    Port,
    Scenario,
    ports,
    texts,
)
from gapsense.problems import FmuError
from gapsense.tables import Value

if TYPE_CHECKING:
    from gapsense.cosim.run.checkpoint import Keeper

T = TypeVar("T")
Progress = Callable[[int, int], None]
REPORTS = 200  # progress reports per run
Action = tuple[int, Callable[[int], object]]  # what is done every so many base steps, and at the end


class Master:
    """All FMU instances of a scenario, loaded once, run as often as wanted.

    Use it in a `with` statement: at its end all instances are freed.
    """

    def __init__(self, scenario: Scenario, descriptions: Descriptions, marks: Marks | None = None) -> None:
        self.scenario, self.descriptions = scenario, descriptions
        self.subject = Subject(scenario, descriptions)
        self.marks: Marks = new_marks() if marks is None else marks
        self.order = self.subject.order
        delayed = self.order.delayed if scenario.experiment.method == ITERATIVE else ()
        self.places = Layout(
            ports(descriptions), texts(descriptions), self.subject.prepare_events(scenario.events), delayed
        )
        self.loops = [tuple(map(self.order.names.index, loop)) for loop in self.order.loops]
        self.buffer = array("d", [0.0]) * self.places.size
        self.view = np.frombuffer(self.buffer)
        self.texts: Texts = {}
        self.parts: list[Part] = []
        self.links: dict[Any, Any] = {}  # to boards, by place and firmware
        self.director = self.make_director({}, {})
        try:
            self.load()
        except BaseException:
            self.close()
            raise

    def load(self) -> None:
        """Instantiate the components in execution order, wire them."""
        for name in self.each(LOADING, self.order.names):
            component, instance = self.scenario.components[name], self.instance(name)
            self.parts.append(
                Part(component=component, instance=instance, buffer=self.buffer, places=self.places, texts=self.texts)
            )
            self.parts[-1].connect(self.scenario.connections)
            self.delay(self.parts[-1])

    def delay(self, part: Part) -> None:
        """Tell a part which of its inputs have in a step the value at its beginning.

        Of these, two values tell no slope where they come more seldom than they are taken, or events change them.
        """
        every = {JACOBI: self.scenario.connections, ITERATIVE: ()}
        late = every.get(self.scenario.experiment.method, self.order.delayed)
        steps = {name: component.step for name, component in self.scenario.components.items()}
        changed = {event.target for event in self.places.events.values()}
        part.late = {c.target for c in late}
        part.held = {c.target for c in late if c.target in changed or steps[c.source.component] != part.component.step}

    def instance(self, name: str) -> Instance:
        """Instance of a component, in a process of its own if the scenario wants that."""
        description = self.descriptions[name]
        component = self.scenario.components[name]
        if component.board:
            return self.on_board(name, component, description)
        if component.isolation == "process":
            kind = RemoteInstance3 if description.fmi == 3 else RemoteInstance
            return kind(name, description, unpack_fmu(description), self.scenario.experiment.step_limit)
        return instance_of(name, description, unpack_fmu(description))

    def on_board(self, name: str, component: Component, description: Description) -> Instance:
        """A component on its board, which others may share."""
        from gapsense.cosim.fmu.board import OnBoard, OnBoard3  # here, so that others start fast
        from gapsense.cosim.fmu.line import BoardError, Link

        key, limit = (component.board, component.firmware), self.scenario.experiment.step_limit
        try:
            self.links[key] = self.links.get(key) or Link(*key, limit)
        except BoardError as error:
            raise FmuError(name, f"the board `{component.board}` {error}.") from error
        read = {*self.subject.about, *(str(c.source) for c in self.scenario.connections)}
        wanted = {v.name for v in description.of("output") if f"{name}.{v.name}" in read}
        kind = OnBoard3 if description.fmi == 3 else OnBoard
        return kind(name, description, unpack_fmu(description), self.links[key], wanted, component.clock)

    def each(self, phase: int, items: Sequence[T]) -> Iterator[T]:
        """What there is of every component in execution order, with marks that say which one is touched, and why."""
        self.marks[PHASE] = phase
        for number, item in enumerate(items, start=1):
            self.marks[COMPONENT] = number
            yield item
        self.marks[COMPONENT] = MASTER

    def touch(self, part: Part) -> None:
        """Mark that a part is touched."""
        self.marks[COMPONENT] = self.parts.index(part) + 1

    def adopt(self, scenario: Scenario, descriptions: Descriptions) -> bool:
        """Run another scenario from now on, if that has the same FMUs, wired in the same way; else say no."""
        if not self.parts or structure(scenario, descriptions) != structure(self.scenario, self.descriptions):
            return False
        self.scenario, self.descriptions = scenario, descriptions
        self.subject = Subject(scenario, descriptions)
        for part in self.parts:
            part.component = scenario.components[part.component.name]
        return True

    def __enter__(self) -> Master:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @folder_kept()
    def close(self) -> None:
        """Free all instances."""
        for part in self.parts:
            part.instance.close()
        for link in self.links.values():
            link.line.close()
        self.parts, self.links = [], {}

    @folder_kept()
    def run(
        self,
        columns: list[int],
        seeds: Mapping[str, int],
        progress: Progress | None = None,
        values: Mapping[Port, Value] | None = None,
        recording: Recording | None = None,
        keeper: Keeper | None = None,
    ) -> Recording:
        """One run from start to stop; after a failure, that is the recording's `error`.

        It records the places `columns` of the buffer, in `recording` if that is given, tells `progress` base steps done
        and in all now and then, and prefers `values` of parameters to those of the scenario. It ends after the base
        step in which the mark STOP is set. The `keeper` has where to go on and when to save.
        """
        recording = recording or Recording(np.empty(shape(self.scenario, columns)))
        recording.begun = perf_counter()
        try:
            self.initialize(seeds, values or {})
            recording.parameters = {
                f"{part.component.name}.{name}": value
                for part in self.each(STARTING, self.parts)
                for name, value in part.instance.get_all(part.instance.description.of("parameter")).items()
            }
            self.director.begin(recording.parameters)
            recording.events = self.director.happened
            self.loop(recording, np.array(columns, dtype=np.int64), progress, keeper)
            for part in self.each(ENDING, self.parts):
                with suppress(FmuError) if part.ended else nullcontext():
                    part.instance.call("fmi2Terminate")
        except FmuError as error:
            recording.error = self.director.explain(error)
            self.abandon(error.instance)
        except KeyboardInterrupt:  # the second one, in the middle of a step: what was recorded before is good
            recording.interrupted = True
        recording.wall, recording.begun = recording.measure_wall(), None
        recording.boards = {part.component.name: part.instance.facts() for part in self.parts if part.component.board}
        recording.messages += self.messages()
        return recording

    def stop(self) -> None:
        """End the run after the base step that is being done."""
        self.marks[STOP] = 1

    def messages(self) -> list[tuple[str, int, str]]:
        """What the components have logged: component, status, text."""
        return [(part.component.name, *said) for part in self.parts for said in part.instance.messages]

    def initialize(self, seeds: Mapping[str, int], values: Mapping[Port, Value]) -> None:
        """Bring all components to their start: parameters, initial inputs and outputs in execution order."""
        experiment = self.scenario.experiment
        self.view[:] = 0.0
        self.marks[ROWS] = self.marks[STEP] = 0
        self.texts.update(dict.fromkeys(self.places.texts, ""))
        problems: list[str] = []
        events = varied_events(self.scenario.events, values, problems)
        if problems:
            raise FmuError("run", " ".join(problems))
        self.director = self.make_director(self.subject.prepare_events(events), seeds)
        played = {port.component for port in self.scenario.played}
        for part in self.each(STARTING, self.parts):
            component, part.ended = part.component, 0
            part.is_played = component.name in played
            own: dict[str, Value] = {"seed": seeds[component.name]} if component.name in seeds else {}
            own.update({port.variable: value for port, value in values.items() if port.component == component.name})
            part.instance.initialize({**component.values, **own}, experiment.time(component.offset), experiment.stop)
            refuse(part, part.read_outputs(), experiment)
        for port, value in constants(self.scenario, self.descriptions, values).items():
            place(port, value, self.places, self.buffer, self.texts)
        self.player = player(self.scenario.played, self.places.inlets, experiment)
        self.player.into(self.view)(0)
        self.places.remember(self.buffer, self.texts)
        for number, part in enumerate(self.each(STARTING, self.parts)):
            if loop := next((loop for loop in self.loops if number in loop), ()):
                if number == loop[0]:
                    start_loop([self.parts[i] for i in loop], experiment, self.touch)
                continue
            refuse(part, part.taker()(), experiment)
            part.instance.call("fmi2ExitInitializationMode")
            refuse(part, part.read_outputs(), experiment)

    def make_director(self, events: Mapping[str, Event], seeds: Mapping[str, int]) -> Director:
        """Prepare events with one target each for the initialization."""
        return Director(
            events=events,
            experiment=self.scenario.experiment,
            parts=self.parts,
            places=self.places,
            buffer=self.view,
            seeds=seeds,
            marks=self.marks,
        )

    def abandon(self, failed: str) -> None:
        """Terminate the instances that have not failed; a second failure would only hide the first."""
        for part in self.each(ENDING, self.parts):
            if part.component.name != failed and not part.instance.is_dead:
                with suppress(FmuError):
                    part.instance.call("fmi2Terminate")

    def loop(
        self, recording: Recording, columns: npt.NDArray[np.int64], progress: Progress | None, keeper: Keeper | None
    ) -> None:
        """Base step after base step, until the end or until told to stop; the recording is always up to date."""
        experiment, count = self.scenario.experiment, self.scenario.experiment.count
        recording.start(len(self.parts))
        begin = self.restore_parts(keeper, recording) if keeper else 0
        advance = self.advancer(recording, columns, begin)
        done = begin - 1 if begin else advance(0)
        change = self.director.limit if begin else self.director.turn(done)
        wait = pacer(experiment, recording, done) if experiment.pace else None
        if progress:
            progress(done, count)
        pause, rest = pauses(self.actions(recording, progress, keeper), count, done)
        while done < count and not recording.interrupted:
            done = advance(min(done + 1 if wait else pause, change))
            if any(part.ended for part in self.parts):
                return self.end(recording, done)
            if done < count and (done == change or self.director.has_news()):
                change = self.director.turn(done)
            if wait:
                wait(done)
            if done >= pause:
                pause = rest(done)
            recording.interrupted = done < count and bool(self.marks[STOP])
        if recording.interrupted and keeper:
            self.save(keeper, recording, done)

    def save(self, keeper: Keeper, recording: Recording, done: int) -> None:
        """Write all that it takes to go on after `done` base steps."""
        facts = {
            "done": done,
            "recording": {**recording.facts(), "messages": recording.messages + self.messages()},
            "texts": [[*port, text] for port, text in self.texts.items()],
            "events": self.director.state(),
        }
        arrays: dict[str, Any] = {"data": recording.data[: recording.rows], "buffer": self.view}
        states = {part.component.name: part.instance.state() for part in self.parts}
        arrays |= {f"state_{name}": np.frombuffer(state, np.uint8) for name, state in states.items()}
        keeper.write(facts, arrays)

    def restore_parts(self, keeper: Keeper, recording: Recording) -> int:
        """Bring parts that were just initialised to where a checkpoint was written; return the base step to do next.

        That is 0, the start, if the run does not go on from a checkpoint.
        """
        if not keeper.resume:
            return 0
        about, arrays = keeper.read()
        for part in self.parts:
            part.instance.restore(arrays[f"state_{part.component.name}"].tobytes())
            part.instance.messages.clear()  # of the initialization, which are in the checkpoint already
        self.view[:] = arrays["buffer"]
        self.texts.update((Port(*port), text) for *port, text in about["texts"])
        recording.resume(about["recording"], arrays["data"])
        self.director.restore(about["events"])
        return int(about["done"]) + 1

    def end(self, recording: Recording, done: int) -> None:
        """Note which components have ended the run in an orderly way, in the base step that was done last.

        A row is of one time, so there is none of a base step that a component did not do to its end.
        """
        self.marks[STOP], stop = 0, self.scenario.experiment.stop
        ended = [part for part in self.parts if part.ended]
        if any(part.ended == ENDS_WITHIN for part in ended) and not done % self.scenario.record.decimation:
            recording.rows -= 1
            self.marks[ROWS] = recording.rows
        said = (f"`{p.component.name}` ended the run at t = {p.instance.last:.9g} s, in an orderly way" for p in ended)
        recording.ended = " ".join(f"{sentence}; `stop` is {stop:.9g} s." for sentence in said)

    def advancer(self, recording: Recording, columns: npt.NDArray[np.int64], begin: int) -> Advance:
        """Function that does base steps, of which `begin` is the first."""
        for part, warnings in zip(self.parts, recording.warnings):
            part.warnings = warnings
        self.marks[PHASE], self.marks[ROWS] = STEPPING, recording.rows
        return advancer(
            Work(
                parts=self.parts,
                experiment=self.scenario.experiment,
                player=self.player,
                columns=columns,
                decimation=self.scenario.record.decimation,
                buffer=self.view,
                recording=recording,
                marks=self.marks,
                begin=begin,
                watches=self.director.watches,
                loops=self.loops,
                limit=lambda: self.director.limit,
            )
        )

    def actions(self, recording: Recording, progress: Progress | None, keeper: Keeper | None) -> list[Action]:
        """What is told and saved during a run, and every how many base steps."""
        count, actions = self.scenario.experiment.count, list[Action]()
        if progress:
            actions.append((max(1, count // REPORTS), lambda k: progress(k, count)))
        if keeper:
            actions.append((keeper.every, lambda k: self.save(keeper, recording, k) if k < count else None))
        return actions


def structure(scenario: Scenario, descriptions: Descriptions) -> object:
    """What cannot change while the FMUs are loaded."""
    bare = {name: replace(c, values={}, origin={}, sets={}) for name, c in scenario.components.items()}
    hashes = {name: (description.path, description.sha256) for name, description in descriptions.items()}
    targets = [(name, event.target) for name, event in scenario.events.items()]
    boards = [c.firmware and sha256(c.firmware) for c in bare.values()]
    return [*bare.items()], hashes, boards, scenario.connections, targets, scenario.experiment.step_limit


def refuse(part: Part, failed: str, experiment: Experiment) -> None:
    """Raise the error of an initialisation call that failed."""
    if failed:
        raise part.failure(failed, experiment.time(part.component.offset), 0)


# What comes between base steps: waiting for a pace, and what is told and saved now and then.


def pacer(experiment: Experiment, recording: Recording, done: int) -> Callable[[int], None]:
    """Function that sleeps at the end of a base step until its time has come, and notes when it is late."""
    period = experiment.base_step / (experiment.pace or 1.0)
    begin = perf_counter() - done * period

    def wait(k: int) -> None:
        left = begin + k * period - perf_counter()
        if left > 0.0:
            sleep(left)
        else:
            recording.overruns += 1
            recording.lag = max(recording.lag, -left)

    return wait


def pauses(actions: Sequence[Action], count: int, done: int) -> tuple[int, Callable[[int], int]]:
    """The next base step after which there is something to do, and the function that does it and gives the next one.

    The loop should not have to ask at each step. It may come later, where steps are controlled.
    """

    def following(k: int) -> list[int]:
        return [min(count, k - k % every + every) for every, _ in actions]

    due = following(done)

    def pause(k: int) -> int:
        for (_, do), when in zip(actions, due):
            if k >= when:
                do(k)
        due[:] = following(k)
        return min(due, default=count)

    return min(due, default=count), pause
