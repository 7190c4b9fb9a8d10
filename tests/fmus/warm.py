"""Processes without their start: a Python that has imported what takes long forks for each that is asked for.

Such a process has its own environment, arguments, files, session and end; only `/proc` shows the environment of the one
that it comes from. Where there is no fork, it is started as usual.
"""

from __future__ import annotations

import json
import os
import select
import signal
import socket
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, suppress
from functools import cache
from pathlib import Path
from typing import Any

# Of two forks the second becomes the process and ends as any other does; the first waits for it and tells its end.
SERVER = """
import gc, json, os, signal, socket, sys, tempfile
sys.path[:] = filter(None, sys.path)
requests = socket.socket(fileno=int(sys.argv[1]))
signal.signal(signal.SIGINT, signal.SIG_IGN)
signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # nobody waits for the first forks
__IMPORTS__
gc.freeze()
gc.set_threshold(20_000)  # as in tests/conftest.py: kernels make many tuples and no circles
while True:
    message, files, _, _ = socket.recv_fds(requests, 1 << 20, 4)
    if not message:
        os._exit(0)
    if os.fork():
        for file in files:
            os.close(file)
        continue
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    requests.close()
    if made := os.fork():
        for file in files[:3]:
            os.close(file)
        os.write(files[3], b"%d\\n" % made)
        os.write(files[3], b"%d\\n" % os.waitstatus_to_exitcode(os.waitpid(made, 0)[1]))
        os._exit(0)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    asked = json.loads(message)
    if asked["session"]:
        os.setsid()
    os.chdir(asked["cwd"])
    for number, file in enumerate(files[:3]):
        os.dup2(file, number)
    for file in files:
        os.close(file)
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        setattr(sys, name, open(number, "w" if number else "r", encoding="utf-8", closefd=False))
    sys.stderr.reconfigure(line_buffering=True)  # as a Python has it
    os.environ.clear()
    os.environ.update(asked["environment"])
    sys.argv[:], tempfile.tempdir = ["-c", *asked["arguments"]], None
    signal.alarm(asked["seconds"])
    break
exec(compile(asked["code"], "<string>", "exec"), {"__name__": "__main__"})
"""
KEPT = ("PATH", "PYTHONPATH", "LD_LIBRARY_PATH")  # variables that count before a Python runs


@cache
def _server(imports: str, environment: str) -> socket.socket:
    """The socket of a process that has executed the imports; it ends with this one."""
    ours, its = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    command = [sys.executable, "-c", SERVER.replace("__IMPORTS__", imports), str(its.fileno())]
    environment_ = json.loads(environment) | {"OPENBLAS_NUM_THREADS": "1"}
    subprocess.Popen(command, env=environment_, pass_fds=[its.fileno()], stdin=subprocess.DEVNULL)
    its.close()
    return ours


class Process:
    """As much of `subprocess.Popen` as its users here need."""

    def __init__(
        self,
        imports: str,
        code: str,
        arguments: Sequence[str],
        files: tuple[int, int, int],
        env: Mapping[str, str],
        seconds: int = 0,
        session: bool = False,
    ) -> None:
        server = _server(imports, json.dumps({name: env[name] for name in KEPT if name in env}))
        asked = {"code": code, "arguments": [*arguments], "environment": dict(env), "cwd": str(Path.cwd())}
        message = json.dumps(asked | {"seconds": seconds, "session": session}).encode()
        self.end, told = os.pipe()
        socket.send_fds(server, [message], [*files, told])
        os.close(told)
        self.returncode: int | None = None
        self.said = b""
        while b"\n" not in self.said:
            self._listen(None)
        self.pid = int(self.said.split(b"\n")[0])

    def _listen(self, timeout: float | None) -> None:
        if not select.select([self.end], [], [], timeout)[0]:
            return
        new = os.read(self.end, 99)
        self.said += new or b"-9\n" * 2  # the one that waits was killed
        if self.said.count(b"\n") >= 2:
            self.returncode = int(self.said.split(b"\n")[1])
            os.close(self.end)

    def poll(self) -> int | None:
        if self.returncode is None:
            self._listen(0.0)
        return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        if self.returncode is None:
            self._listen(timeout)
        if self.returncode is None:
            raise subprocess.TimeoutExpired("a forked process", timeout or 0.0)
        return self.returncode

    def kill(self) -> None:
        if self.poll() is None:
            with suppress(ProcessLookupError):  # it has ended, and the word of that is still on its way
                os.kill(self.pid, signal.SIGKILL)


class Worker(Process):
    """In the place of `subprocess.Popen` in `gapsense._os.processes`."""

    IMPORTS = (
        "import gapsense.many.worker, gapsense.cosim.run.apart, gapsense.cosim.run.master, fmpy.fmi2; "
        "gapsense.many.worker.versions()"  # which asks another process
    )

    def __init__(self, command: Sequence[str], stderr: Any, env: Mapping[str, str], **_: Any) -> None:
        (read, self_write), (self_read, write) = os.pipe(), os.pipe()
        self.stdin = os.fdopen(self_write, "w", encoding="utf-8")
        self.stdout = os.fdopen(self_read, encoding="utf-8")
        try:
            super().__init__(self.IMPORTS, command[2], command[3:], (read, write, stderr.fileno()), env, session=True)
        finally:
            os.close(read)
            os.close(write)


def run(
    code: str, *arguments: str, imports: str, given: str, env: Mapping[str, str], seconds: int = 60
) -> subprocess.CompletedProcess[str]:
    """What `python -c code arguments` does, by a process that has already executed the `imports`."""
    if not hasattr(os, "fork"):
        command, how = [sys.executable, "-c", f"{imports}\n{code}", *arguments], {"encoding": "utf-8"}
        return subprocess.run(command, input=given, env=env, capture_output=True, timeout=seconds, **how)
    with ExitStack() as stack:
        source, out, err = (stack.enter_context(tempfile.TemporaryFile("w+", encoding="utf-8")) for _ in range(3))
        source.write(given)
        source.seek(0)
        files = (source.fileno(), out.fileno(), err.fileno())
        status = Process(imports, code, arguments, files, env, seconds).wait()
        texts = [(file.seek(0), file.read())[1] for file in (out, err)]
    return subprocess.CompletedProcess(["python", *arguments], status, *texts)
