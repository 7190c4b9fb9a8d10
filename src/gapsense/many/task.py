"""Many runs of a scenario as a record: what workers need to know of them, here or on a cluster."""

from __future__ import annotations

import pickle
from base64 import b64encode
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gapsense._os.importable import importable_name
from gapsense._os.processes import Died, Marks
from gapsense._os.workers import Job
from gapsense.cosim.fmu.descriptions import Descriptions
from gapsense.cosim.result.result import Measure
from gapsense.cosim.run.apart import limit_of
from gapsense.cosim.run.recording import death
from gapsense.cosim.scenario.records import Scenario, execution_order
from gapsense.many.columns import ERROR, Columns
from gapsense.many.plan import Plan
from gapsense.many.worker import Runs


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
        values = {str(port): value for port, value in self.plan.values(index).items()}
        return {"index": index, "shift": self.plan.shift(index), "values": values}

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
    order = execution_order(list(scenario.components), scenario.connections, descriptions).names

    def entry(died: Died, marks: Marks) -> Mapping[str, Any]:
        last, error = died.words.rpartition("\n")[2], str(death(scenario, order, died, marks))
        return {ERROR: f"{error} It wrote: {last}" if last and "exit code" in died.cause else error}

    return entry
