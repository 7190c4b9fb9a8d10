"""The runs of a sweep or a campaign, as one of the worker processes does them."""

from __future__ import annotations

import atexit
import math
import pickle
from base64 import b64decode
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from gapsense._os.importable import imported
from gapsense._os.processes import own_marks
from gapsense.cosim.result.result import Result
from gapsense.cosim.run.failure import FmuError
from gapsense.cosim.run.master import Master
from gapsense.cosim.run.run import run_once
from gapsense.cosim.run.subject import versions
from gapsense.cosim.scenario.elements import Port
from gapsense.cosim.scenario.records import Scenario
from gapsense.ledger import kept
from gapsense.tables import Value


class Runs:
    """Holds the loaded FMUs between runs, and loads them anew after a failure."""

    def __init__(self, task: Mapping[str, Any]) -> None:
        import fmpy.fmi2  # noqa: F401  # now, so that the first component need not account for it

        versions()  # likewise: it starts a process
        self.scenario, self.descriptions = pickle.loads(b64decode(task["pickled"]))
        self.measure = imported(task["measure"]) if task["measure"] else None
        self.keep = None if task["keep"] is None else Path(task["keep"])
        self.master: Master | None = None
        atexit.register(self.drop)

    def __call__(self, asked: Mapping[str, Any]) -> dict[str, Any]:
        """Metrics of one run, or what went wrong."""
        try:
            self.master = self.master or Master(self.scenario, self.descriptions, own_marks())
            return self.answer(run_once(self.master, asked["shift"], point=by_port(asked["values"])), asked["index"])
        except FmuError as error:
            self.drop()
            return {"error": str(error)}

    def answer(self, result: Result, index: int) -> dict[str, Any]:
        """What is answered for a run."""
        problem = self.save(result, index)
        if problem:
            return {"error": problem}
        return {"metrics": self.metrics(result), **({"ended": result.ended} if result.ended else {})}

    def save(self, result: Result, index: int) -> str:
        """Keep the signals, if they are wanted; what went wrong, or nothing."""
        try:
            if self.keep:
                result.save(kept(self.keep, index))
        except OSError as error:
            return f"`{error.filename}`: {error.strerror}."
        return ""

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


def request(index: int, shift: int, values: Mapping[Port, Value]) -> dict[str, Any]:
    """What is asked, of JSON: the run of that index, with `shift` added to every seed, and values of parameters."""
    return {"index": index, "shift": shift, "values": {str(port): value for port, value in values.items()}}


def by_port(values: Mapping[str, Value]) -> dict[Port, Value]:
    """Values by port instead of by name."""
    return {Port(*name.split(".", 1)): value for name, value in values.items()}


def thrifty(scenario: Scenario) -> Scenario:
    """A scenario that records only what its metrics look at."""
    names = {name for m in scenario.metrics for name in (m.signal, m.reference, m.where, m.time)}
    signals = tuple(sorted(name for name in names if isinstance(name, str)))  # parameters match no signal
    return replace(scenario, record=replace(scenario.record, signals=signals))
