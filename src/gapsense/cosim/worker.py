"""The runs of a sweep, as one of its worker processes does them."""

from __future__ import annotations

import atexit
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from gapsense.cosim.document import unpacked
from gapsense.cosim.master import Master
from gapsense.cosim.prepare import prepare
from gapsense.cosim.record import FmuError, Result
from gapsense.cosim.run import run_once
from gapsense.importable import imported
from gapsense.ledger import kept
from gapsense.processes import own_marks


class Runs:
    """Holds the loaded FMUs between runs, and loads them anew after a failure."""

    def __init__(self, task: Mapping[str, Any]) -> None:
        self.scenario, self.descriptions = prepare(unpacked(task["scenario"]), task["variant"], task["fmus"])
        self.measure = imported(task["measure"]) if task["measure"] else None
        self.keep = None if task["keep"] is None else Path(task["keep"])
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
