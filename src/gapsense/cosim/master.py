"""The co-simulation master: initialise, step on an integer grid, record; one set, step and get per component-step."""

from __future__ import annotations

import shutil
from array import array
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter
from types import TracebackType

import numpy as np
import numpy.typing as npt

from gapsense.cosim.clockwork import Clockwork, Pacer
from gapsense.cosim.descriptions import Description
from gapsense.cosim.instance import Instance, Message, temporary_folder
from gapsense.cosim.order import execution_order
from gapsense.cosim.part import Layout, Part
from gapsense.cosim.record import FmuError
from gapsense.cosim.scenario import Experiment, Port, Scenario
from gapsense.cosim.signals import ports
from gapsense.tables import Value

Progress = Callable[[int, int], None]
REPORTS = 200  # progress reports per run


@dataclass
class Recording:
    """What a run leaves behind, complete or not: recorded rows, parameters as read back, and time spent.

    `lag` is the worst lateness [s] and `overruns` the number of late base steps of a run with a pace.
    """

    data: npt.NDArray[np.float64]
    rows: int = 0
    parameters: dict[str, dict[str, Value]] = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=dict)
    calls: dict[str, int] = field(default_factory=dict)
    messages: dict[str, list[Message]] = field(default_factory=dict)
    wall: float = 0.0
    overruns: int = 0
    lag: float = 0.0
    interrupted: bool = False
    error: FmuError | None = None


class Master:
    """All FMU instances of a scenario, extracted and loaded once, run as often as wanted.

    Use it in a `with` statement: at its end all instances are freed and the extracted files removed.
    """

    def __init__(self, scenario: Scenario, descriptions: Mapping[str, Description]) -> None:
        self.scenario, self.descriptions = scenario, descriptions
        self.order = execution_order(list(scenario.components), scenario.connections, descriptions)
        self.places = Layout(ports(descriptions))
        self.buffer = array("d", [0.0]) * max(1, len(self.places.variables))
        self.view = np.frombuffer(self.buffer)
        self.parts: list[Part] = []
        self.folder = temporary_folder()
        try:
            self.load()
        except BaseException:
            self.close()
            raise

    def load(self) -> None:
        """Extract every FMU once, instantiate the components in execution order, wire them."""
        folders: dict[Path, Path] = {}
        for name in self.order.names:
            description = self.descriptions[name]
            if description.path not in folders:
                folders[description.path] = self.folder / f"{len(folders)}"
                shutil.unpack_archive(description.path, folders[description.path], "zip")
            instance = Instance(name, description, folders[description.path])
            self.parts.append(Part(self.scenario.components[name], instance, self.buffer, self.places))
        for part in self.parts:
            for connection in self.scenario.connections:
                if connection.target.component == part.component.name:
                    part.connect(connection)

    def __enter__(self) -> Master:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Free all instances and remove the extracted files."""
        for part in self.parts:
            part.instance.close()
        self.parts = []
        shutil.rmtree(self.folder, ignore_errors=True)

    def run(
        self,
        columns: list[int],
        seeds: Mapping[str, int],
        progress: Progress | None = None,
        stopped: Callable[[], bool] = lambda: False,
        values: Mapping[Port, Value] | None = None,
    ) -> Recording:
        """One run from start to stop.

        Parameters
        ----------
        columns : list of int
            Places in the buffer to record.
        seeds : mapping
            Seed of each random component.
        progress : callable, optional
            Called now and then with base steps done and base steps in all.
        stopped : callable, optional
            Asked after each base step; if true, the run ends there and counts as interrupted.
        values : mapping, optional
            Parameters of this run, which win over those of the scenario.

        Returns
        -------
        Recording
            Also after a failure, which is then its `error`.
        """
        experiment, decimation = self.scenario.experiment, self.scenario.record.decimation
        recording = Recording(np.empty((experiment.count // decimation + 1, len(columns))))
        begin = perf_counter()
        try:
            self.initialize(seeds, values or {})
            recording.parameters = {part.component.name: part.instance.parameters() for part in self.parts}
            self.loop(recording, np.array(columns, dtype=np.intp), progress, stopped)
            self.terminate()
        except FmuError as error:
            recording.error = error
            self.abandon(error.instance)
        recording.wall = perf_counter() - begin
        recording.messages = {part.component.name: list(part.instance.messages) for part in self.parts}
        return recording

    def initialize(self, seeds: Mapping[str, int], values: Mapping[Port, Value] | None = None) -> None:
        """Bring all components to their start: parameters, initial inputs and outputs in execution order."""
        experiment = self.scenario.experiment
        self.view[:] = 0.0
        for part in self.parts:
            component = part.component
            own: dict[str, Value] = {"seed": seeds[component.name]} if component.name in seeds else {}
            own.update({p.variable: value for p, value in (values or {}).items() if p.component == component.name})
            part.instance.initialize({**component.values, **own}, experiment.time(component.offset), experiment.stop)
            refuse(part, part.read_outputs(), experiment)
        for port, value in self.scenario.inputs.items():
            self.buffer[self.places.index[port]] = value
        for part in self.parts:
            refuse(part, part.taker()(), experiment)
            part.instance.call("fmi2ExitInitializationMode")
            refuse(part, part.read_outputs(), experiment)

    def terminate(self) -> None:
        """End the run of all instances, which can then be reset."""
        for part in self.parts:
            part.instance.call("fmi2Terminate")

    def abandon(self, failed: str) -> None:
        """Terminate the instances that have not failed; a second failure would only hide the first."""
        for part in self.parts:
            if part.component.name != failed and not part.instance.is_dead:
                with suppress(FmuError):
                    part.instance.call("fmi2Terminate")

    def loop(
        self,
        recording: Recording,
        columns: npt.NDArray[np.intp],
        progress: Progress | None,
        stopped: Callable[[], bool],
    ) -> None:
        """Do all base steps, keeping the recording up to date whatever happens."""
        clockwork = Clockwork(self.parts, self.scenario.experiment)
        pacer = Pacer(self.scenario.experiment) if self.scenario.experiment.pace else None
        try:
            self.turn(clockwork, recording, columns, pacer, progress, stopped)
        finally:
            names = [part.component.name for part in self.parts]
            recording.seconds = dict(zip(names, clockwork.seconds))
            recording.calls = dict(zip(names, clockwork.calls))
            if pacer:
                recording.overruns, recording.lag = pacer.overruns, pacer.lag

    def turn(
        self,
        clockwork: Clockwork,
        recording: Recording,
        columns: npt.NDArray[np.intp],
        pacer: Pacer | None,
        progress: Progress | None,
        stopped: Callable[[], bool],
    ) -> None:
        """Base step after base step, until the end or until told to stop."""
        count, decimation = self.scenario.experiment.count, self.scenario.record.decimation
        data, take, step = recording.data, self.view.take, clockwork.base_stepper()
        report = max(1, count // REPORTS)
        take(columns, out=data[0], mode="clip")
        recording.rows = 1
        for k in range(1, count + 1):
            step(k)
            if not k % decimation:
                take(columns, out=data[recording.rows], mode="clip")
                recording.rows += 1
            if pacer:
                pacer.wait(k)
            if progress and (not k % report or k == count):
                progress(k, count)
            if k < count and stopped():
                recording.interrupted = True
                break


def refuse(part: Part, failed: str, experiment: Experiment) -> None:
    """Raise the error of an initialisation call that failed."""
    if failed:
        raise part.failure(failed, experiment.time(part.component.offset), 0)
