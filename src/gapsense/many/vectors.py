"""The executor that does runs as vectors, in threads."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from threading import Lock, Thread
from typing import Any

from gapsense._os.workers import Answers, Entry, Job, Pending, Server
from gapsense.cosim.run.engines import result_of
from gapsense.many.worker import by_port
from gapsense.vectors.engine import Stopped, Vectors


class VectorExecutor:
    """Threads that do runs as vectors; what is lost there is asked of a process with FMUs, which says why."""

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
