"""A board for tests: the program of `export-c --loop` built for this computer, at a port that can treat it badly."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Thread

from host import FLAGS, ROOT

from gapsense.embedded.design import make_design
from gapsense.embedded.export import export

Treat = Callable[[bytes], bytes]  # what becomes of bytes on their way
SCENARIO = """
title = "A coil"
[experiment]
stop = 10e-3
base_step = 50e-6
[components.sensor]
fmu = "Sensor"
{sensor}
[components.sensor.set]
sample_time = 50e-6
"noise.current" = 2e-3
[components.semera]
fmu = "Semera"
{semera}
[components.semera.set]
sample_time = 50e-6
"coil.turns" = 1140.0
[connect]
"semera.voltage" = "sensor.voltage_measured"
"semera.current" = "sensor.current_measured"
[inputs]
"sensor.position" = 1e-3
"sensor.mode" = 0.0
[inputs.sensor.voltage]
times = [0.0, 1e-3, 6e-3, 10e-3]
values = [0.0, 30.0, 0.0, 0.0]
interpolation = "hold"
[inputs.sensor.current]
times = [0.0, 1e-3, 6e-3, 10e-3]
values = [0.0, 0.0, 0.3, 0.05]
[seeds]
sensor = 3
"""


def exported(folder: Path, names: Sequence[str], real: str = "double", **more: object) -> Path:
    """The files of a board with some components."""
    export([make_design(ROOT / "fmus" / name, real, **more) for name in names], folder, in_loop=True)
    return folder


def built(folder: Path, target: str = "here") -> Path:
    """What `make` builds of them; the compiler of this computer must find nothing to say."""
    more = [f"CC=gcc {' '.join(FLAGS)} -Werror"] if target == "here" else []
    done = subprocess.run(["make", "-C", str(folder), target, *more], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    return folder / target


def missing() -> list[str]:
    """Programs that are not installed, and a system that has boards."""
    return [tool for tool in ("make", "gcc") if shutil.which(tool) is None] + ["Linux or macOS"] * (os.name != "posix")


class Served:
    """The program at a port of this computer; bytes to it and from it pass through functions."""

    def __init__(self, program: Path, to: Treat = bytes, back: Treat = bytes) -> None:
        self.program, self.to, self.back = program, to, back
        self.listening = socket.create_server(("127.0.0.1", 0))
        self.board = f"tcp:127.0.0.1:{self.listening.getsockname()[1]}"
        self.process: subprocess.Popen[bytes] | None = None
        self.line: socket.socket | None = None
        Thread(target=self.serve, daemon=True).start()

    def serve(self) -> None:
        """Take one connection after the other; each finds the program just started."""
        with suppress(OSError):
            while True:
                self.line = self.listening.accept()[0]
                self.line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                self.restart()
                self.pass_on(self.line)

    def restart(self) -> None:
        """Reset the board."""
        self.stop()
        self.process = subprocess.Popen([str(self.program)], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        Thread(target=self.answer, args=(self.process, self.line), daemon=True).start()

    def pass_on(self, line: socket.socket) -> None:
        """Give the program what comes, until the line is closed."""
        with suppress(OSError):
            while data := line.recv(65536):
                passed = self.to(data)
                assert self.process and self.process.stdin
                self.process.stdin.write(passed)
                self.process.stdin.flush()
        self.stop()

    def answer(self, process: subprocess.Popen[bytes], line: socket.socket) -> None:
        """Send on what the program says."""
        with suppress(OSError, ValueError):
            while data := process.stdout.read1(65536):  # type: ignore[union-attr]
                line.sendall(self.back(data))

    def stop(self) -> None:
        """End the program."""
        if self.process:
            self.process.kill()
            self.process.wait()

    def unplug(self) -> None:
        """Close the line."""
        assert self.line
        self.line.shutdown(socket.SHUT_RDWR)

    def close(self) -> None:
        """End all of it."""
        self.listening.close()
        self.stop()


@contextmanager
def served(program: Path, to: Treat = bytes, back: Treat = bytes) -> Iterator[Served]:
    """A board at a port."""
    made = Served(program, to, back)
    try:
        yield made
    finally:
        made.close()


def written(folder: Path, board: Served | str = "", events: str = "", on: Sequence[str] = ("sensor", "semera")) -> Path:
    """The file of a scenario of a coil, with some of its components on a board if there is one."""
    place = board if isinstance(board, str) else board.board
    file = folder / ("on_board" if place else "fmus") / "scenario.toml"
    file.parent.mkdir(exist_ok=True)
    more = {name: f'board = "{place}"\nclock = 1e8' if place and name in on else "" for name in ("sensor", "semera")}
    file.write_text(SCENARIO.format(**more) + events)
    return file
