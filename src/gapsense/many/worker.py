"""Many runs of a scenario: what a worker needs to know, here or on a cluster, and how it does one run."""

from __future__ import annotations

import atexit
import math
import pickle
from base64 import b64decode, b64encode
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from gapsense._os.importable import import_function, importable_name
from gapsense._os.processes import Died, Marks, own_marks
from gapsense._os.workers import Job
from gapsense.cosim.fmu.descriptions import Descriptions
from gapsense.cosim.result.result import Measure, Result
from gapsense.cosim.run.apart import limit_of
from gapsense.cosim.run.master import Master
from gapsense.cosim.run.recording import death, order_of, versions
from gapsense.cosim.run.run import run_once
from gapsense.cosim.scenario.records import Plan, Port, Scenario, matching
from gapsense.many.columns import ERROR, Columns
from gapsense.problems import FmuError
from gapsense.tables import Value


class Runs:
    """Holds the loaded FMUs between runs, and loads them anew after a failure."""

    def __init__(self, task: Mapping[str, Any]) -> None:
        versions()  # now, so that no run need account for it: it starts a process
        self.scenario, self.descriptions = pickle.loads(b64decode(task["pickled"]))
        self.measure = import_function(task["measure"]) if task["measure"] else None
        self.keep = Path(task["keep"]) if task["keep"] else None
        self.patterns, self.decimation = task["signals"], task["decimation"]
        self.master: Master | None = None
        atexit.register(self.drop)

    def __call__(self, asked: Mapping[str, Any]) -> dict[str, Any]:
        """Answer of one run, or what went wrong."""
        try:
            self.master = self.master or Master(self.scenario, self.descriptions, own_marks())
            return self.answer(run_once(self.master, asked["shift"], point=by_port(asked["values"])), asked["index"])
        except FmuError as error:
            self.drop()
            return {"error": str(error)}

    def answer(self, result: Result, index: int) -> dict[str, Any]:
        """Metrics, wall time, what has ended the run, and signals as bytes: time first, one after the other."""
        try:
            if self.keep:
                result.save(signal_file(self.keep, index))
        except OSError as error:
            return {"error": f"`{error.filename}`: {error.strerror}."}
        answer: dict[str, Any] = {"metrics": self.metrics(result), "wall": result.wall}
        if result.ended:
            answer["ended"] = result.ended
        if self.patterns:
            signals = [result.times, *(result[name] for name in matching(self.patterns, result.signals))]
            data = np.stack([signal[:: self.decimation] for signal in signals]).astype("<f8")
            answer["trajectory"] = b64encode(data.tobytes()).decode()
        return answer

    def metrics(self, result: Result) -> dict[str, float | None]:
        """Metrics of the scenario and of the sweep; JSON has no NaN, so that is null."""
        values = {name: measured.value for name, measured in result.metrics.items()}
        if self.measure:
            values.update(self.measure(result))
        return {name: float(value) if math.isfinite(value) else None for name, value in values.items()}

    def drop(self) -> None:
        """Free the FMUs, if they are loaded."""
        if self.master:
            self.master.close()
        self.master = None


@dataclass(frozen=True)
class Many:
    """Runs of a scenario over a plan, and what is kept of each."""

    scenario: Scenario
    descriptions: Descriptions
    plan: Plan
    columns: Columns
    signals: tuple[str, ...] = ()  # patterns of the trajectories that are kept
    decimation: int = 1  # of their rows
    measure: Measure | None = None  # further metrics
    folder: Path | None = None  # for a CSV file of each run
    files: tuple[Path, ...] = ()  # that the plan's values name
    tries: int = 1  # of a run whose process dies

    def request(self, index: int) -> dict[str, Any]:
        """What a worker is asked for a run, of JSON."""
        return {"index": index, "shift": self.plan.shift(index), "values": self.plan.name_values(index)}

    def job(self, workers: int = 1) -> Job:
        """What processes do, on whatever machine."""
        task = {
            "pickled": b64encode(pickle.dumps((self.scenario, self.descriptions))).decode(),
            "measure": self.measure and importable_name(self.measure),
            "keep": self.folder and str(self.folder.resolve()),
            "signals": list(self.signals),
            "decimation": self.decimation,
        }
        return Job(
            prepare=Runs,
            task=task,
            workers=workers,
            guest=self.measure,
            on_worker_death=death_entry(self.scenario, self.descriptions),
            limit=limit_of(self.scenario),
            request=self.request,
            tries=self.tries,
        )


def death_entry(scenario: Scenario, descriptions: Descriptions) -> Callable[[Died, Marks], Mapping[str, Any]]:
    """Function that makes an entry of a run that has ended its process, with the last that this wrote."""
    order = order_of(scenario, descriptions).names

    def entry(died: Died, marks: Marks) -> Mapping[str, Any]:
        last, error = died.words.rpartition("\n")[2], str(death(scenario, order, died, marks))
        return {ERROR: f"{error} It wrote: {last}" if last and "exit code" in died.cause else error}

    return entry


def signal_file(folder: Path, index: int) -> Path:
    """File for the recorded signals of a run."""
    return folder / f"{index:05d}.csv"


def by_port(values: Mapping[str, Value]) -> dict[Port, Value]:
    """Values by port instead of by name."""
    return {Port(*name.split(".", 1)): value for name, value in values.items()}


def thrifty(scenario: Scenario) -> Scenario:
    """A scenario that records only what its metrics look at."""
    names = {name for m in scenario.metrics for name in (m.signal, m.reference, m.where, m.time, *(m.flows or ()))}
    signals = tuple(sorted(name for name in names if isinstance(name, str)))  # parameters match no signal
    return replace(scenario, record=replace(scenario.record, signals=signals))
