"""The co-simulation master: initialise, step on an integer grid, record; one set, step and get per component-step."""

from __future__ import annotations

import shutil
from array import array
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from time import perf_counter, sleep

import numpy as np
import numpy.typing as npt

from gapsense.cosim.clockwork import BaseStep, base_stepper
from gapsense.cosim.descriptions import Descriptions
from gapsense.cosim.instance import Instance, temporary_folder
from gapsense.cosim.order import execution_order
from gapsense.cosim.part import Layout, Part
from gapsense.cosim.record import FmuError
from gapsense.cosim.scenario import Experiment, Port, Scenario
from gapsense.cosim.signals import ports
from gapsense.files import naming
from gapsense.tables import Value

Progress = Callable[[int, int], None]
REPORTS = 200  # progress reports per run


@dataclass
class Recording:
    """What a run leaves behind, complete or not."""

    data: npt.NDArray[np.float64]
    rows: int = 0  # of the data, recorded
    parameters: dict[str, Value] = field(default_factory=dict)  # as read back, by `component.parameter`
    seconds: list[float] = field(default_factory=list)  # wall time of each component, in execution order
    calls: list[int] = field(default_factory=list)  # steps of each
    messages: list[tuple[str, int, str]] = field(default_factory=list)  # component, status, text
    wall: float = 0.0  # [s]
    overruns: int = 0  # late base steps of a run with a pace
    lag: float = 0.0  # the worst lateness [s]
    interrupted: bool = False
    error: FmuError | None = None


class Master:
    """All FMU instances of a scenario, extracted and loaded once, run as often as wanted.

    Use it in a `with` statement: at its end all instances are freed and the extracted files removed.
    """

    def __init__(self, scenario: Scenario, descriptions: Descriptions) -> None:
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
                with naming(folders[description.path]):
                    shutil.unpack_archive(description.path, folders[description.path], "zip")
            instance = Instance(name, description, folders[description.path])
            self.parts.append(Part(self.scenario.components[name], instance, self.buffer, self.places))
        for part in self.parts:
            for connection in self.scenario.connections:
                if connection.target.component == part.component.name:
                    part.connect(connection)

    def adopt(self, scenario: Scenario, descriptions: Descriptions) -> bool:
        """Run another scenario from now on, if that has the same FMUs, wired in the same way; else say no."""
        if not self.parts or structure(scenario, descriptions) != structure(self.scenario, self.descriptions):
            return False
        self.scenario, self.descriptions = scenario, descriptions
        for part in self.parts:
            part.component = scenario.components[part.component.name]
        return True

    def __enter__(self) -> Master:
        return self

    def __exit__(self, *_: object) -> None:
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
        """One run from start to stop; after a failure, that is the recording's `error`.

        It records the places `columns` of the buffer, tells `progress` base steps done and in all now and then, asks
        `stopped` after each whether to end there, and prefers `values` of parameters to those of the scenario.
        """
        experiment, decimation = self.scenario.experiment, self.scenario.record.decimation
        recording = Recording(np.empty((experiment.count // decimation + 1, len(columns))))
        begin = perf_counter()
        try:
            self.initialize(seeds, values or {})
            recording.parameters = {
                f"{part.component.name}.{variable.name}": part.instance.get(variable)
                for part in self.parts
                for variable in part.instance.description.of("parameter")
            }
            self.loop(recording, np.array(columns, dtype=np.intp), progress, stopped)
            for part in self.parts:
                part.instance.call("fmi2Terminate")
        except FmuError as error:
            recording.error = error
            self.abandon(error.instance)
        recording.wall = perf_counter() - begin
        recording.messages = [(part.component.name, *said) for part in self.parts for said in part.instance.messages]
        return recording

    def initialize(self, seeds: Mapping[str, int], values: Mapping[Port, Value]) -> None:
        """Bring all components to their start: parameters, initial inputs and outputs in execution order."""
        experiment = self.scenario.experiment
        self.view[:] = 0.0
        for part in self.parts:
            component = part.component
            own: dict[str, Value] = {"seed": seeds[component.name]} if component.name in seeds else {}
            own.update({port.variable: value for port, value in values.items() if port.component == component.name})
            part.instance.initialize({**component.values, **own}, experiment.time(component.offset), experiment.stop)
            refuse(part, part.read_outputs(), experiment)
        for port, value in self.scenario.inputs.items():
            self.buffer[self.places.index[port]] = value
        for part in self.parts:
            refuse(part, part.taker()(), experiment)
            part.instance.call("fmi2ExitInitializationMode")
            refuse(part, part.read_outputs(), experiment)

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
        """Base step after base step, until the end or until told to stop; the recording is always up to date."""
        experiment, decimation = self.scenario.experiment, self.scenario.record.decimation
        recording.seconds, recording.calls = [0.0] * len(self.parts), [0] * len(self.parts)
        data, take, count = recording.data, self.view.take, experiment.count
        wait = pacer(experiment, recording) if experiment.pace else None
        step = base_stepper(self.parts, experiment, recording.seconds, recording.calls)
        report = max(1, count // REPORTS)
        take(columns, out=data[0], mode="clip")
        recording.rows = 1
        for k in range(1, count + 1):
            step(k)
            if not k % decimation:
                take(columns, out=data[recording.rows], mode="clip")
                recording.rows += 1
            if wait:
                wait(k)
            if progress and (not k % report or k == count):
                progress(k, count)
            if k < count and stopped():
                recording.interrupted = True
                break


def structure(scenario: Scenario, descriptions: Descriptions) -> object:
    """What cannot change while the FMUs are loaded."""
    bare = {name: replace(c, values={}, origin={}, sets={}) for name, c in scenario.components.items()}
    hashes = {name: (description.path, description.sha256) for name, description in descriptions.items()}
    return list(bare.items()), hashes, scenario.connections


def pacer(experiment: Experiment, recording: Recording) -> BaseStep:
    """Function that sleeps at the end of a base step until its time has come, and notes when it is late."""
    period, begin = experiment.base_step / (experiment.pace or 1.0), perf_counter()

    def wait(k: int) -> None:
        left = begin + k * period - perf_counter()
        if left > 0.0:
            sleep(left)
        else:
            recording.overruns += 1
            recording.lag = max(recording.lag, -left)

    return wait


def refuse(part: Part, failed: str, experiment: Experiment) -> None:
    """Raise the error of an initialisation call that failed."""
    if failed:
        raise part.failure(failed, experiment.time(part.component.offset), 0)
