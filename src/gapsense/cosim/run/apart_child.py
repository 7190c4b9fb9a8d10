"""The process in which a run is done apart, seen from inside."""

from __future__ import annotations

import atexit
import json
import mmap
import pickle
from collections.abc import Callable
from pathlib import Path
from time import monotonic
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from gapsense._os.files import write_atomically
from gapsense._os.processes import own_marks
from gapsense.cosim.fmu.descriptions import Descriptions
from gapsense.cosim.run.failure import FmuError
from gapsense.cosim.run.master import Keeper, Master, shape
from gapsense.cosim.run.recording import Recording, Take
from gapsense.cosim.scenario.records import Scenario

FACTS = "facts.json"  # all but the rows, of the run so far
PERIOD = 0.5  # seconds between two of its versions


class Plan(NamedTuple):
    """All that the other process needs to know."""

    scenario: Scenario
    descriptions: Descriptions
    take: Take
    keeper: Keeper | None


def prepare(folder: str) -> Callable[[Any], dict[str, Any]]:
    """Function that does the run whose plan is in a folder."""
    import fmpy.fmi2  # noqa: F401  # now, so that the first component need not account for it

    plan: Plan = pickle.loads(Path(folder, "plan").read_bytes())

    def answer(_: Any) -> dict[str, Any]:
        try:
            return record(plan, Path(folder)).facts()
        except OSError as error:
            return {"os_error": [error.errno, error.strerror, error.filename]}

    return answer


def record(plan: Plan, folder: Path) -> Recording:
    """The run; its FMUs are freed when this process ends, and may crash then without harm."""
    marks, size = own_marks(), shape(plan.scenario, plan.take.columns)
    recording = Recording(opened(folder / "rows", size))
    try:
        master = Master(plan.scenario, plan.descriptions, marks)
    except FmuError as error:
        recording.error = error
        return recording
    atexit.register(master.close)
    notes = Notes(folder / FACTS, master, recording)
    columns, seeds, values = plan.take
    return master.run(columns, seeds, notes, values, recording, plan.keeper)


class Notes:
    """Writes down now and then what is known of a run, to be told of progress."""

    def __init__(self, file: Path, master: Master, recording: Recording) -> None:
        self.file, self.master, self.recording = file, master, recording
        self.due = monotonic()

    def __call__(self, done: int, total: int) -> None:
        """Write if it is time."""
        if monotonic() >= self.due:
            facts = {**self.recording.facts(), "messages": self.master.messages()}
            write_atomically(self.file, lambda file: json.dump(facts, file))
            self.due = monotonic() + PERIOD


def opened(file: Path, size: tuple[int, int]) -> npt.NDArray[np.float64]:
    """Rows in a file, which is changed with them."""
    with file.open("r+b") as handle:
        memory = mmap.mmap(handle.fileno(), 0)
    return np.frombuffer(memory, count=size[0] * size[1]).reshape(size)
