"""Many runs of a scenario, as one of the worker processes does them."""

from __future__ import annotations

import atexit
import math
import pickle
from base64 import b64decode, b64encode
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from gapsense._os.importable import imported
from gapsense._os.processes import own_marks
from gapsense.cosim.result.result import Result
from gapsense.cosim.run.master import Master
from gapsense.cosim.run.recording import versions
from gapsense.cosim.run.run import run_once
from gapsense.cosim.scenario.records import Port, Scenario, matching
from gapsense.problems import FmuError
from gapsense.tables import Value


class Runs:
    """Holds the loaded FMUs between runs, and loads them anew after a failure."""

    def __init__(self, task: Mapping[str, Any]) -> None:
        import fmpy.fmi2  # noqa: F401  # now, so that the first component need not account for it

        versions()  # likewise: it starts a process
        self.scenario, self.descriptions = pickle.loads(b64decode(task["pickled"]))
        self.measure = imported(task["measure"]) if task["measure"] else None
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
                result.save(kept(self.keep, index))
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


def kept(folder: Path, index: int) -> Path:
    """File for the recorded signals of a run."""
    return folder / f"{index:05d}.csv"


def by_port(values: Mapping[str, Value]) -> dict[Port, Value]:
    """Values by port instead of by name."""
    return {Port(*name.split(".", 1)): value for name, value in values.items()}


def thrifty(scenario: Scenario) -> Scenario:
    """A scenario that records only what its metrics look at."""
    names = {name for m in scenario.metrics for name in (m.signal, m.reference, m.where, m.time)}
    signals = tuple(sorted(name for name in names if isinstance(name, str)))  # parameters match no signal
    return replace(scenario, record=replace(scenario.record, signals=signals))
