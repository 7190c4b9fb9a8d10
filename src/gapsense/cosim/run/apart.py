"""A run in a process of its own, watched by the one that wants it: whatever ends it, what was recorded is there."""

from __future__ import annotations

import atexit
import json
import mmap
import os
import pickle
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from queue import Empty, Queue
from threading import Thread
from time import monotonic
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from gapsense._os.files import write_atomically
from gapsense._os.interrupts import count_interrupts
from gapsense._os.processes import Died, Process, own_marks
from gapsense._os.processes import process as new_process
from gapsense.cosim.fmu.descriptions import Descriptions
from gapsense.cosim.run.recording import (
    COMPONENT,
    DOING,
    MASTER,
    PHASE,
    ROWS,
    STEP,
    STEPPING,
    STOP,
    Recording,
    Take,
    death,
    from_facts,
    order_of,
    shape,
)
from gapsense.cosim.scenario.records import Scenario
from gapsense.problems import FmuError

if TYPE_CHECKING:
    from gapsense.cosim.run.checkpoint import Keeper
    from gapsense.cosim.run.master import Master, Progress

FACTS = "facts.json"  # all but the rows, of the run so far
PERIOD = 0.5  # seconds between two of its versions
LOOK = 0.05  # seconds between two looks at the run
HASTE = 0.5  # seconds after a Ctrl-C until one is told what it waits for
Answer = dict[str, Any] | Exception


def tell(sentence: str) -> None:
    """Print a sentence on the error stream."""
    print(sentence, file=sys.stderr, flush=True)


class Listeners(NamedTuple):
    """Callbacks of a run: `progress` gets base steps done and in all, `notice` what a Ctrl-C waits for.

    `meanwhile` prepares what is needed when the run has ended.
    """

    progress: Progress | None = None
    notice: Callable[[str], None] = tell
    meanwhile: Callable[[], object] = lambda: None


def record_apart(plan: Plan, watch: Listeners) -> Recording:
    """One run of a scenario in a process of its own; after a failure, that is the recording's `error`.

    The first Ctrl-C lets the step end, the second one ends the process.  Nothing is raised for either unless there is
    no row yet.
    """
    with count_interrupts() as interrupts:
        process = new_process(limit=limit_of(plan.scenario))
        try:
            recording = Supervisor(process, plan, watch, interrupts).recording()
        finally:
            process.close()
    if recording.interrupted and not recording.rows:
        raise KeyboardInterrupt
    return recording


def limit_of(scenario: Scenario) -> float:
    """Wall time [s] after which a process that runs a scenario hangs.

    Where a component has its own process, that is ended first, and a run with a pace sleeps between base steps.
    """
    experiment = scenario.experiment
    has_own = any(component.isolation == "process" for component in scenario.components.values())
    return experiment.step_limit + has_own + (experiment.base_step / experiment.pace if experiment.pace else 0.0)


class Supervisor:
    """One run, seen from the process that waits for it."""

    def __init__(self, process: Process, plan: Plan, watch: Listeners, interrupts: Callable[[], int]) -> None:
        self.process, self.plan, self.watch, self.interrupts = process, plan, watch, interrupts
        self.folder, self.marks = process.folder, process.marks
        self.data = make_rows(self.folder / "rows", shape(plan.scenario, plan.take.columns))
        self.order = order_of(plan.scenario, plan.descriptions).names
        (self.folder / "plan").write_bytes(pickle.dumps(plan))
        self.answers: Queue[Answer] = Queue()
        self.since: float | None = None  # the first Ctrl-C
        self.is_told = self.is_ended = False

    def recording(self) -> Recording:
        """What the run leaves behind."""
        Thread(target=self.ask, daemon=True).start()
        self.watch.meanwhile()
        self.look()
        answer = None
        while answer is None:
            with suppress(Empty):
                answer = self.answers.get(timeout=LOOK)
            self.look()
        if isinstance(answer, Died):
            return self.remains(answer)
        if isinstance(answer, Exception):
            raise answer
        if "os_error" in answer:
            raise OSError(*answer["os_error"])
        recording = from_facts(self.data, answer)
        if self.watch.progress and not recording.interrupted and not recording.error:
            self.watch.progress(self.plan.scenario.experiment.count, self.plan.scenario.experiment.count)
        return recording

    def ask(self) -> None:
        """Let the other process run the scenario."""
        try:
            self.process.prepare(prepare, str(self.folder))
            self.answers.put(self.process.ask("run", "the run"))
        except Exception as error:  # handed to the main thread, which raises it
            self.answers.put(error)

    def look(self) -> None:
        """Tell what the components print, how far the run is, and what a Ctrl-C waits for."""
        self.process.check()
        print(self.process.news(), end="", file=sys.stderr)  # of which there may be none
        if self.watch.progress:
            self.watch.progress(max(0, self.marks[STEP] - 1), self.plan.scenario.experiment.count)
        if self.interrupts():
            self.stop()

    def stop(self) -> None:
        """Answer one Ctrl-C, or more."""
        now = monotonic()
        self.since = self.since or now
        self.marks[STOP] = 1
        if self.interrupts() > 1 or not self.marks[ROWS]:
            self.is_ended = True
            self.process.kill()
        elif not self.is_told and now - self.since > HASTE:
            self.is_told = True
            self.watch.notice(f"interrupted; waiting for {self.place()} to end. Ctrl-C again ends it at once.")

    def place(self) -> str:
        """What the run is at."""
        if self.marks[COMPONENT] == MASTER:
            return f"base step {self.marks[STEP]}"
        name = self.order[self.marks[COMPONENT] - 1]
        is_step = self.marks[PHASE] == STEPPING
        return f"`{name}`, {DOING[self.marks[PHASE]]}{f' (base step {self.marks[STEP]})' * is_step},"

    def remains(self, died: Died) -> Recording:
        """What was recorded of a run whose process has ended."""
        recording = Recording(self.data)
        with suppress(FileNotFoundError):
            recording = from_facts(self.data, json.loads((self.folder / FACTS).read_text("utf-8")))
        recording.rows, recording.interrupted = self.marks[ROWS], self.is_ended
        if not self.is_ended:
            recording.error = death(self.plan.scenario, self.order, died, self.marks)
        return recording


def make_rows(file: Path, size: tuple[int, int]) -> npt.NDArray[np.float64]:
    """Map rows in a new file that two processes share; it gets all its room at once, or is refused."""
    octets = max(8, 8 * size[0] * size[1])
    with file.open("wb") as made:
        if hasattr(os, "posix_fallocate"):
            try:
                os.posix_fallocate(made.fileno(), 0, octets)
            except OSError as error:
                raise OSError(error.errno, f"{error.strerror} for {octets / 1e6:.0f} MB", str(file)) from None
        made.truncate(octets)
    return map_rows(file, size)


# The process in which a run is done apart, seen from inside.


class Plan(NamedTuple):
    """All that the other process needs to know."""

    scenario: Scenario
    descriptions: Descriptions
    take: Take
    keeper: Keeper | None


def prepare(folder: str) -> Callable[[Any], dict[str, Any]]:
    """Function that does the run whose plan is in a folder."""
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
    recording = Recording(map_rows(folder / "rows", size))
    from gapsense.cosim.run.master import Master  # here, so that the process that waits starts fast

    try:
        master = Master(plan.scenario, plan.descriptions, marks)
    except FmuError as error:
        recording.error = error
        return recording
    atexit.register(master.close)
    notes = noting(folder / FACTS, master, recording)
    columns, seeds, values = plan.take
    return master.run(columns, seeds, notes, values, recording, plan.keeper)


def noting(file: Path, master: Master, recording: Recording) -> Progress:
    """Function that takes the progress, and writes down now and then what is known about a run."""
    due = monotonic()

    def note(done: int, total: int) -> None:
        nonlocal due
        if monotonic() >= due:
            facts = {**recording.facts(), "messages": master.messages()}
            write_atomically(file, lambda opened: json.dump(facts, opened))
            due = monotonic() + PERIOD

    return note


def map_rows(file: Path, size: tuple[int, int]) -> npt.NDArray[np.float64]:
    """Map rows in a file, which is changed with them."""
    with file.open("r+b") as handle:
        memory = mmap.mmap(handle.fileno(), 0)
    return np.frombuffer(memory, count=size[0] * size[1]).reshape(size)
