"""What does the runs of a sweep, a campaign or a test: FMUs, or vectors where these give the same bits."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import islice
from pathlib import Path
from threading import Lock, Thread
from typing import TYPE_CHECKING, Any

from gapsense._os.checked import Entry
from gapsense._os.workers import Answers, Job, Pending, Server
from gapsense.cosim.prepare import find_fmus, prepare
from gapsense.cosim.result.result import Result
from gapsense.cosim.run.ahead import ENGINES, FMU, NATIVE, VECTORS, likely_vectors
from gapsense.cosim.run.recording import Recording, Take
from gapsense.cosim.run.subject import Subject, finished
from gapsense.cosim.run.worker import by_port
from gapsense.cosim.scenario.document import Source, scenario_file
from gapsense.problems import ScenarioError, suggest
from gapsense.shipped import NATIVE_FOLDER

if TYPE_CHECKING:
    from gapsense.vectors.engine import Vectors

LOG = logging.getLogger(__name__)


def refuse_unknown(engine: str) -> None:
    """Raise a ScenarioError for an engine that does not exist."""
    if engine not in ENGINES:
        raise ScenarioError([f"engine: `{engine}` found. {suggest(engine, ENGINES)}"])


def folder_of(engine: str, scenario: Source, fmus: str | Path | None) -> str | Path | None:
    """Folder of the FMUs, where it is chosen: that of the native ones, if these are to be run."""
    return find_fmus(scenario_file(scenario), NATIVE_FOLDER) if engine == NATIVE and fmus is None else fmus


def vectors_for(subject: Subject, engine: str) -> Vectors | None:
    """The scenario as vectors, if it is to run so and can; a word if vectors were asked for and it cannot."""
    if engine in (FMU, NATIVE):
        return None
    from gapsense.vectors.engine import Vectors, obstacle

    if why_not := obstacle(subject):
        if engine == VECTORS:
            LOG.warning("%s: FMUs do the runs, not vectors. %s", subject.scenario.path.name, why_not)
        return None
    return Vectors(subject)


def vector_executor(job: Job, subject: Subject, engine: str) -> VectorExecutor | None:
    """Who does the runs of a job, if vectors do; its task makes the answers of their results too."""
    vectors = vectors_for(subject, engine)
    return VectorExecutor(job, vectors, job.prepare(job.task)) if vectors else None


def run_as_vectors(scenario: Source, variant: str | None, fmus: str | Path | None, engine: str) -> Result | None:
    """A run of a scenario as vectors; nothing if FMUs are to do it, also to say what it fails of."""
    if not likely_vectors(engine):
        return None
    subject = Subject(*prepare(scenario, variant, fmus))
    take, vectors = subject.taken(), vectors_for(subject, engine)
    _, recording = next(vectors.record([take])) if vectors else (0, None)
    return result_of(subject, take, recording) if recording else None


def result_of(subject: Subject, take: Take, recording: Recording) -> Result:
    """Result of what vectors recorded, which says so."""
    result = finished(subject, take, recording)
    return replace(result, run=replace(result.run, versions={**result.run.versions, "loop": VECTORS}))


class VectorExecutor:
    """Threads that do runs as vectors; what is lost there is asked of a process with FMUs, which says why."""

    def __init__(self, job: Job, vectors: Vectors, runs: Any) -> None:
        self.job, self.vectors, self.runs = job, vectors, runs
        self.threads: list[Thread] = []
        self.server: Server | None = None
        self.lock, self.judging, self.is_over = Lock(), Lock(), False

    def start(self, pending: Pending, answers: Answers) -> None:
        """Start the threads."""
        for _ in range(self.job.workers):
            self.threads.append(Thread(target=self.feed, args=(pending, answers), daemon=True))
            self.threads[-1].start()

    def look(self) -> None:
        """End the process that does lost runs if it has made no progress for too long."""
        if self.server:
            self.server.process.check()

    def end(self) -> None:
        """Leave nothing behind."""
        self.is_over = self.vectors.is_stopped = True
        if self.server:
            self.server.dismiss()
        for thread in self.threads:
            thread.join()
        if self.server:
            self.server.close()

    def feed(self, pending: Pending, answers: Answers) -> None:
        """Do as many runs as a vector has numbers, again and again."""
        from gapsense.vectors.engine import Stopped

        try:
            while numbers := [*islice(pending, self.vectors.width)]:
                for entry in self.entries(numbers):
                    answers.put(entry)
        except Stopped:
            pass
        except Exception as error:  # handed to the main thread, which raises it
            answers.put(error)

    def entries(self, numbers: Sequence[int]) -> Iterator[Entry]:
        """Entries of some runs."""
        requests = [self.job.request(number) for number in numbers]
        takes = [self.vectors.subject.taken(asked["shift"], by_port(asked["values"])) for asked in requests]
        for place, recording in self.vectors.record(takes):
            number = numbers[place]
            if recording is None:
                yield self.lost(number, requests[place])
            else:
                with self.judging:  # which may call functions of others
                    result = result_of(self.vectors.subject, takes[place], recording)
                    yield {"index": number, **self.runs.answer(result, number)}

    def lost(self, number: int, request: Mapping[str, Any]) -> Entry:
        """Entry of a run that was lost, by FMUs."""
        with self.lock:
            self.server = self.server or Server(self.job)
            if self.is_over:
                self.server.dismiss()
            return self.server.answer(number, request)
