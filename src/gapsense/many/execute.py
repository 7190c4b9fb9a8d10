"""Do the runs that are missing, and keep each as it ends: as vectors, in processes here, or on a cluster."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import islice
from threading import Lock, Thread
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from gapsense._os.workers import Answers, Entry, Executor, Job, Local, Pending, Progress, Server, work
from gapsense.cosim.run.ahead import FMU, VECTORS
from gapsense.cosim.run.engines import result_of, vectors_for
from gapsense.cosim.run.recording import Subject
from gapsense.many.columns import contents
from gapsense.many.store import Store
from gapsense.many.worker import Many, by_port

if TYPE_CHECKING:
    from gapsense.vectors.engine import Vectors


class Done(NamedTuple):
    """The outcome: runs done now, whether Ctrl-C ended them, and the engine that did them."""

    computed: int
    interrupted: bool
    engine: str


def complete(
    many: Many, store: Store, workers: int, engine: str, scheduler: str | None = None, progress: Progress | None = None
) -> Done:
    """Do the runs of a plan that are not in a store yet."""
    total = len(many.plan)
    missing = np.setdiff1d(np.arange(total), store.runs(below=total), assume_unique=True)
    executor, by = executor_of(many, len(missing), workers, engine, scheduler)

    def keep(came: Sequence[Entry]) -> None:
        store.add(*contents(many.columns, [{**many.request(entry["index"]), **entry} for entry in came]))

    return Done(*compute_missing(executor, missing.tolist(), total, keep, progress), by)


def compute_missing(
    executor: Executor,
    missing: Sequence[int],
    total: int,
    keep: Callable[[Sequence[Entry]], None],
    progress: Progress | None,
) -> tuple[int, bool]:
    """Let an executor do the missing ones of `total` runs; return how many were done, and whether Ctrl-C ended it."""
    tell, before, count = progress or (lambda done, total: None), total - len(missing), 0

    def take(came: Sequence[Entry]) -> None:
        nonlocal count
        keep(came)
        for _ in came:
            count += 1
            tell(before + count, total)

    tell(before, total)
    interrupted = work(executor, missing, len(missing), take)
    return count, interrupted


def executor_of(many: Many, missing: int, workers: int, engine: str, scheduler: str | None) -> tuple[Executor, str]:
    """The executor that does the runs, and its engine."""
    if scheduler is not None:
        from gapsense.many.cluster import Cluster  # here, since it takes a while to load

        return Cluster(scheduler, many, missing), FMU
    job = many.job(workers)
    vectors = vectors_for(Subject(many.scenario, many.descriptions), engine) if missing else None
    return (VectorExecutor(job, vectors), VECTORS) if vectors else (Local(job, missing), FMU)


def processors() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class VectorExecutor:
    """Threads that do runs as vectors. A lost run is done again by a process with FMUs, which says why."""

    def __init__(self, job: Job, vectors: Vectors) -> None:
        self.job, self.vectors = job, vectors
        self.runs: Any = job.prepare(job.task)  # makes the answers, as in a worker
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
        from gapsense.vectors.engine import Stopped  # here, since it takes a while to load

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
        takes = [self.vectors.subject.make_take(asked["shift"], by_port(asked["values"])) for asked in requests]
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
