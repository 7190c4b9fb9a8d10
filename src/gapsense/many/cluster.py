"""The client's side of a campaign on a cluster of Dask: a short queue of tasks of some runs each."""

from __future__ import annotations

import logging
import shutil
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import CancelledError
from contextlib import contextmanager, suppress
from dataclasses import replace
from itertools import islice
from pathlib import Path
from pkgutil import resolve_name
from queue import Empty, Queue
from threading import Event, Lock, Thread
from time import monotonic
from typing import Any
from uuid import uuid4

from distributed import Client, KilledWorker, Security, WorkerPlugin, get_worker
from distributed.client import FutureCancelledError
from distributed.comm.addressing import parse_address
from distributed.comm.registry import get_backend

from gapsense._os.locks import temporary_folder
from gapsense._os.workers import LOOK, Answers, Entry, Job, Pending, Server
from gapsense.many.provenance import key
from gapsense.many.worker import Many
from gapsense.parameters import is_file
from gapsense.problems import InputError
from gapsense.tables import Value
from gapsense.version import __version__

PATIENCE = 30.0  # seconds until there must be an answer, or a worker
AHEAD = 2  # tasks per thread of the cluster, so that none waits for us
LASTING = 0.3  # seconds of a task: shorter ones cost more than they are worth
MOST = 200  # runs of a task
LOST = "the Dask scheduler has gone. Finished runs are kept: run the same command when it is back."
LOG = logging.getLogger(__name__)
ENCRYPTED = ("tls", "wss")
SETTINGS = (
    "the client's certificate, its key and the authority that signed all certificates: "
    "`DASK_DISTRIBUTED__COMM__TLS__CLIENT__CERT`, `..__CLIENT__KEY` and `..__CA_FILE`"
)
ASKING = 1.0  # seconds between two questions to the scheduler


class Cluster:
    """The workers of a Dask scheduler."""

    def __init__(self, address: str, many: Many, left: int) -> None:
        self.address, self.many, self.left = address, many, left
        self.name = f"gapsense-{uuid4().hex}"
        self.client: Any = None
        self.thread: Thread | None = None
        self.is_over, self.is_known = Event(), False

    def start(self, pending: Pending, answers: Answers) -> None:
        """Give every worker what it needs, and a thread of ours the work."""
        options = {
            "security": check_encryption(self.address),
            "timeout": PATIENCE,
            "set_as_default": False,
            "name": "gapsense",
        }
        try:
            self.client = Client(self.address, **options)  # type: ignore[no-untyped-call]
        except (OSError, ValueError) as error:  # of a timeout too
            said = str(error).partition("\n")[0].rstrip(".")
            raise InputError([f"there is no answer from a Dask scheduler at `{self.address}`: {said}."]) from None
        refuse_others(self.client, self.address)
        self.is_known = True
        self.client.register_plugin(Site(self.name, self.many))
        self.thread = Thread(target=self.feed, args=(self.client, pending, answers), daemon=True)
        self.thread.start()

    def look(self) -> None:
        """Nothing to be seen from here: what hangs is noticed by the worker that it hangs on."""

    def end(self) -> None:
        """Leave the cluster as it was."""
        self.is_over.set()
        if self.thread:
            self.thread.join()
        if self.is_known and self.client.status == "running":
            with suppress(OSError):  # the scheduler is gone, and the client does not know it yet
                self.client.unregister_worker_plugin(self.name)
        if self.client:
            self.client.close(timeout=PATIENCE)

    def feed(self, client: Any, pending: Pending, answers: Answers) -> None:
        """Keep the cluster busy and hand on what it answers."""
        try:
            feeder = Feeder(client, self.name, self.many, self.left)
            feeder.work(pending, answers, self.is_over)
        except Exception as error:  # handed to the main thread, which raises it
            answers.put(error)


class LostError(RuntimeError):
    """The scheduler is not there any more."""


class Feeder:
    """Tasks that are on their way."""

    def __init__(self, client: Any, name: str, many: Many, left: int) -> None:
        self.client, self.name, self.many, self.left = client, name, many, left
        self.flying: dict[Any, list[int]] = {}
        self.landed: Queue[Any] = Queue()
        self.again: deque[int] = deque()  # each in a task of its own
        self.threads, self.asked_at = 0, 0.0
        self.seconds = 0.0  # of a run, as it is lately

    def work(self, pending: Pending, answers: Answers, is_over: Event) -> None:
        """Send and receive until all is done."""
        while self.left and not is_over.is_set():
            self.listen()
            self.fill(pending)
            for future in self.wait():
                for entry in self.entries(future, self.flying.pop(future)):
                    self.left -= 1
                    answers.put(entry)
        for future in self.flying:
            future.cancel(force=True)

    def listen(self) -> None:
        """Ask how many threads there are; a LostError if nobody answers."""
        now = monotonic()
        if self.client.status != "running":
            raise LostError(LOST)
        if now - self.asked_at > ASKING:
            try:
                threads = sum(self.client.nthreads().values())
            except OSError:
                raise LostError(LOST) from None
            if not threads and self.threads:
                LOG.warning("the cluster has lost all its workers; waiting for new ones.")
            self.threads, self.asked_at = threads, now

    def fill(self, pending: Pending) -> None:
        """Send tasks until the queue is long enough."""
        while len(self.flying) < AHEAD * self.threads:
            if not (numbers := [self.again.popleft()] if self.again else [*islice(pending, self.size())]):
                return
            runs = [(number, self.many.request(number)) for number in numbers]
            future = self.client.submit(perform, self.name, runs, key=f"{self.name}-{uuid4().hex}", pure=False)
            self.flying[future] = numbers
            future.add_done_callback(self.landed.put)

    def size(self) -> int:
        """Runs of the next task."""
        wanted = int(LASTING / self.seconds) if self.seconds else 1
        return max(1, min(wanted, MOST, self.left // (2 * AHEAD * self.threads)))

    def wait(self) -> Iterator[Any]:
        """Tasks that have ended, after a short while none."""
        with suppress(Empty):
            yield self.landed.get(timeout=LOOK)
            while True:
                yield self.landed.get_nowait()

    def entries(self, future: Any, numbers: list[int]) -> list[Entry]:
        """Answers of a task. If a task has killed its workers, its runs are tried one by one."""
        try:
            entries: list[Entry] = future.result(timeout=PATIENCE)
        except KilledWorker as error:
            if len(numbers) == 1:
                return [{"index": numbers[0], "error": f"run: its workers on the cluster died: {error}"}]
            self.again.extend(numbers)
            return []
        except (CancelledError, FutureCancelledError, OSError):
            raise LostError(LOST) from None
        except TimeoutError:  # its worker has died since it ended, and it is done again
            self.flying[future] = numbers
            future.add_done_callback(self.landed.put)
            return []
        self.seconds = sum(entry.get("wall", 0.0) for entry in entries) / len(entries)
        return entries


def check_encryption(address: str) -> Security:
    """What Dask's own settings say of encryption; an InputError if the address does not go with them, or is none."""
    try:  # a client would be rid of one that is none after a minute only
        scheme, place = parse_address(address)
        get_backend(scheme).get_address_host(place)  # type: ignore[no-untyped-call]
    except (ValueError, OSError) as error:
        problem = f"`{address}` is not an address of a Dask scheduler ({error}). Give one such as `tcp://HOST:8786`."
        raise InputError([problem]) from None
    security = Security()  # type: ignore[no-untyped-call]
    if scheme not in ENCRYPTED:
        if security.require_encryption:
            raise InputError([f"`{address}` is not encrypted, but Dask's settings demand it. Give one with `tls://`."])
        return security
    try:
        has_all = security.get_connection_args("client")["ssl_context"]  # type: ignore[no-untyped-call]
    except OSError as error:
        raise InputError([f"`{address}`: the settings for TLS cannot be used ({error}). Correct {SETTINGS}."]) from None
    if not has_all:
        raise InputError([f"`{address}` needs settings for TLS, which are missing. Give Dask {SETTINGS}."])
    return security


def refuse_others(client: Any, address: str) -> None:
    """Raise InputError unless there are workers, and all of them have this Gapsense."""
    try:
        client.wait_for_workers(1, timeout=PATIENCE)
    except TimeoutError:
        problem = f"the scheduler at `{address}` has no workers. Start some: `dask worker {address}`."
        raise InputError([problem]) from None
    versions = client.run(resolve_name, "gapsense:__version__", on_error="return")
    problems = [
        f"{worker}: Gapsense is not installed there ({error}). Install it."
        for worker, error in versions.items()
        if isinstance(error, Exception)
    ]
    if not problems:
        own, found = identity(), client.run(identity, on_error="return")
        problems = [f"{worker}: {describe_difference(own, other)}" for worker, other in found.items() if other != own]
    if problems:
        raise InputError(problems)


def describe_difference(own: tuple[str, str], other: Any) -> str:
    """How the Gapsense of a worker differs."""
    if isinstance(other, Exception):
        return f"Gapsense does not start there: {other}."
    if other[0] != own[0]:
        return f"it has Gapsense {other[0]}, {own[0]} is expected. Install that."
    return "its sources of Gapsense or its version of numpy differ from those here. Install the same."


# The side of a worker: what each worker gets once, and the processes that it keeps.


REST = 60.0  # seconds after which a process is ended that nobody asks
Asked = tuple[int, Mapping[str, Any]]  # number and request


def identity() -> tuple[str, str]:
    """Version of Gapsense, and hash of all that decides results in it."""
    return __version__, key("campaign")


class Site(WorkerPlugin):
    """What a worker has of one campaign: a folder with its files, and a process for each of its threads.

    The client makes it, with the runs and the content of FMUs and files by their paths. These are whole, since workers
    have another working folder.
    """

    def __init__(self, name: str, many: Many) -> None:
        scenario = many.scenario
        whole = tuple(file.resolve() for file in scenario.files)
        self.name, self.identity = name, identity()
        self.many = replace(many, scenario=replace(scenario, path=scenario.path.resolve(), files=whole))
        files = (*(d.path for d in many.descriptions.values()), *whole, *(file.resolve() for file in many.files))
        self.contents = {str(file): file.read_bytes() for file in files}

    def setup(self, worker: Any) -> None:
        """Unpack the files."""
        if identity() != self.identity:
            raise RuntimeError(f"Gapsense {self.identity[0]} is expected here, another one was found.")
        self.folder = temporary_folder()
        self.paths: dict[str, str] = {}  # of the client's files, here
        for k, (path, content) in enumerate(self.contents.items()):
            file = self.folder / str(k) / Path(path).name
            file.parent.mkdir()
            file.write_bytes(content)
            self.paths[path] = str(file)
        self.job = self.make_job()
        self.servers: list[Server] = []  # at rest
        self.busy: list[Server] = []
        self.since, self.lock, self.is_over = monotonic(), Lock(), Event()
        Thread(target=self.watch, daemon=True).start()

    def teardown(self, worker: Any) -> None:
        """Leave nothing behind."""
        self.is_over.set()
        with self.lock:
            left = [*self.servers, *self.busy]
            self.servers = []
        for server in left:
            server.close()
        shutil.rmtree(self.folder, ignore_errors=True)

    def make_job(self) -> Job:
        """What the processes do, with the files that are here."""
        many, here = self.many, self.paths
        components = {n: replace(c, values=located_values(c.values, here)) for n, c in many.scenario.components.items()}
        files = tuple(Path(here[str(file)]) for file in many.scenario.files)
        descriptions = {n: replace(d, path=Path(here[str(d.path)])) for n, d in many.descriptions.items()}
        moved = replace(many.scenario, components=components, files=files)
        return replace(many, scenario=moved, descriptions=descriptions).job()

    def watch(self) -> None:
        """End processes that hang, and those that have nothing to do for long."""
        while not self.is_over.wait(LOOK):
            with self.lock:
                idle = self.servers if monotonic() - self.since > REST and not self.busy else []
                self.servers = [] if idle else self.servers
                busy = [*self.busy]
            for server in busy:
                server.process.check()
            for server in idle:
                server.close()

    @contextmanager
    def server(self) -> Iterator[Server]:
        """A process for as long as it is needed."""
        with self.lock:
            server = self.servers.pop() if self.servers else Server(self.job)
            self.busy.append(server)
        try:
            yield server
        except BaseException:
            server.close()
            self.release(server)
            raise
        self.release(server)
        with self.lock:
            self.servers.append(server)

    def release(self, server: Server) -> None:
        """Note that a process has nothing to do."""
        with self.lock:
            self.busy.remove(server)
            self.since = monotonic()

    def answers(self, asked: Sequence[Asked]) -> list[Entry]:
        """Entries of some runs."""
        with self.server() as server:
            moved = ((n, {**own, "values": located_values(own["values"], self.paths)}) for n, own in asked)
            return [server.answer(number, request) for number, request in moved]


def located_values(values: Mapping[str, Value], here: Mapping[str, str]) -> dict[str, Value]:
    """Values of parameters with the files that are here."""
    return {name: here.get(str(value), value) if is_file(name, value) else value for name, value in values.items()}


def perform(name: str, asked: Sequence[Asked]) -> list[Entry]:
    """Do some runs of a campaign, as a task of a worker."""
    site: Any = get_worker().plugins[name]
    answers: list[Entry] = site.answers(asked)
    return answers
