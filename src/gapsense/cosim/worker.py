"""A worker process of a sweep: `python -m gapsense.cosim.worker`, requests and answers as lines of JSON.

The first line names the scenario; every further line is a run index, answered by its metrics.
The process ends with its input.
"""

from __future__ import annotations

import importlib
import json
import math
import os
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TextIO

from gapsense.cosim.master import Master
from gapsense.cosim.record import FmuError, Measure, Result
from gapsense.cosim.run import prepare, run_once
from gapsense.ledger import kept
from gapsense.problems import ScenarioError


def main() -> None:
    """Answer requests until the input ends."""
    answers = private_output()
    task = json.loads(sys.stdin.readline())
    try:
        worker = Worker(task)
    except ScenarioError as error:
        send(answers, {"problems": error.problems})
        return
    send(answers, {"problems": []})
    for line in sys.stdin:
        send(answers, worker.answer(int(line)))
    worker.drop()


def private_output() -> TextIO:
    """The process's output for answers only: what FMUs print goes to the error stream from now on."""
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    sys.stdout = sys.stderr
    return answers


def send(answers: TextIO, message: Mapping[str, Any]) -> None:
    """Write one answer."""
    answers.write(json.dumps(message) + "\n")
    answers.flush()


class Worker:
    """Holds the loaded FMUs between runs, and loads them anew after a failure."""

    def __init__(self, task: Mapping[str, Any]) -> None:
        self.scenario, self.descriptions = prepare(task["scenario"], task["variant"], task["fmus"])
        self.measure = imported(task["measure"])
        self.keep = None if task["keep"] is None else Path(task["keep"])
        self.master: Master | None = None

    def answer(self, index: int) -> dict[str, Any]:
        """Metrics of one run, or what went wrong."""
        try:
            self.master = self.master or Master(self.scenario, self.descriptions)
            point = index % len(self.scenario.points()) if self.scenario.swept else None
            result = run_once(self.master, index, point=point)
            if self.keep:
                result.save(kept(self.keep, index))
            return {"index": index, "metrics": self.metrics(result)}
        except FmuError as error:
            self.drop()
            return {"index": index, "error": str(error)}

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


def imported(name: str | None) -> Measure | None:
    """Function called `module:function`."""
    if name is None:
        return None
    module, _, function = name.partition(":")
    measure: Measure = getattr(importlib.import_module(module), function)
    return measure


if __name__ == "__main__":
    main()
