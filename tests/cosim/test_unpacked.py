"""FMUs are unpacked once per process and content; neither files nor memory stay behind."""

import os
import signal
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from gapsense.cosim import FmuError, prepare, run
from gapsense.cosim.fmu.instance import home, unpack_fmu

SRC = Path(__file__).parents[2] / "src"


def started(code, folder):
    environment = {**os.environ, "PYTHONPATH": str(SRC), "TMPDIR": str(folder)}
    return subprocess.Popen([sys.executable, "-c", code], env=environment, stdout=subprocess.PIPE, text=True)


def test_files_go_with_the_process(write, chain, fmus, tmp_path):
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    code = f"from gapsense.cosim import run\nrun({str(write(chain))!r}, fmus={str(fmus)!r})"
    assert started(code, temporary).wait(60) == 0
    assert list(temporary.iterdir()) == []


@pytest.mark.skipif(sys.platform == "win32", reason="there nothing can be removed from another process")
def test_next_process_removes_what_a_killed_one_left_but_not_what_a_living_one_has(tmp_path):
    code = "import os\nfrom gapsense.cosim.fmu.instance import home\nprint(home(os.getpid()), flush=True)\ninput()"
    killed, living = (started(code.replace("input()", "import time; time.sleep(60)"), tmp_path) for _ in range(2))
    left, used = Path(killed.stdout.readline().strip()), Path(living.stdout.readline().strip())
    killed.send_signal(signal.SIGKILL)
    killed.wait()
    assert left.is_dir() and used.is_dir()
    assert started(code.replace("input()", ""), tmp_path).wait(60) == 0
    assert [path.name for path in tmp_path.iterdir()] == [used.name]
    living.kill()
    living.wait()


def test_all_runs_of_a_process_share_one_folder_per_content(write, chain, fmus):
    path = write(chain)
    run(path, fmus=fmus)
    descriptions = prepare(path, None, fmus)[1]
    folders = {name: unpack_fmu(description) for name, description in descriptions.items()}
    assert {folder.name for folder in folders.values()} == {d.sha256 for d in descriptions.values()}
    before = {path for path in home(os.getpid()).iterdir()}
    run(path, fmus=fmus)
    assert {path for path in home(os.getpid()).iterdir()} == before


def test_compiled_python_is_not_kept_in_what_is_removed_anyway(write, chain, fmus, monkeypatch):
    monkeypatch.setattr(sys, "dont_write_bytecode", False)
    run(write(chain), fmus=fmus)
    assert not sys.dont_write_bytecode
    assert not [*home(os.getpid()).rglob("__pycache__")]


def test_file_that_changed_or_is_damaged_is_named(write, chain, fmus, tmp_path):
    changed = tmp_path / "Lag.fmu"
    changed.write_bytes((fmus / "Lag.fmu").read_bytes())
    path = write(chain.replace('fmu = "Lag"', f'fmu = "{changed}"'))
    with zipfile.ZipFile(changed, "a") as archive:
        archive.writestr("resources/new", "x")
    description = prepare(path, None, fmus)[1]["lag"]
    changed.write_bytes(b"other")
    with pytest.raises(FmuError, match="has changed since it was read"):
        unpack_fmu(description)


RUNS = """
from pathlib import Path
import sys
from gapsense.cosim import run
def memory():
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096
for _ in range(10):
    run(PATH, fmus=fmus)
before, places = memory(), len(sys.path)
for _ in range(40):
    run(PATH, fmus=fmus)
print((memory() - before) / 40, len(sys.path) - places)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="reads the memory from /proc")
def test_runs_keep_no_memory_and_no_search_path(write, chain, python):
    done = python(RUNS.replace("PATH", repr(str(write(chain)))))
    assert done.returncode == 0, done
    kept, places = map(float, done.stdout.split())
    assert kept < 100_000  # bytes per run of three instances; it was 1 MB, and pythonfmu keeps some for each
    assert places == 0
