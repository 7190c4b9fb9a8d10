"""The worker's side of a campaign on a cluster: files that come once, and processes that do run after run."""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from threading import Event, Lock, Thread
from time import monotonic
from typing import Any

from distributed import WorkerPlugin, get_worker

from gapsense._os.locks import temporary_folder
from gapsense._os.workers import LOOK, Entry, Job, Server
from gapsense.cosim.scenario.records import Component
from gapsense.many.provenance import key
from gapsense.many.worker import Many
from gapsense.parameters import is_file
from gapsense.tables import Value
from gapsense.version import __version__

REST = 60.0  # seconds after which a process is ended that nobody asks
Asked = tuple[int, Mapping[str, Any]]  # number and request


def identity() -> tuple[str, str]:
    """Version of Gapsense, and hash of all that decides results in it."""
    return __version__, key("campaign")


@dataclass
class Pack:
    """What a worker gets once: the runs, and the content of FMUs and files by their paths at the client's."""

    many: Many
    files: dict[str, bytes]
    identity: tuple[str, str] = field(default_factory=identity)


class Site(WorkerPlugin):
    """What a worker has of one campaign: a folder with its files, and a process for each of its threads."""

    def __init__(self, name: str, pack: Pack) -> None:
        self.name, self.pack = name, pack

    def setup(self, worker: Any) -> None:
        """Unpack the files."""
        if identity() != self.pack.identity:
            raise RuntimeError(f"Gapsense {self.pack.identity[0]} is expected here, another one was found.")
        self.folder = temporary_folder()
        self.paths = {path: str(self.unpacked(k, path)) for k, path in enumerate(self.pack.files)}
        self.job = self.made()
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

    def unpacked(self, number: int, path: str) -> Path:
        """A file of the client's, here."""
        file = self.folder / str(number) / Path(path).name
        file.parent.mkdir()
        file.write_bytes(self.pack.files[path])
        return file

    def made(self) -> Job:
        """What the processes do, with the files that are here."""
        many, here = self.pack.many, self.paths
        components = {name: located(component, here) for name, component in many.scenario.components.items()}
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
            return [server.answer(number, located_request(request, self.paths)) for number, request in asked]


def located(component: Component, here: Mapping[str, str]) -> Component:
    """A component with the files that are here."""
    return replace(component, values=located_values(component.values, here))


def located_values(values: Mapping[str, Value], here: Mapping[str, str]) -> dict[str, Value]:
    """Values of parameters with the files that are here."""
    return {name: here.get(str(value), value) if is_file(name, value) else value for name, value in values.items()}


def located_request(request: Mapping[str, Any], here: Mapping[str, str]) -> dict[str, Any]:
    """A request with the files that are here."""
    return {**request, "values": located_values(request["values"], here)}


def perform(name: str, asked: Sequence[Asked]) -> list[Entry]:
    """Do some runs of a campaign, as a task of a worker."""
    site: Any = get_worker().plugins[name]
    answers: list[Entry] = site.answers(asked)
    return answers
