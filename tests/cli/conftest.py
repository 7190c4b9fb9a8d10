"""A short scenario to break and run, and the command line in this process or in one of its own."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from gapsense.cli import app

ROOT = Path(__file__).resolve().parents[2]
SHORT = """
title = "Valve, 2 ms"

[experiment]
stop = 2e-3
base_step = 25e-6

[components.drive]
fmu = "DriveVoltage"
set = { waveform = "square" }

[components.valve]
fmu = "SolenoidValve"

[components.sensor]
fmu = "Sensor"
step = 2

[[connections]]
from = "drive.voltage_mean"
to = "valve.voltage"

[[connections]]
from = "drive.voltage"
to = "sensor.voltage"

[[connections]]
from = "valve.current"
to = "sensor.current"

[[connections]]
from = "valve.position"
to = "sensor.position"

[[connections]]
from = "valve.mode"
to = "sensor.mode"

[inputs]
"drive.enable" = 1.0
"drive.reference" = 0.0

[seeds]
sensor = 1

[record]
signals = ["drive.voltage", "valve.*", "sensor.*_measured"]

[metrics.current_error]
table = "Errors"
label = "current [mA]"
kind = "rmse"
signal = "sensor.current_measured"
reference = "valve.current"
published = 1e-3
bounds = [0.0, 0.01]
"""


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Work in an empty folder, far from the checkout."""
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def write(tmp_path: Path) -> Callable[..., Path]:
    """Writer of the short scenario with replaced pieces."""

    def write(*changes: tuple[str, str], folder: str = "short") -> Path:
        text = SHORT
        for old, new in changes:
            assert text.count(old) == 1, old
            text = text.replace(old, new)
        path = tmp_path / folder / "scenario.toml"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
        return path.parent

    return write


@pytest.fixture
def gapsense() -> Callable[..., Any]:
    """The command line, in this process; no exception may leave it."""

    def call(*arguments: object) -> Any:
        result = CliRunner().invoke(app, [str(a) for a in arguments])
        assert result.exception is None or isinstance(result.exception, SystemExit), repr(result.exception)
        assert "Traceback" not in result.output
        return result

    return call


@contextmanager
def follow() -> Iterator[Callable[[], None]]:
    """Context whose value asserts that the command that was called in it has told how far it is, up to all of it."""
    told: list[list[tuple[float, float]]] = []

    @contextmanager
    def bar(title: str) -> Iterator[Callable[[float, float], None]]:
        told.append([])
        yield lambda done, total: told[-1].append((done, total))

    def assert_rising() -> None:
        for steps in told:
            shares = [done / total for done, total in steps]
            assert len({total for _, total in steps}) == 1 and len(shares) > 1
            assert shares == sorted(shares) and 0.8 < shares[-1] <= 1.0
        assert told

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("gapsense.scenarios.soft_landing.study.bar", bar)
        yield assert_rising


@pytest.fixture(scope="session")
def following() -> Callable[[], AbstractContextManager[Callable[[], None]]]:
    """Makes contexts that follow a command."""
    return follow


@pytest.fixture
def rising() -> Iterator[Callable[[], None]]:
    """Asserts that the command that was called has told how far it is, up to all that is to be done."""
    with follow() as assert_rising:
        yield assert_rising


@pytest.fixture
def process() -> Callable[..., subprocess.Popen[str]]:
    """Python code in a process of its own, to be interrupted; its output is read line by line."""

    def start(code: str, *arguments: object) -> subprocess.Popen[str]:
        return subprocess.Popen(
            [sys.executable, "-u", "-c", code, *map(str, arguments)],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env={**os.environ, "PYTHONPATH": str(ROOT / "src")},
        )

    return start
