"""Worker processes that answer numbers with results; what is in the ledger is not computed again."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import suppress
from queue import Empty, Queue
from threading import Thread
from typing import Any, NamedTuple

from gapsense.interrupts import counted
from gapsense.ledger import Entry, Ledger
from gapsense.processes import Died, Marks
from gapsense.spare import process

Answer = Callable[[int], Mapping[str, Any]]
Progress = Callable[[int, int], None]
LOOK = 0.1  # seconds between two looks at the processes


class Job(NamedTuple):
    """What workers do: `prepare(task)`, once in each of them, gives the function from a number to its answer.

    `mourn` makes an answer of the death of a process, by its marks, and then another process goes on; without it the
    first death ends them all.
    """

    prepare: Callable[[Any], Answer]
    task: Mapping[str, Any]  # of JSON
    workers: int
    guest: Callable[..., Any] | None = None  # function of any module that the task names
    mourn: Callable[[Died, Marks], Mapping[str, Any]] | None = None
    limit: float | None = None  # [s], see `Process`


def complete(
    job: Job, numbers: Collection[int], known: dict[int, Entry], ledger: Ledger, progress: Progress | None
) -> bool:
    """Compute the entries of `numbers` that are not in `known`, add them to it and to the ledger; true after Ctrl-C."""
    tell, total = progress or (lambda done, total: None), len(numbers)
    pending = deque(number for number in numbers if number not in known)
    left = range(total - len(pending), total)
    workers: list[Worker] = []
    answers: Queue[Entry | Exception] = Queue()
    with counted() as interrupts:  # also while the workers are started and ended: none is forgotten
        try:
            for _ in left[: job.workers]:
                workers.append(Worker(job, pending, answers))
            tell(done := left.start, total)
            while done < total:
                came = awaited(answers, workers, interrupts)
                if not came:
                    return True
                known.update((answer["index"], answer) for answer in came)
                ledger.append(*came)
                for _ in came:
                    tell(done := done + 1, total)
        finally:
            pending.clear()
            for worker in workers:
                worker.dismiss()  # all at once, since it takes them a while
            for worker in workers:
                worker.close()
    return False


def awaited(answers: Queue[Entry | Exception], workers: list[Worker], interrupts: Callable[[], int]) -> list[Entry]:
    """The answers that have come, at least one, or none after a Ctrl-C; raises what a worker could not answer."""
    while not interrupts():
        try:
            answer = answers.get(timeout=LOOK)
        except Empty:
            for worker in workers:
                worker.process.check()
            continue
        if isinstance(answer, Exception):
            raise answer
        return [answer, *waiting(answers)]
    return []


def waiting(answers: Queue[Entry | Exception]) -> Iterator[Entry]:
    """What has come besides: where that is faster than the disk, it is written together."""
    with suppress(Empty):
        while not isinstance(answer := answers.get_nowait(), Exception):
            yield answer
        answers.put(answer)  # for the next look, when all that came before is written


class Worker:
    """A process that is asked number after number by a thread of its own, until none is left."""

    def __init__(self, job: Job, pending: deque[int], answers: Queue[Entry | Exception]) -> None:
        self.job, self.pending, self.answers, self.is_closed = job, pending, answers, False
        self.process = process(job.guest, job.limit)
        self.thread = Thread(target=self.feed, daemon=True)
        self.thread.start()

    def feed(self) -> None:
        """Ask for one number after the other."""
        try:
            self.process.prepare(self.job.prepare, self.job.task)
            while self.pending:
                self.answers.put(self.entry(self.pending.popleft()))
        except IndexError:
            return  # another thread took the last one
        except Exception as error:  # handed to the main thread, which raises it
            self.answers.put(error)

    def entry(self, number: int) -> Entry:
        """Entry of one number, from another process if this one dies of it."""
        try:
            return {"index": number, **self.process.ask(number, f"run {number}")}
        except Died as died:
            if self.job.mourn is None or self.is_closed:
                raise
            entry = {"index": number, **self.job.mourn(died, self.process.marks)}
        self.process.close()
        if self.pending:
            self.process = process(self.job.guest, self.job.limit)
            self.process.prepare(self.job.prepare, self.job.task)
        return entry

    def dismiss(self) -> None:
        """Tell the process to end."""
        self.is_closed = True
        self.process.dismiss()

    def close(self) -> None:
        """End the process."""
        self.dismiss()
        self.process.close()
        self.thread.join()
        self.process.close()  # of one that the thread has started meanwhile
