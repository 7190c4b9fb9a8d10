"""What is tested: every FMU, of each kind, in a process of its own."""

from __future__ import annotations

import json
import subprocess
import sys
import zipfile
from pathlib import Path
from select import select
from typing import Any, NamedTuple
from xml.etree import ElementTree

from gapsense.fmi.ports import Component, Port
from gapsense.fmi.sentences import say

OK, WARNING, DISCARD, ERROR, FATAL = range(5)
COSIMULATION = 1
PATIENCE = 600.0  # s, with one list of calls
PLATFORM, SUFFIX = {"win32": ("win64", "dll"), "darwin": ("darwin64", "dylib")}.get(sys.platform, ("linux64", "so"))


class Answer(NamedTuple):
    """Of one call."""

    status: int
    value: Any
    log: list[tuple[str, int, str, str]]  # instance, status, category, text


class HostEnded(AssertionError):
    """The process of the host has ended, by the call that was tried."""


class Subject:
    """An unpacked FMU, and the host that runs it."""

    def __init__(self, component: Component, kind: str, path: Path, folder: Path) -> None:
        self.component, self.kind, self.folder = component, kind, folder
        with zipfile.ZipFile(path) as archive:
            archive.extractall(folder)
            about = ElementTree.fromstring(archive.read("modelDescription.xml")).attrib
            self.guid = about.get("guid") or about["instantiationToken"]
        self.resources = (folder / "resources").as_uri()
        self.step = self._step()
        self.process: subprocess.Popen[str] | None = None

    def _step(self) -> float:
        """Of the tests: a long experiment says that little happens in a few hundred of its own steps."""
        return self.component.step_size * max(1, round(self.component.stop_time / self.component.step_size / 5000))

    def ask(self, *calls: tuple[Any, ...]) -> list[Answer]:
        """Have calls made; the process is started when it is needed."""
        if self.process is None or self.process.poll() is not None:
            library = self.folder / "binaries" / PLATFORM / f"{self.component.name}.{SUFFIX}"
            command = [sys.executable, "-I", str(Path(__file__).with_name("raw_host.py")), str(library)]
            pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True, "encoding": "utf-8"}
            self.process = subprocess.Popen(command, **pipes)  # type: ignore[call-overload]
        assert self.process is not None and self.process.stdin is not None and self.process.stdout is not None
        self.process.stdin.write(json.dumps(calls) + "\n")
        self.process.stdin.flush()
        if PLATFORM != "win64" and not select([self.process.stdout], [], [], PATIENCE)[0]:
            self.process.kill()
        line = self.process.stdout.readline()
        if not line:
            raise HostEnded(f"the host has ended with {self.process.wait()} at one of {str(calls)[:2000]}")
        return [Answer(status, value, [tuple(entry) for entry in log]) for status, value, log in json.loads(line)]

    def close(self) -> int:
        """Let the host end in its own way; its exit code."""
        if self.process is None or self.process.poll() is not None:
            return 0 if self.process is None else int(self.process.returncode)
        assert self.process.stdin is not None
        self.process.stdin.close()
        return int(self.process.wait(60))

    def instantiate(self, name: str | None = "one", **other: Any) -> Answer:
        """Make an instance, or have it refused."""
        given = {"kind": COSIMULATION, "guid": self.guid, "resources": self.resources, "log": 1, **other}
        return self.ask(("instantiate", 0, name, *given.values()))[0]

    def new(self, name: str = "one") -> Instance:
        """A new instance."""
        answer = self.instantiate(name)
        assert answer.value is not None, answer
        return Instance(self, answer.value, name)

    def refs(self, causality: str, kind: str = "Real") -> list[int]:
        """Value references."""
        return [k for k, p in enumerate(self.component.ports) if p.causality == causality and p.kind == kind]

    def said(self, text: str, name: str = "one") -> str:
        """A message of an instance, but for those of steps."""
        return say("said", name, self.component.name, text)

    @property
    def period(self) -> float:
        """The sampling period, or 0."""
        return next((float(p.start) for p in self.component.ports if p.name == "sample_time"), 0.0)


class Instance:
    """One instance in the host."""

    def __init__(self, subject: Subject, number: int, name: str) -> None:
        self.subject, self.number, self.name, self.time = subject, number, name, 0.0

    def do(self, call: str, *arguments: Any) -> Answer:
        """Make one call."""
        return self.subject.ask((call, self.number, *arguments))[0]

    def all(self, *calls: tuple[Any, ...]) -> list[Answer]:
        """Make calls, all of which must succeed."""
        answers = self.subject.ask(*((name, self.number, *arguments) for name, *arguments in calls))
        assert [answer for answer in answers if answer.status] == []
        return answers

    def bring(self, phase: str, time: float = 0.0) -> Instance:
        """Bring a new or reset instance into a phase."""
        calls: list[tuple[Any, ...]] = [("SetupExperiment", 0, 0.0, time, 0, 0.0), ("EnterInitializationMode",)]
        calls += [("ExitInitializationMode",), ("Terminate",)]
        count = {"instantiated": 0, "initializing": 2, "running": 3, "terminated": 4, "failed": 3}[phase]
        self.all(*calls[:count])
        if phase == "failed":
            assert self.do("DoStep", time, -1.0, 1).status == ERROR
        self.time = time
        return self

    def again(self, phase: str, time: float = 0.0) -> Instance:
        """Reset, and bring into a phase."""
        self.all(("Reset",))
        return self.bring(phase, time)

    def set(self, port: Port, value: Any) -> Answer:
        """Set one variable."""
        return self.do(f"Set{port.kind}", [self.subject.component.ports.index(port)], [value])

    def outputs(self) -> list[float]:
        """All outputs."""
        found: list[float] = self.all(("GetReal", self.subject.refs("output")))[0].value
        return found

    def values(self) -> list[Any]:
        """All variables that can be read; not the outputs, which would be computed while initialising."""
        calls = [(f"Get{kind}", self.subject.refs(c, kind)) for kind in KINDS for c in ("input", "parameter")]
        return [answer.value for answer in self.all(*calls)]

    def run(self, rows: list[list[float]], step: float = 0.0) -> list[list[float]]:
        """Outputs after steps with these inputs."""
        inputs, outputs, h = self.subject.refs("input"), self.subject.refs("output"), step or self.subject.step
        calls: list[tuple[Any, ...]] = []
        for row in rows:
            calls += [("SetReal", inputs, row), ("DoStep", self.time, h, 1), ("GetReal", outputs)]
            self.time += h
        return [answer.value for answer in self.all(*calls)[2::3]]


KINDS = ("Real", "Integer", "Boolean", "String")


def refused(answer: Answer, text: str, name: str = "one") -> None:
    """Assert that a call was refused, with one message."""
    assert (answer.status, answer.log) == (ERROR, [(name, ERROR, "logStatusError", text)])
