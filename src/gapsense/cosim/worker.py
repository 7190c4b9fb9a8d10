"""The runs of a sweep, as one of its worker processes does them."""

from __future__ import annotations

import atexit
import math
import pickle
from base64 import b64decode
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from gapsense.cosim.master import Master
from gapsense.cosim.record import FmuError, Result
from gapsense.cosim.run import run_once
from gapsense.cosim.scenario import Scenario
from gapsense.importable import imported
from gapsense.ledger import kept
from gapsense.processes import own_marks


class Runs:
    """Holds the loaded FMUs between runs, and loads them anew after a failure."""

    def __init__(self, task: Mapping[str, Any]) -> None:
        import fmpy.fmi2  # noqa: F401  # now, so that the first component need not account for it

        scenario, self.descriptions = pickle.loads(b64decode(task["pickled"]))
        self.measure = imported(task["measure"]) if task["measure"] else None
        self.keep = None if task["keep"] is None else Path(task["keep"])
        self.scenario = scenario if self.measure or self.keep else thrifty(scenario)
        self.master: Master | None = None
        atexit.register(self.drop)

    def __call__(self, index: int) -> dict[str, Any]:
        """Metrics of one run, or what went wrong."""
        try:
            self.master = self.master or Master(self.scenario, self.descriptions, own_marks())
            point = index % len(self.scenario.points()) if self.scenario.swept else None
            result = run_once(self.master, index, point=point)
            problem = self.save(result, index)
            return {"error": problem} if problem else {"metrics": self.metrics(result)}
        except FmuError as error:
            self.drop()
            return {"error": str(error)}

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


def thrifty(scenario: Scenario) -> Scenario:
    """A scenario that records only what its metrics look at."""
    names = {name for m in scenario.metrics for name in (m.signal, m.reference, m.where, m.time)}
    signals = tuple(sorted(name for name in names if isinstance(name, str)))  # parameters match no signal
    return replace(scenario, record=replace(scenario.record, signals=signals))
