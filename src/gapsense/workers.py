"""Worker processes that answer numbers with results; what is in the ledger is not computed again.

`python -m gapsense.workers` is one of them, which ends with its input.  Requests and answers are lines of JSON.  The
first request names a function and its task, and `function(task)` gives the function that answers; every further
request is a number.
"""

from __future__ import annotations

import importlib
import json
import os
import shutil
import subprocess
import sys
from collections import deque
from collections.abc import Callable, Collection, Mapping
from contextlib import suppress
from pathlib import Path
from queue import Queue
from threading import Thread
from typing import Any, NamedTuple, TextIO

from gapsense.files import sha256
from gapsense.ledger import Entry, Ledger
from gapsense.locks import temporary_folder
from gapsense.problems import ScenarioError
from gapsense.shipped import PACKAGE

Answer = Callable[[int], Mapping[str, Any]]
Progress = Callable[[int, int], None]
PATIENCE = 1.0  # seconds that a process may take to end by itself
SHOWN = 2000  # characters of a crashed process's last words


class Job(NamedTuple):
    """What workers do: `prepare(task)`, once in each of them, gives the function from a number to its answer."""

    prepare: Callable[[Any], Answer]
    task: Mapping[str, Any]  # of JSON
    workers: int
    guest: Callable[..., Any] | None = None  # function of any module that the task names


def complete(
    job: Job, numbers: Collection[int], known: dict[int, Entry], ledger: Ledger, progress: Progress | None
) -> bool:
    """Compute the entries of `numbers` that are not in `known`, add them to it and to the ledger; true after Ctrl-C."""
    tell, total = progress or (lambda done, total: None), len(numbers)
    pending = deque(number for number in numbers if number not in known)
    left = range(total - len(pending), total)
    answers: Queue[Entry | Exception] = Queue()
    processes: list[Worker] = []
    try:
        for _ in left[: job.workers]:
            processes.append(Worker(job))
            Thread(target=feed, args=(processes[-1], pending, answers), daemon=True).start()
        for done in left:
            tell(done, total)
            answer = answers.get()
            if isinstance(answer, Exception):
                raise answer
            known[answer["index"]] = answer
            ledger.append(answer)
        tell(total, total)
    except KeyboardInterrupt:
        return True
    finally:
        pending.clear()
        for process in processes:
            process.close()
    return False


def feed(process: Worker, pending: deque[int], answers: Queue[Entry | Exception]) -> None:
    """Give one process number after number until none is left."""
    try:
        process.prepare()
        while pending:
            answers.put(process.ask(pending.popleft()))
    except IndexError:
        return  # another thread took the last one
    except Exception as error:  # handed to the main thread, which raises it
        answers.put(error)


class Worker:
    """One process, seen from the one that asks it; it does not get the terminal's Ctrl-C."""

    def __init__(self, job: Job) -> None:
        self.job = job
        self.folder = temporary_folder()
        self.log = self.folder / "errors.txt"
        roots = [PACKAGE.parent, *([root(job.guest)] if job.guest else [])]
        paths = os.pathsep.join([*map(str, roots), os.environ.get("PYTHONPATH", "")]).rstrip(os.pathsep)
        temporary = dict.fromkeys(("TMPDIR", "TEMP", "TMP"), str(self.folder))
        with self.log.open("wb") as errors:
            self.process = subprocess.Popen(
                [sys.executable, "-m", "gapsense.workers"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=errors,
                text=True,
                encoding="utf-8",
                env={**os.environ, **temporary, "PYTHONPATH": paths},
                start_new_session=True,
            )

    def prepare(self) -> None:
        """Wait until it has prepared for its task."""
        request = {"prepare": importable_name(self.job.prepare), "task": self.job.task}
        if problems := self.talk(json.dumps(request), "starting")["problems"]:
            raise ScenarioError(problems)

    def ask(self, number: int) -> Entry:
        """Entry of one run."""
        return {"index": number, **self.talk(str(number), f"run {number}")}

    def talk(self, line: str, doing: str) -> Entry:
        """Send one line, return the answer; raise RuntimeError if the process has died of it."""
        with suppress(OSError):  # if it has died; the missing answer tells so below
            print(line, file=self.process.stdin, flush=True)
        answer = self.process.stdout.readline() if self.process.stdout else ""
        if not answer.endswith("\n"):
            words = self.log.read_text(encoding="utf-8", errors="replace").strip()
            said = words[-SHOWN:] or "it wrote nothing. Run that seed alone with `run`."
            raise RuntimeError(f"a worker process died ({self.process.wait()}) at {doing}: {said}")
        parsed: Entry = json.loads(answer)
        return parsed

    def close(self) -> None:
        """End the process, in the middle of a run if need be, and remove its temporary files."""
        with self.process:
            try:
                if self.process.stdin:
                    self.process.stdin.close()
                self.process.wait(timeout=PATIENCE)
            except (OSError, subprocess.TimeoutExpired):
                self.process.kill()
        shutil.rmtree(self.folder, ignore_errors=True)


def importable_name(function: Callable[..., Any]) -> str:
    """`module:function`, under which a worker finds the function."""
    module, name = function.__module__, function.__qualname__
    if module == "__main__" or "<" in name or "." in name:
        raise ValueError(f"`{name}` of `{module}`: workers cannot import it. Put it at the top level of a module.")
    return f"{module}:{name}"


def imported(name: str) -> Any:
    """Function called `module:function`."""
    module, _, function = name.partition(":")
    return getattr(importlib.import_module(module), function)


def facts(function: Callable[..., Any]) -> list[str]:
    """Name of a function and hash of its module's file, for `ledger.key`."""
    return [importable_name(function), sha256(source_file(function))]


def root(function: Callable[..., Any]) -> Path:
    """Folder from which the module of a function is imported."""
    file = source_file(function)
    return file.parents[function.__module__.count(".") + (file.name == "__init__.py")]


def source_file(function: Callable[..., Any]) -> Path:
    """File of a function's module."""
    return Path(str(sys.modules[function.__module__].__file__)).resolve()


def main() -> None:
    """Be a worker: answer requests until the input ends."""
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)  # what FMUs print goes to the error stream from now on
    sys.stdout = sys.stderr
    request = json.loads(sys.stdin.readline())
    try:
        answer: Answer = imported(request["prepare"])(request["task"])
    except ScenarioError as error:
        return send(answers, {"problems": error.problems})
    send(answers, {"problems": []})
    for line in sys.stdin:
        send(answers, answer(int(line)))


def send(answers: TextIO, message: Mapping[str, Any]) -> None:
    """Write one answer."""
    print(json.dumps(message), file=answers, flush=True)


if __name__ == "__main__":
    main()
