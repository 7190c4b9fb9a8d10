"""Processes that answer requests. If one crashes or hangs, nothing else does, and it is known what became of it.

Each process ends when its input ends, or when the process ends that started it. All that it has started ends with it.
It imports nothing from the working folder.

Requests and answers are lines of JSON. The first request names a function and its task: `function(task)` gives the
function that answers all other requests. Numbers in shared memory, the marks of a process, say what it is doing, also
after its end.
"""

from __future__ import annotations

import atexit
import faulthandler
import json
import mmap
import os
import shutil
import signal
import subprocess
import sys
import warnings
from array import array
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from importlib import import_module
from pathlib import Path
from threading import Event, Thread
from time import monotonic, sleep
from typing import Any, TextIO, TypeAlias

from gapsense._os.importable import import_function, importable_name, python, root, search_path
from gapsense._os.locks import temporary_folder
from gapsense.problems import ScenarioError
from gapsense.shipped import PACKAGE

FOLDER = "GAPSENSE_PROCESS"  # variable of the environment: the folder of the process, which is its own
MARKS = 8
PATIENCE = 1.0  # seconds that a process may take to end by itself
LOOK = 0.2  # seconds between two looks at whether the other process is still there
GLANCE = 0.002  # seconds between two looks at whether a process that was told to end has ended
START = (
    "[_signal.signal(s, _signal.SIG_IGN) for n in ('SIGINT', 'SIGTERM', 'SIGHUP') if (s := getattr(_signal, n, 0))]; "
    "import gc; gc.set_threshold(200_000); from gapsense._os.processes import main; main()"
)
ROUNDS = 20  # in which processes are ended that start others meanwhile
SHOWN = 2000  # characters of a process's last words
Marks: TypeAlias = "memoryview[int] | array[int]"  # whole numbers in memory


class Died(RuntimeError):
    """The process ended instead of answering: `cause` says how, `words` is the last that it wrote."""

    def __init__(self, cause: str, words: str, doing: str) -> None:
        self.cause, self.words = cause, words
        super().__init__(f"a worker process died at {doing}: {cause}: {words or 'it wrote nothing.'}")


class Process:
    """One process, as the one that asks it sees it; it does not get the terminal's Ctrl-C.

    With a `limit` [s], `check` ends it if it has neither answered nor changed its marks for so long. It imports the
    modules in `load` before it is asked for anything.
    """

    def __init__(
        self, guest: Callable[..., Any] | None = None, limit: float | None = None, load: Sequence[str] = ()
    ) -> None:
        self.limit, self.is_overdue, self.is_busy, self.is_limited = limit, False, False, False
        self.seen, self.since = b"", monotonic()
        self.folder = temporary_folder()
        try:
            self.start(guest, load)
        except OSError as error:  # no pipe has a name
            error.filename = error.filename or str(self.folder)
            raise

    def start(self, guest: Callable[..., Any] | None, load: Sequence[str]) -> None:
        """Start it, in a folder of its own."""
        (self.folder / "marks").write_bytes(bytes(8 * MARKS))
        self.marks = map_numbers(self.folder / "marks")
        behind = str(root(guest)) if guest else ""
        own = dict.fromkeys(("TMPDIR", "TEMP", "TMP", FOLDER), str(self.folder))
        with (self.folder / "errors.txt").open("wb") as errors:
            self.process = subprocess.Popen(
                python(START, behind, *load),
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=errors,
                text=True,
                encoding="utf-8",
                env={**os.environ, **own, "PYTHONPATH": search_path(PACKAGE.parent)},
                start_new_session=True,
            )
        self.log, self.told = (self.folder / "errors.txt").open("rb"), 0

    def prepare(self, function: Callable[[Any], Callable[[Any], Any]], task: Any) -> None:
        """Wait until it has prepared for its task."""
        request = {"prepare": importable_name(function), "task": task}
        if problems := self.ask(request, "the start", is_limited=False)["problems"]:
            raise ScenarioError(problems)

    def ask(self, request: Any, doing: str, is_limited: bool = True) -> Any:
        """The answer to a request of JSON; raise Died if the process has died of it."""
        self.since, self.is_busy, self.is_limited = monotonic(), True, is_limited
        with suppress(OSError):  # if it has died; the missing answer tells so below
            print(json.dumps(request), file=self.process.stdin, flush=True)
        answer = self.process.stdout.readline() if self.process.stdout else ""
        if not answer.endswith("\n"):
            self.is_limited = False  # its end is waited for, not its answer
            cause = self.ending()
            self.is_busy = False
            raise Died(cause, self.words(), doing)
        self.is_busy = self.is_limited = False
        return json.loads(answer)

    def check(self) -> None:
        """End the process if it has made no progress for longer than its limit; clean up if it has ended."""
        if self.is_busy and self.process.poll() is not None:
            return self.kill()  # what it has started may hold the pipe on which an answer is awaited
        seen, now = bytes(self.marks), monotonic()
        if seen != self.seen:
            self.seen, self.since = seen, now
        elif self.limit is not None and self.is_limited and now - self.since > self.limit:
            self.is_overdue = True
            self.kill()

    def kill(self) -> None:
        """End the process and all that it has started."""
        self.process.kill()
        if os.name == "posix":
            with suppress(OSError):
                os.killpg(self.process.pid, signal.SIGKILL)
        end_descendants(self.folder)

    def news(self) -> str:
        """What it has written on its error stream since this was asked last."""
        self.log.seek(self.told)
        new = self.log.read()
        self.told += len(new)
        return new.decode("utf-8", "replace")

    def words(self) -> str:
        """The last that it wrote on its error stream."""
        self.log.seek(0)
        return self.log.read().decode("utf-8", "replace").strip()[-SHOWN:]

    def ending(self) -> str:
        """How it ended."""
        is_overdue = self.is_overdue  # as it was when the pipe closed
        try:
            code = self.process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            self.kill()
            code = self.process.wait()
            if not is_overdue:
                return "its process closed the pipe for its answers, so it was ended"
        if is_overdue:
            return f"no answer within {self.limit:g} s, the limit, so its process was ended"
        if code >= 0:
            return f"its process ended with exit code {code}"
        names = {s.value: f"{s.name}, {signal.strsignal(s) or 'a signal'}" for s in signal.Signals}
        return f"its process was ended by signal {-code} ({names.get(-code, 'unknown')})"

    def dismiss(self) -> None:
        """Tell the process to end, or end it in the middle of its work if need be."""
        if self.is_busy:
            self.kill()
        with suppress(OSError):
            if self.process.stdin:
                self.process.stdin.close()

    def close(self) -> None:
        """End the process and remove its temporary files."""
        self.dismiss()
        until = monotonic() + PATIENCE
        while self.process.poll() is None and monotonic() < until:
            sleep(GLANCE)  # `wait` with a timeout sleeps longer and longer
        self.kill()
        self.process.wait()
        self.log.close()
        if self.process.stdout and not self.is_busy:  # else the thread that waits for an answer reads from it
            self.process.stdout.close()
        shutil.rmtree(self.folder, ignore_errors=True)


def end_descendants(folder: Path) -> None:
    """End all processes whose environment names this folder, or one in it, also those in a session of their own."""
    if sys.platform != "linux":
        return
    mark, own = f"{FOLDER}={folder}".encode(), os.getpid()
    for _ in range(ROUNDS):
        pids = (int(name) for name in os.listdir("/proc") if name.isdigit())  # noqa: PTH208  # a path of each takes longer
        found = [pid for pid in pids if pid != own and has(pid, mark)]
        for pid in found:
            with suppress(OSError):
                os.kill(pid, signal.SIGKILL)
        if not found:
            return
        sleep(GLANCE)


def has(pid: int, mark: bytes) -> bool:
    """True if the environment of a process has a variable that begins so."""
    try:
        with open(f"/proc/{pid}/environ", "rb", buffering=0) as file:  # noqa: PTH123  # likewise
            content = file.read()
    except OSError:  # of somebody else, or gone
        return False
    return mark in content and any(entry == mark or entry.startswith(mark + b"/") for entry in content.split(b"\0"))


def map_numbers(file: Path) -> Marks:
    """Map whole numbers of a file into shared memory."""
    with file.open("r+b") as opened:
        return memoryview(mmap.mmap(opened.fileno(), 0)).cast("q")


def own_marks() -> Marks | None:
    """Marks that this process shares with the process that started it, if that is one of ours."""
    folder = os.environ.get(FOLDER)
    return map_numbers(Path(folder, "marks")) if folder else None


def follow() -> None:
    """End this process, whatever it does, when the process ends that started it.

    It leaves no files, though another thread may just be writing some: a fork has only this one.
    """
    parent = os.getppid()
    while os.getppid() == parent:
        sleep(LOOK)
    if sys.platform == "linux":
        warnings.simplefilter("ignore")  # Python warns of forks that have more to do
        own = os.getpid()
        with suppress(OSError):
            if os.fork():
                os._exit(1)
            while os.getppid() == own:
                sleep(GLANCE)
        end_descendants(Path(os.environ[FOLDER]))
    remove_folder()
    os._exit(1)


def remove_folder() -> None:
    """Leave no files: the one that started this process may have been killed."""
    shutil.rmtree(os.environ[FOLDER], ignore_errors=True)


def leave(is_done: Event, own: int) -> None:
    """Leave no files, but let a fork that a component made leave all as it is.

    At a good end do not take the interpreter down in order, which takes longer than many a run.
    """
    if os.getpid() != own:
        os._exit(0)
    remove_folder()
    if is_done.is_set() and os.name == "posix":
        sys.stderr.flush()
        if "ctypes" in sys.modules:  # libraries may have files open
            sys.modules["ctypes"].CDLL(None).fflush(None)
        os._exit(0)


def main() -> None:
    """Be a process that answers requests until the input ends."""
    sys.path.extend(filter(None, sys.argv[1:2]))  # the guest's folder: what comes with Python is found before
    faulthandler.enable(all_threads=False)
    is_done = Event()
    atexit.register(leave, is_done, os.getpid())  # first, so that it comes last
    Thread(target=follow, daemon=True).start()
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)  # what FMUs print goes to the error stream from now on
    sys.stdout = sys.stderr
    for module in sys.argv[2:]:
        import_module(module)
    work(answers)
    is_done.set()


def work(answers: TextIO) -> None:
    """Answer requests."""
    first, own = sys.stdin.readline(), os.getpid()
    if not first:
        return  # this process was not needed
    request = json.loads(first)
    try:
        answer: Callable[[Any], Any] = import_function(request["prepare"])(request["task"])
    except ScenarioError as error:
        return send(answers, {"problems": error.problems})
    send(answers, {"problems": []})
    for line in sys.stdin:
        message = answer(json.loads(line))
        if os.getpid() != own:
            os._exit(0)  # a fork that a component made: only the process itself answers
        send(answers, message)


def send(answers: TextIO, message: Any) -> None:
    """Write one answer."""
    print(json.dumps(message), file=answers, flush=True)


# Processes that are started before it is known what for: they load modules while their task is prepared.


_waiting: deque[Process] = deque()
_again: list[Sequence[str]] = []  # modules of the next process, while each one that is taken is to be replaced


def process(guest: Callable[..., Any] | None = None, limit: float | None = None) -> Process:
    """A new process; without a guest one that was started before and waits, if there is one."""
    if guest is None:
        with suppress(IndexError):
            taken = _waiting.popleft()
            taken.limit = limit
            with suppress(OSError):  # who needs the next one will start it, and tell
                _waiting.extend(Process(load=modules) for modules in _again)
            return taken
    return Process(guest, limit)


@contextmanager
def ahead(*modules: str, count: int = 1, again: bool = False) -> Iterator[None]:
    """Start the next processes now; with `again`, start another one for each that is taken.

    Those that are left at the end are ended. A block inside another one uses the processes of the outer one.
    """
    if _waiting or _again:
        return (yield)
    try:
        _again.extend([modules] * again)
        _waiting.extend(Process(load=modules) for _ in range(min(count, os.cpu_count() or 1)))
        yield
    finally:
        _again.clear()
        while _waiting:
            left = _waiting.pop()
            left.kill()
            left.close()
