"""Worker processes that answer numbers with results."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from queue import Empty, Queue
from threading import Lock, Thread
from typing import Any, NamedTuple, Protocol

from gapsense._os.interrupts import count_interrupts
from gapsense._os.processes import Died, Marks, process

Entry = dict[str, Any]  # a number, `index`, and what was answered
Answer = Callable[[Any], Mapping[str, Any]]
Progress = Callable[[int, int], None]
LOOK = 0.1  # seconds between two looks at the processes


class Job(NamedTuple):
    """What workers do: `prepare(task)` runs once in each worker, and returns the function from a request to its answer.

    If a process dies, `on_worker_death` makes an answer of its marks, and another process goes on. Without it the first
    death ends them all. `request` makes the request for a number; by default that is the number itself.
    """

    prepare: Callable[[Any], Answer]
    task: Mapping[str, Any]  # of JSON
    workers: int
    guest: Callable[..., Any] | None = None  # function of any module that the task names
    on_worker_death: Callable[[Died, Marks], Mapping[str, Any]] | None = None
    limit: float | None = None  # [s], see `Process`
    request: Callable[[int], Any] = int
    tries: int = 1  # how often a number is asked whose process dies


class Pending:
    """Numbers that several threads take, each of them once, until they are told to stop."""

    def __init__(self, numbers: Iterable[int]) -> None:
        self.numbers, self.lock, self.is_over = iter(numbers), Lock(), False

    def __iter__(self) -> Iterator[int]:
        return self

    def __next__(self) -> int:
        with self.lock:
            if self.is_over:
                raise StopIteration
            return next(self.numbers)

    def stop(self) -> None:
        """Give out no more."""
        self.is_over = True


Answers = Queue["Entry | Exception"]


class Executor(Protocol):
    """Whoever takes pending numbers and answers them, here or elsewhere, until none is left."""

    def start(self, pending: Pending, answers: Answers) -> None:
        """Begin; an exception among the answers ends the work."""

    def look(self) -> None:
        """Notice what does not answer; called now and then."""

    def end(self) -> None:
        """Leave nothing behind, also after half a start."""


def work(executor: Executor, numbers: Iterable[int], count: int, keep: Callable[[Sequence[Entry]], None]) -> bool:
    """Hand `count` numbers to an executor, and each answer to `keep` as it arrives. Returns True after Ctrl-C."""
    pending, answers = Pending(numbers), Answers()
    with count_interrupts() as interrupts:  # also while the workers are started and ended: none is forgotten
        try:
            if count:
                executor.start(pending, answers)
            while count > 0:
                if not (came := wait_for_answers(answers, executor.look, interrupts)):
                    return True
                keep(came)
                count -= len(came)
        finally:
            pending.stop()
            executor.end()
    return False


def wait_for_answers(answers: Answers, look: Callable[[], None], interrupts: Callable[[], int]) -> list[Entry]:
    """The answers that have come, at least one, or none after a Ctrl-C; raises what a worker could not answer."""
    while not interrupts():
        try:
            answer = answers.get(timeout=LOOK)
        except Empty:
            look()
            continue
        if isinstance(answer, Exception):
            raise answer
        return [answer, *waiting(answers)]
    return []


def waiting(answers: Answers) -> Iterator[Entry]:
    """What has come besides: where that is faster than the disk, it is written together."""
    with suppress(Empty):
        while not isinstance(answer := answers.get_nowait(), Exception):
            yield answer
        answers.put(answer)  # for the next look, when all that came before is written


class Local:
    """The executor of this machine: as many processes as the job says, at most one for each number."""

    def __init__(self, job: Job, most: int) -> None:
        self.job, self.count = job, min(job.workers, most)
        self.servers: list[Server] = []
        self.threads: list[Thread] = []

    def start(self, pending: Pending, answers: Answers) -> None:
        """Start the processes, and a thread for each that asks it."""
        for _ in range(self.count):
            self.servers.append(Server(self.job))
            self.threads.append(Thread(target=feed, args=(self.servers[-1], pending, answers), daemon=True))
            self.threads[-1].start()

    def look(self) -> None:
        """End the processes that have made no progress for too long."""
        for server in self.servers:
            server.process.check()

    def end(self) -> None:
        """End them all at the same time, since each takes a while."""
        for server in self.servers:
            server.dismiss()
        for server, thread in zip(self.servers, self.threads):
            server.close()
            thread.join()
            server.close()  # the thread may have started one meanwhile


def feed(server: Server, pending: Pending, answers: Answers) -> None:
    """Ask a process for one number after the other."""
    try:
        server.ready()
        for number in pending:
            answers.put(server.answer(number, server.job.request(number)))
    except Exception as error:  # handed to the main thread, which raises it
        answers.put(error)


class Server:
    """A process that is asked for numbers; after its death another one goes on."""

    def __init__(self, job: Job) -> None:
        self.job, self.is_closed, self.is_ready, self.is_gone = job, False, False, False
        self.process = process(job.guest, job.limit)

    def ready(self) -> None:
        """Have a process that is prepared."""
        if self.is_gone:
            self.process = process(self.job.guest, self.job.limit)
            self.is_ready = self.is_gone = False
        if not self.is_ready:
            self.process.prepare(self.job.prepare, self.job.task)
            self.is_ready = True

    def answer(self, number: int, request: Any) -> Entry:
        """Entry of a request, from another process if one dies of it and it is to be tried again."""
        for _ in range(self.job.tries):
            self.ready()
            try:
                return {"index": number, **self.process.ask(request, f"run {number}")}
            except Died as died:
                if self.job.on_worker_death is None or self.is_closed:
                    raise
                entry = {"index": number, **self.job.on_worker_death(died, self.process.marks)}
            self.process.close()
            self.is_gone = True
        return entry

    def dismiss(self) -> None:
        """Tell the process to end."""
        self.is_closed = True
        self.process.dismiss()

    def close(self) -> None:
        """End the process."""
        self.dismiss()
        self.process.close()
