"""A worker process of a sweep, seen from the process that asks it."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from gapsense.problems import ScenarioError

SRC = Path(__file__).resolve().parents[2]
PATIENCE = 1.0  # seconds that a process may take to end by itself
SHOWN = 2000  # characters of a crashed process's last words


class WorkerProcess:
    """One process of a module; it does not get the terminal's Ctrl-C, and ends when its input is closed."""

    def __init__(
        self, task: Mapping[str, Any], measure: Callable[..., Any] | None, module: str = "gapsense.cosim.worker"
    ) -> None:
        self.task, self.paths, self.module = task, [SRC, *roots(measure)], module
        self.folder = tempfile.TemporaryDirectory(prefix="gapsense-sweep-", ignore_cleanup_errors=True)
        self.log = Path(self.folder.name, "errors.txt")
        self.process: subprocess.Popen[str] | None = None

    def start(self) -> None:
        """Start it and wait until it has read its task."""
        paths = os.pathsep.join([*map(str, self.paths), os.environ.get("PYTHONPATH", "")]).rstrip(os.pathsep)
        temporary = dict.fromkeys(("TMPDIR", "TEMP", "TMP"), self.folder.name)
        with self.log.open("wb") as errors:
            self.process = subprocess.Popen(
                [sys.executable, "-m", self.module],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=errors,
                text=True,
                encoding="utf-8",
                env={**os.environ, **temporary, "PYTHONPATH": paths},
                start_new_session=True,
            )
        problems = self.talk(json.dumps(self.task), "starting")["problems"]
        if problems:
            raise ScenarioError(problems)

    def ask(self, index: int) -> dict[str, Any]:
        """Answer for one run."""
        return self.talk(str(index), f"run {index}")

    def talk(self, line: str, doing: str) -> dict[str, Any]:
        """Send one line, return the answer; raise RuntimeError if the process has died of it."""
        if self.process is None or self.process.stdin is None or self.process.stdout is None:
            raise RuntimeError("the worker process was not started.")
        try:
            self.process.stdin.write(line + "\n")
            self.process.stdin.flush()
        except OSError:
            pass  # it has died; the missing answer tells so below
        answer = self.process.stdout.readline()
        if not answer.endswith("\n"):
            raise RuntimeError(f"a worker process died ({self.process.wait()}) at {doing}: {self.last_words()}")
        parsed: dict[str, Any] = json.loads(answer)
        return parsed

    def last_words(self) -> str:
        """End of what the process wrote to its error stream."""
        text = self.log.read_text(encoding="utf-8", errors="replace").strip()
        return text[-SHOWN:] or "it wrote nothing. Run that seed alone with `run`."

    def close(self) -> None:
        """End the process, in the middle of a run if need be, and remove its temporary files."""
        if self.process is not None:
            end(self.process)
        self.folder.cleanup()


def end(process: subprocess.Popen[str]) -> None:
    """Let a process end by itself for a moment, then kill it."""
    try:
        if process.stdin is not None:
            process.stdin.close()
        process.wait(timeout=PATIENCE)
    except (OSError, subprocess.TimeoutExpired):
        process.kill()
        process.wait()
    if process.stdout is not None:
        process.stdout.close()


def roots(measure: Callable[..., Any] | None) -> list[Path]:
    """Folder from which the module of a function is imported."""
    file = None if measure is None else getattr(sys.modules[measure.__module__], "__file__", None)
    if measure is None or file is None:
        return []
    depth = measure.__module__.count(".") + (Path(file).name == "__init__.py")
    return [Path(file).resolve().parents[depth]]
