"""What is run: a scenario and its FMUs, with all that their runs have in common, found once."""

from __future__ import annotations

import os
import platform
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from gapsense._os.files import sha256, state
from gapsense.cosim.check.coarse import remarks
from gapsense.cosim.events.event import Span
from gapsense.cosim.events.read import varied
from gapsense.cosim.fmu.descriptions import Descriptions
from gapsense.cosim.fmu.instance import WARNING, summary
from gapsense.cosim.result.result import Result, Run, Signal, Timing, measure_all
from gapsense.cosim.run.loop import language
from gapsense.cosim.run.recording import Recording, Take, median
from gapsense.cosim.scenario.elements import Connection, Port
from gapsense.cosim.scenario.order import Order, execution_order
from gapsense.cosim.scenario.records import Scenario
from gapsense.cosim.scenario.signals import ports, recorded_signals
from gapsense.tables import Value
from gapsense.version import __version__


@dataclass(frozen=True)
class Subject:
    """A scenario and the descriptions of its FMUs."""

    scenario: Scenario
    descriptions: Descriptions

    @cached_property
    def about(self) -> dict[str, Signal]:
        """The signals that are recorded."""
        known = recorded_signals(self.scenario, self.descriptions)
        return {name: Signal(v.unit or "", v.nominal, v.causality) for name, v in known.items()}

    @cached_property
    def columns(self) -> list[int]:
        """Their places in the buffer."""
        return [place for place, port in enumerate(ports(self.descriptions)) if str(port) in self.about]

    @cached_property
    def order(self) -> Order:
        """In which the components act."""
        return execution_order(list(self.scenario.components), self.scenario.connections, self.descriptions)

    @cached_property
    def run(self) -> Run:
        """What is run and how, but for seeds, files and what came of it."""
        scenario, experiment = self.scenario, self.scenario.experiment
        said = [f"{name} = {value}" for name, value in scenario.settings.items()]
        return Run(
            title=scenario.title + (f" ({', '.join(said)})" if said else ""),
            scenario=scenario.name,
            variant=scenario.variant,
            method=experiment.method,
            start=experiment.start,
            stop=experiment.stop,
            base_step=experiment.base_step,
            decimation=scenario.record.decimation,
            seeds={},
            components={name: component_facts(scenario, self.descriptions, name) for name in scenario.components},
            order=self.order.names,
            delayed=tuple(str(connection) for connection in self.order.delayed),
            files={},
            versions={**versions(), "loop": language()},
            source=str(scenario.path.resolve()),
            figure=scenario.figure,
            wires=tuple(map(str, scenario.connections)),
            remarks=tuple(remarks(scenario, self.descriptions)),
            settings=scenario.settings,
            direct=tuple(str(c) for c in scenario.connections if is_direct(c, self.descriptions)),
        )

    @cached_property
    def files(self) -> Mapping[str, Path]:
        """Each file of the scenario by its path from the scenario's folder."""
        folder = self.scenario.path.parent.resolve()
        files = [file.resolve() for file in self.scenario.files]
        return {Path(os.path.relpath(file, folder)).as_posix(): file for file in files}

    def hashes(self) -> dict[str, str]:
        """Hash of each file as it is now, and of what stands in none."""
        return {name: known_hash(file, *state(file)) for name, file in self.files.items()} | {**self.scenario.hashes}

    def taken(self, seed_shift: int = 0, point: int | Mapping[Port, Value] | None = None) -> Take:
        """What one run takes; a point of a sweep, or values of parameters."""
        values = self.scenario.points()[point] if isinstance(point, int) else point or {}
        random = {
            event.seed_name: event.seed
            for event in varied(self.scenario.events, values, []).values()
            if event.is_random
        }
        seeds = {name: seed + seed_shift for name, seed in {**self.scenario.seeds, **random}.items()}
        return Take(columns=self.columns, seeds=seeds, values=values)


def is_direct(connection: Connection, descriptions: Descriptions) -> bool:
    """True if an output of the target depends directly on what the connection carries."""
    return connection.target.variable in descriptions[connection.target.component].direct_inputs


def component_facts(scenario: Scenario, descriptions: Descriptions, name: str) -> dict[str, Any]:
    """FMU and grid of a component."""
    component, description = scenario.components[name], descriptions[name]
    facts = {key: getattr(description, key) for key in ("guid", "version", "sha256", "fmi")}
    return {"fmu": description.path.name, **facts, "step": component.step, "offset": component.offset}


@lru_cache(maxsize=256)
def known_hash(file: Path, *_: int) -> str:
    """Hash of a file in some state."""
    return sha256(file)


@cache
def versions() -> dict[str, str]:
    """Versions of what computed the result."""
    import fmpy  # which whoever has a result has loaded

    packages = {package.__name__: str(package.__version__) for package in (fmpy, np)}
    return {"gapsense": __version__, **packages, "python": platform.python_version(), "platform": platform.platform()}


# From a recording to a result with its metrics.


def finished(subject: Subject, take: Take, recording: Recording) -> Result:
    """Result of a recording with its metrics; raises FmuError with the partial result if a component has failed."""
    result = to_result(subject, take, recording)
    if recording.error is not None:
        recording.error.result = replace(result, failure=str(recording.error))
        raise recording.error
    return result if result.interrupted else replace(result, metrics=measure_all(subject.scenario.metrics, result))


def to_result(subject: Subject, take: Take, recording: Recording) -> Result:
    """Result of a recording, without metrics."""
    overruns, lag = recording.overruns, recording.lag
    return Result(
        run=replace(
            subject.run,
            seeds=dict(take.seeds),
            files=subject.hashes(),
            overruns=overruns,
            lag=lag,
            remarks=(*subject.run.remarks, *said(subject, recording)),
        ),
        times=times(subject.scenario, recording.rows),
        signals=dict(zip(subject.about, recording.data[: recording.rows].T.copy())),
        about=subject.about,
        parameters=recording.parameters,
        timing=dict(zip(subject.run.order, timings(recording))),
        wall=recording.wall,
        interrupted=recording.interrupted,
        ended=recording.ended,
        messages=tuple(recording.messages),
        events=tuple(spans(subject.scenario, recording.events)),
    )


def said(subject: Subject, recording: Recording) -> Iterator[str]:
    """Sentences on what components did in the run that is no failure: the end of it, warnings."""
    if recording.ended:
        yield recording.ended
    for name, warnings, calls in zip(subject.run.order, recording.warnings, recording.calls):
        if warnings:
            texts = [text for component, status, text in recording.messages if (component, status) == (name, WARNING)]
            said = f"; the last one says: {summary(texts[-1]).rstrip('.')}" if texts else " without a word"
            yield f"`{name}` returned a warning from {warnings} of {calls} steps{said}."


def timings(recording: Recording) -> Iterator[Timing]:
    """Time of each component, in execution order."""
    for seconds, calls, longest, spread in zip(recording.seconds, recording.calls, recording.longest, recording.spread):
        yield Timing(seconds, calls, median(spread, longest), longest if calls else None)


def spans(scenario: Scenario, happened: Sequence[Sequence[Any]]) -> Iterator[Span]:
    """When each event was on; of an event that was on at the end, the end is not known."""
    time = scenario.experiment.time
    for name, begin, end in happened:
        event = scenario.events[name]
        yield Span(
            name=name,
            target=str(event.target),
            action=event.action,
            begin=time(begin),
            end=None if end is None else time(end),
        )


def times(scenario: Scenario, rows: int) -> npt.NDArray[np.float64]:
    """Times of the rows [s], each with the bits of `Experiment.time`."""
    experiment = scenario.experiment
    steps = np.arange(rows, dtype=np.float64) * scenario.record.decimation  # exact: there are fewer than 2**53
    return experiment.start + steps * experiment.base_step
