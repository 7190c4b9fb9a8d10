"""What a component starts, forks or closes: the run ends, its cause is told, and nothing of it is left."""

import os
import subprocess
import sys
import time
from pathlib import Path

import faulty
import pytest

from gapsense.cosim import FmuError, run, sweep
from gapsense.cosim.fmu.instance import home

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="looks for processes in /proc")
LIMIT = "base_step = 0.1\nstep_limit = 1.0"
WHOLE = faulty.FAULTY.replace("base_step = 0.1", LIMIT + '\nisolation = "process"')
PART = faulty.FAULTY.replace("base_step = 0.1", LIMIT).replace('"FAULT" }', '"FAULT" }\nisolation = "process"')
CAUSES = {
    "fork": "its process ended with exit code 3",
    "fork_away": "its process ended with exit code 3",
    "fork_and_hang": "no answer within 1 s, the limit, so its process was ended",
    "close": "its process closed the pipe for its answers, so it was ended",
}
PROCESSES = pytest.mark.parametrize(  # of a run; of a component, too, its pipe is closed quickly, below
    "text", [pytest.param(WHOLE, id="run"), pytest.param(PART, id="component", marks=pytest.mark.slow)]
)
HARMLESS = ("child_exits", "child_goes_on", "leave", "leave_away", "chdir")


@pytest.fixture
def temporary(tmp_path, monkeypatch):
    """Folder of temporary files, by which processes are known; when the test ends there are none.

    What this process unpacks stays as long as it does, in a folder that is made before.
    """
    home(os.getpid())
    (folder := tmp_path / "temporary").mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(folder))
    yield folder
    end = time.monotonic() + 3.0
    while (found := processes(folder)) and time.monotonic() < end:
        time.sleep(0.05)
    assert not found and not list(folder.iterdir())


def processes(folder):
    """Commands of the processes that have their temporary files in a folder."""
    found = []
    for file in Path("/proc").glob("[0-9]*/environ"):
        try:
            found += [file] * (f"GAPSENSE_PROCESS={folder}".encode() in file.read_bytes())
        except OSError:
            continue
    return found


@PROCESSES
@pytest.mark.parametrize("fault", CAUSES)
def test_component_that_forks_or_closes_is_ended_and_told(write, fmus, temporary, text, fault):
    with pytest.raises(FmuError) as caught:
        run(write(text.replace("FAULT", fault)), fmus=fmus)
    assert (caught.value.instance, caught.value.step) == ("coil", 6)
    assert caught.value.cause == f"{CAUSES[fault]}, in its step."
    assert len(caught.value.result.times) == 6


@pytest.mark.parametrize("text", [WHOLE, PART], ids=["run", "component"])
def test_closed_pipe_is_told_however_short_the_limit(write, fmus, temporary, text):
    text = text.replace("FAULT", "close").replace("step_limit = 1.0", "step_limit = 0.5")
    with pytest.raises(FmuError) as caught:
        run(write(text), fmus=fmus)
    assert caught.value.cause == f"{CAUSES['close']}, in its step."


@PROCESSES
@pytest.mark.parametrize("fault", HARMLESS)
def test_what_a_component_starts_ends_with_a_good_run(write, fmus, temporary, text, fault):
    assert run(write(text.replace("FAULT", fault)), fmus=fmus)["coil.y"][-1] == pytest.approx(1.0)


@pytest.mark.parametrize(
    "fault", ["close", "leave_away", *(pytest.param(f, marks=pytest.mark.slow) for f in CAUSES if f != "close")]
)
def test_sweep_goes_on_and_leaves_nothing(write, fmus, temporary, fault):
    text = faulty.FAULTY.replace("base_step = 0.1", LIMIT).replace("FAULT", fault)
    swept = sweep(write(text + '[sweep]\n"coil.at" = [0.5, 5.0]\n'), fmus=fmus, workers=1)
    assert len(swept.errors) == (fault in CAUSES)
    assert all(CAUSES[fault] in error for error in swept.errors.values())


SHADOWS = ("numpy", "csv", "queue", "json", "typing", "encodings", "gapsense", "fmpy", "signal", "runpy", "pickle")
PATHS = (None, "here", ":", "", ".", "lib:")
CASES = [("run", path) for path in PATHS] + [("sweep", path) for path in PATHS[:2]]
CASES += [pytest.param("sweep", path, marks=pytest.mark.slow) for path in PATHS[2:]]


@pytest.mark.parametrize(("command", "paths"), CASES)
def test_nothing_is_imported_from_the_working_folder(write, fmus, tmp_path, monkeypatch, paths, command):
    text = faulty.FAULTY.replace("FAULT", "").replace("[[conn", '[sweep]\n"coil.at" = [5.0]\n[[conn')
    part = write(text.replace('fault = "" }', 'fault = "" }\nisolation = "process"'))
    for name in SHADOWS:
        (tmp_path / f"{name}.py").write_text('open("PWNED", "w"); raise ImportError("shadowed")\n')
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text('open("PWNED", "w"); raise ImportError("shadowed")\n')
    monkeypatch.chdir(tmp_path)
    if paths is None:
        monkeypatch.delenv("PYTHONPATH", raising=False)
    else:  # for our processes only: a Python that the user starts so is his own
        monkeypatch.setenv("PYTHONPATH", str(tmp_path) if paths == "here" else paths)
    result = sweep(part, workers=1, fmus=fmus) if command == "sweep" else run(part, fmus=fmus, isolation="process")
    assert not getattr(result, "errors", None) and not (tmp_path / "PWNED").exists()


def test_module_started_by_the_user_takes_the_working_folder_last(tmp_path):
    for name in ("numpy", "csv", "queue", "rich"):
        (tmp_path / f"{name}.py").write_text('open("PWNED", "w"); raise ImportError("shadowed")\n')
    done = subprocess.run(
        [sys.executable, "-m", "gapsense.cli", "list"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "") and not (tmp_path / "PWNED").exists()
