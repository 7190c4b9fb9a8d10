"""Ctrl-C keeps what was computed."""

from __future__ import annotations

import json
import os
import shutil
import signal
import sqlite3
import subprocess
import sys
from contextlib import closing
from pathlib import Path
from time import monotonic, sleep

import pytest

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="sends SIGINT")
VALVE = Path(__file__).resolve().parents[2] / "scenarios" / "semera_valve"
LOUD = """
import contextlib, sys
import gapsense.cli.run
from gapsense.cli import app, console

@contextlib.contextmanager
def bar(title):
    said = []
    def progress(done, total):
        if done and not said:
            said.append(print(title))
    yield progress

console.bar = gapsense.cli.run.bar = bar  # says when the run is under way
app()
"""


@pytest.fixture
def long(tmp_path):
    """A copy of the scenario of the valve that runs for minutes."""
    folder = Path(shutil.copytree(VALVE, tmp_path / "long", ignore=shutil.ignore_patterns("baseline*")))
    text = (folder / "scenario.toml").read_text("utf-8")
    assert text.count("stop = 100e-3") == 1
    (folder / "scenario.toml").write_text(text.replace("stop = 100e-3", "stop = 20.0"), encoding="utf-8")
    return folder


def interrupted(process, number=signal.SIGINT):
    """Exit code and both outputs of a process that gets a Ctrl-C as soon as it has said that it is under way."""
    assert process.stdout.readline().strip() in ("running", "sweeping")
    process.send_signal(number)
    outputs = process.communicate(timeout=60)
    return process.returncode, *outputs


@pytest.mark.parametrize("number", ["SIGINT", "SIGTERM", pytest.param("SIGHUP", marks=pytest.mark.slow)])
def test_interrupted_run_leaves_a_partial_result_and_says_so(process, long, fmus, tmp_path, number):
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)  # `nohup make test` ignores it, and so would the run
    started = process(LOUD, "run", long, "--fmus", fmus, "--out", tmp_path / "out")
    signal.signal(signal.SIGHUP, before)
    code, out, err = interrupted(started, getattr(signal, number))
    assert code == 130, err
    assert "Traceback" not in err and err.startswith("interrupted at t = ") and "long.csv" in err
    assert "real-time factor" in out
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["long.csv", "long.json"]
    rows = len((tmp_path / "out" / "long.csv").read_text("utf-8").splitlines()) - 1
    side = json.loads((tmp_path / "out" / "long.json").read_text("utf-8"))
    assert side["interrupted"] and side["rows"] == rows and 1 < rows < 800_000
    assert not side["metrics"]


@pytest.mark.slow
def test_interrupted_figure_writes_nothing(process, long, fmus, tmp_path):
    code, _, err = interrupted(process(LOUD, "figure", long, "--fmus", fmus, "--out", tmp_path / "out" / "x.png"))
    assert code == 130 and "nothing was written" in err and "Traceback" not in err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("number", "engine", "seeds"),
    [
        pytest.param(signal.SIGINT, "fmu", 50, marks=pytest.mark.slow),
        pytest.param(signal.SIGTERM, "fmu", 50, marks=pytest.mark.slow),
        (signal.SIGINT, "auto", 20_000),
    ],
)
def test_interrupted_sweep_goes_on_later(process, fmus, tmp_path, number, engine, seeds):
    options = ("--seeds", seeds, "--workers", 1, "--fmus", fmus, "--out", tmp_path / "out", "--engine", engine)
    code, out, err = interrupted(process(LOUD, "sweep", VALVE, *options), number)
    assert code == 130 and "run the same command to continue" in err and "Traceback" not in err
    with closing(sqlite3.connect(tmp_path / "out" / "semera_valve_sweep.sqlite")) as store:
        ((done,),) = store.execute("SELECT count(*) FROM runs").fetchall()
    assert 1 <= done < seeds
    assert f"{done} runs, {done} of them computed now" in out
    assert len(list((tmp_path / "out").iterdir())) == 1


SAVING = """
import os, signal, sys
from gapsense import cosim
from gapsense.cli import app
times, save = int(sys.argv.pop(1)), cosim.Result.save

def interrupted(*arguments):
    for _ in range(times):
        os.kill(os.getpid(), signal.SIGINT)
    return save(*arguments)

cosim.Result.save = interrupted
app()
"""


@pytest.mark.parametrize("times", [1, 2])
def test_only_the_second_ctrl_c_while_a_result_is_saved_loses_it(process, write, fmus, tmp_path, times):
    started = process(SAVING, times, "run", write(), "--fmus", fmus, "--out", tmp_path / "out")
    out, err = started.communicate(timeout=60)
    file = tmp_path / "out" / "short.csv"
    waiting = f"interrupted; {file} is being written. Ctrl-C again stops that.\n"
    assert (started.returncode, err) == (130, waiting if times == 1 else waiting + "interrupted.\n")
    assert ("81 rows" in out, file.is_file()) == (times == 1, times == 1)


IMPORTING = """
import os, signal, sys
module = sys.argv.pop(1)
class Interrupting:
    def find_spec(self, name, *_):
        if name == module:
            os.kill(os.getpid(), signal.SIGINT)
sys.meta_path.insert(0, Interrupting())
from gapsense.__main__ import main
main()
"""
LOADED = (
    "gapsense.cli",
    "typing",
    "pathlib",
    "gapsense._os.interrupts",
    "gapsense.cli.run",
    "numpy",
    "datetime",  # that of numpy: its C turns a KeyboardInterrupt there into an ImportError
    "numpy._core._exceptions",  # in the midst of numpy, which cannot be loaded a second time
    "rich.table",
)


OF_TYPER = ("gapsense.cli.scenarios", "typer")  # which a run that is given in the usual way does not load
OF_STUDIES = ("gapsense.studies", "gapsense.scenarios.semera_valve.study")  # which other commands do not load


@pytest.mark.parametrize("module", [*LOADED, *OF_TYPER, *OF_STUDIES, "fmpy"])
def test_ctrl_c_at_the_start_leaves_no_traces(process, fmus, tmp_path, monkeypatch, module):
    (temporary := tmp_path / "temporary").mkdir()
    monkeypatch.setenv("TMPDIR", str(temporary))
    out = (f"--out={tmp_path / 'out'}",) if module in OF_TYPER else ("--out", tmp_path / "out")
    run = ("run", VALVE, "--fmus", fmus, *out)
    started = process(IMPORTING, module, *(("study", "semera") if module in OF_STUDIES else run))
    out, err = started.communicate(timeout=60)
    assert (started.returncode, out, err) == (130, "", "interrupted.\n")
    assert not list(temporary.iterdir()) and not (tmp_path / "out").exists()


@pytest.mark.parametrize("module", ["gapsense._os.offered", "gapsense.version", "gapsense.__main__"])
def test_ctrl_c_while_the_package_loads_ends_the_script_without_a_line(process, module):
    script = IMPORTING.replace("from gapsense", 'sys.argv[0] = "/usr/bin/gapsense"\nfrom gapsense')
    started = process(script, module)
    assert started.communicate(timeout=60) == ("", "") and started.returncode == -signal.SIGINT


def test_program_that_is_killed_while_it_loads_leaves_no_process_and_no_folder(process, tmp_path, monkeypatch):
    (temporary := tmp_path / "temporary").mkdir()
    monkeypatch.setenv("TMPDIR", str(temporary))
    killing = IMPORTING.replace("signal.SIGINT", "signal.SIGKILL if list(os.scandir(os.environ['TMPDIR'])) else 0")
    started = process(killing, "gapsense.cli.run", "run", VALVE, "--out", tmp_path / "out")
    assert started.wait(60) == -signal.SIGKILL  # there was a folder
    until = monotonic() + 30
    while list(temporary.iterdir()) and monotonic() < until:
        sleep(0.05)
    assert not list(temporary.iterdir())


@pytest.mark.parametrize(
    ("words", "delay"),
    [
        pytest.param(words, delay, id=f"{name}-{delay}", marks=[] if delay in quick else pytest.mark.slow)
        for name, words, quick in (
            ("-m", ["-m", "gapsense"], (20, 100)),
            ("script", [Path(sys.executable).with_name("gapsense")], (0, 40, 150)),
        )
        for delay in (0, 10, 20, 40, 70, 100, 150)
    ],
)
def test_ctrl_c_at_any_time_shows_no_line_of_ours(fmus, tmp_path, words, delay):
    command = [sys.executable, *words, "run", VALVE, "--fmus", fmus, "--out", tmp_path / "out"]
    started = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, cwd=tmp_path)
    sleep(1e-3 * delay)
    started.send_signal(signal.SIGINT)
    _, err = started.communicate(timeout=60)
    if "Traceback" in err or err == "KeyboardInterrupt\n":  # of Python's own start, which nobody can change
        assert str(VALVE.parents[1] / "src") not in err
    else:
        assert started.returncode in (130, -signal.SIGINT) and (err == "" or err.startswith("interrupted")), err


HANGING = """
title = "A component that hangs"
[experiment]
stop = 1.0
base_step = 0.1
[components.coil]
fmu = "Faulty"
set = { fault = "hang" }
[inputs]
"coil.u" = 1.0
[seeds]
coil = 0
[sweep]
"coil.at" = [0.5, 0.6, 0.7]
"""


@pytest.fixture(scope="session")
def stock(shared):
    """Folder with the stock FMUs of the tests of the runner, of which one hangs."""

    def make(folder):
        folder.mkdir()
        script = Path(__file__).resolve().parents[1] / "cosim" / "stock_fmus.py"
        environment = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1"}
        subprocess.run([sys.executable, script, folder], check=True, env=environment, capture_output=True)

    return shared("stock", make)


@pytest.fixture
def hanging(process, stock, tmp_path, monkeypatch):
    """Starts a command on a scenario whose component hangs, and waits until it does."""
    (temporary := tmp_path / "temporary").mkdir()
    monkeypatch.setenv("TMPDIR", str(temporary))

    def start(command, *options, times=1):
        folder = tmp_path / "demo"
        folder.mkdir()
        (folder / "scenario.toml").write_text(HANGING, encoding="utf-8")
        started = process(LOUD, command, folder, "--fmus", stock, "--out", tmp_path / "out", *options)
        wait_until(lambda: sum(marks(file) == 6 for file in temporary.glob("gapsense-*/marks")) >= times)
        return started

    return start


def marks(file):
    """The base step that a process does at t = 0.5 s, also where it hangs a little later."""
    step = int.from_bytes(file.read_bytes()[16:24], sys.byteorder)
    return min(step, 6)


def wait_until(is_so, limit=20.0):
    end = monotonic() + limit
    while not is_so():
        assert monotonic() < end
        sleep(0.02)


def test_first_ctrl_c_says_what_it_waits_for_and_the_second_keeps_the_result(hanging, tmp_path):
    started = hanging("run")
    begin = monotonic()
    started.send_signal(signal.SIGINT)
    assert started.stderr.readline() == (
        "interrupted; waiting for `coil`, in its step (base step 6), to end. Ctrl-C again ends it at once.\n"
    )
    assert monotonic() - begin < 10.0  # of 1,000 s
    started.send_signal(signal.SIGINT)
    _, err = started.communicate(timeout=10)
    assert started.returncode == 130, err
    assert err.startswith("interrupted at t = 0.5 s; what was computed is in") and "coil" not in err
    side = json.loads((tmp_path / "out" / "demo.json").read_text("utf-8"))
    assert side["rows"] == 6 and side["interrupted"] and not side["failure"]
    assert not list((tmp_path / "temporary").iterdir())


def test_two_ctrl_c_in_a_sweep_leave_no_worker(hanging, tmp_path):
    started = hanging("sweep", "--workers", 2, times=2)
    for _ in range(2):
        started.send_signal(signal.SIGINT)
        sleep(0.05)
    _, err = started.communicate(timeout=10)
    assert started.returncode == 130 and "Traceback" not in err, err
    assert not workers(tmp_path) and not list((tmp_path / "temporary").iterdir())


@pytest.mark.skipif(not Path("/proc/self/environ").exists(), reason="looks for processes")
@pytest.mark.parametrize(("command", "times"), [pytest.param("run", 1, marks=pytest.mark.slow), ("sweep", 2)])
def test_killed_program_leaves_no_worker_and_no_files(hanging, tmp_path, command, times):
    started = hanging(command, times=times)
    assert len(workers(tmp_path)) == times
    started.kill()
    wait_until(lambda: not workers(tmp_path) and not list((tmp_path / "temporary").iterdir()))
    started.communicate()


BUSY = """
import os, tempfile
from contextlib import closing
from pathlib import Path

def prepare(_):
    return write

def write(_):
    for k in range(10**9):
        os.makedirs(folder := Path(tempfile.gettempdir(), str(k % 300), str(k)), exist_ok=True)
        (folder / "file").touch()
"""
ASKING = """
import busy
from gapsense._os.processes import Process

process = Process(busy.prepare)
process.prepare(busy.prepare, None)
print("under way")
process.ask(None, "the test")
"""


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere what is just being written can be left")
def test_worker_that_is_just_writing_files_leaves_none_either(process, tmp_path, monkeypatch):
    (temporary := tmp_path / "temporary").mkdir()
    (tmp_path / "busy.py").write_text(BUSY, encoding="utf-8")
    monkeypatch.setenv("TMPDIR", str(temporary))
    started = process(ASKING)
    assert started.stdout.readline() == "under way\n"
    sleep(0.1)
    started.kill()
    # both: the fork that removes the files is in no list of processes that was read just before it began
    wait_until(lambda: not workers(tmp_path) and not list(temporary.iterdir()))
    started.communicate()


def workers(folder):
    """Processes that have their temporary files in a folder."""
    found, own = [], f"GAPSENSE_PROCESS={folder}".encode()
    for file in Path("/proc").glob("[0-9]*/environ"):
        try:
            found += [file] * (own in file.read_bytes())
        except OSError:
            continue  # of somebody else, or gone
    return found
