"""The Linux binary of our Python FMUs, around slaves as pythonfmu has them: messages, failures, exit, memory.

Everything runs in fresh processes, since a process that has built or run an FMU once is no longer a clean host.
"""

import ast
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from importlib.util import find_spec
from pathlib import Path
from urllib.parse import quote

import pytest
from hosting import LAG_AT_01, PERCENT_TEXT, environment, final_values, in_host, in_python

from gapsense.fmi.shim import BINARY, SOURCE
from gapsense.fmi.shim.build import SHIM

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the shim is for Linux")

FRESH_PROCESSES = [4, pytest.param(40, marks=pytest.mark.slow)]

FMPY = """
import sys, fmpy, fmpy.fmi2
folder, name, steps = sys.argv[1], sys.argv[2], int(sys.argv[3])
fmu = fmpy.fmi2.FMU2Slave(guid="", unzipDirectory=folder, modelIdentifier=name, instanceName="model")
fmu.instantiate(loggingOn=True)
fmu.setupExperiment(); fmu.enterInitializationMode(); fmu.exitInitializationMode()
for k in range(steps):
    fmu.doStep(k * 0.01, 0.01)
print(fmu.getReal([1])[0])
fmu.terminate(); fmu.freeInstance()
"""

LIBCOSIMPY = """
import sys
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimSlave import CosimLocalSlave
execution = CosimExecution.from_step_size(step_size=10_000_000)
execution.add_local_slave(CosimLocalSlave(fmu_path=sys.argv[1], instance_name="model"))
print("STEPS", *(execution.step() for _ in range(6)), flush=True)
"""


# The binary -----------------------------------------------------------------------------------------------------------


def test_committed_binary_belongs_to_the_sources() -> None:
    SHIM.check()  # where Zig is installed, also byte for byte with a rebuild


def test_stale_binary_is_noticed(tmp_path: Path) -> None:
    stale = tmp_path / "stale.so"
    stale.write_bytes(BINARY.read_bytes().replace(SHIM.fingerprint().encode(), b"0" * 64))
    assert "is not up to date with its sources" in SHIM.problems(stale)[0]


def test_all_functions_of_fmi_2_co_simulation_are_exported() -> None:
    assert len(SHIM.exports) == 34


def test_python_side_is_written_for_the_oldest_python() -> None:
    ast.parse(SOURCE.with_name("loader.py").read_text("utf-8"), feature_version=(3, 9))


def test_compiles_with_gcc_without_warning(gcc: str, tmp_path: Path) -> None:
    assert SHIM.problems(SHIM.compile_with([gcc], tmp_path / "shim.so")) == []


# A host without Python ------------------------------------------------------------------------------------------------


def test_runs_in_c_host(c_host: Path, stock: Path) -> None:
    run = in_host(c_host, stock / "Lag")
    assert run.returncode == 0, run.stdout + run.stderr
    assert final_values(run.stdout) == [pytest.approx(LAG_AT_01, rel=1e-12)]


def test_second_load_after_dlclose_works(c_host: Path, stock: Path) -> None:
    run = in_host(c_host, stock / "Lag", options="-c 3")
    assert run.returncode == 0, run.stdout + run.stderr
    assert final_values(run.stdout) == [pytest.approx(LAG_AT_01, rel=1e-12)] * 3


def test_two_fmus_in_one_process(c_host: Path, stock: Path) -> None:
    run = in_host(c_host, stock / "Lag", stock / "Talker")
    assert run.returncode == 0, run.stdout + run.stderr
    assert final_values(run.stdout) == [pytest.approx(LAG_AT_01, rel=1e-12)] * 2


@pytest.mark.parametrize("attempt", range(3))
def test_threads_start_two_fmus_at_the_same_time(c_host: Path, stock: Path, attempt: int) -> None:
    """With one lock per FMU this fails in 119 of 120 attempts. Also runs past the call that keeps thread states."""
    run = in_host(c_host, stock / "Lag", stock / "Talker", options="-t 3 -n 60 -c 2")
    assert run.returncode == 0, run.stdout + run.stderr
    assert final_values(run.stdout) == [pytest.approx(LAG_AT_01, rel=1e-12)] * 12


def test_relative_library_path_survives_change_of_folder(stock: Path) -> None:
    code = """
import ctypes, os
library = ctypes.CDLL("Lag/binaries/linux64/Lag.so", mode=os.RTLD_LAZY)
os.chdir("/")
library.fmi2Instantiate.restype = ctypes.c_void_p
resources = ctypes.c_char_p(os.environ["RESOURCES"].encode())
callbacks = (ctypes.c_void_p * 5)()
assert library.fmi2Instantiate(b"model", 1, b"", resources, callbacks, 0, 1)
"""
    env = environment(RESOURCES=(stock / "Lag" / "resources").as_uri())
    run = subprocess.run([sys.executable, "-c", code], cwd=stock, env=env, capture_output=True, text=True, timeout=60)
    assert run.returncode == 0, run.stderr


def test_libpython_can_be_named(c_host: Path, stock: Path) -> None:
    run = in_host(c_host, stock / "Lag", GAPSENSE_LIBPYTHON="/nonexistent/libpython3.11.so.1.0")
    assert run.returncode == 3
    assert "LOG model 3 logStatusError This FMU needs Python" in run.stdout
    assert "GAPSENSE_LIBPYTHON" in run.stdout and "/nonexistent/libpython3.11.so.1.0" in run.stdout
    assert "Set it to the full path" in run.stdout


def test_missing_python_is_told_in_a_sentence(c_host: Path, stock: Path, tmp_path: Path) -> None:
    """No `python3` on PATH; if the system has a libpython of its own, the FMU runs with it."""
    run = in_host(c_host, stock / "Lag", PATH=str(tmp_path))
    assert run.returncode == 0 or (run.returncode == 3 and "no shared Python library" in run.stdout)


# Resources ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("form", ["file://", "file:", "file://localhost", ""])
def test_awkward_folder_names(c_host: Path, stock: Path, tmp_path: Path, form: str) -> None:
    folder = tmp_path / "Ventil für 100% + mehr #1"
    shutil.copytree(stock / "Lag", folder)
    resources = str(folder / "resources")
    run = in_host(c_host, folder, uri=form + (quote(resources) if form else resources))
    assert run.returncode == 0, run.stdout + run.stderr
    assert final_values(run.stdout) == [pytest.approx(LAG_AT_01, rel=1e-12)]


def test_awkward_folder_name_in_fmpy(stock: Path, tmp_path: Path) -> None:
    folder = tmp_path / "für + mehr"
    shutil.copytree(stock / "Lag", folder)
    run = in_python(FMPY, folder, "Lag", 10)
    assert run.returncode == 0, run.stderr
    assert float(run.stdout) == pytest.approx(LAG_AT_01, rel=1e-12)


@pytest.mark.parametrize("location", ["file:///nowhere/resources", "file:///bad%2", "%"])
def test_wrong_location_is_told_in_a_sentence(c_host: Path, stock: Path, location: str) -> None:
    run = in_host(c_host, stock / "Lag", uri=location)
    assert run.returncode == 3
    assert "does not find its resources" in run.stdout and location in run.stdout


# Messages and failures ------------------------------------------------------------------------------------------------


def test_percent_in_messages_survives(c_host: Path, stock: Path) -> None:
    run = in_host(c_host, stock / "Talker", options="-n 2")
    assert run.returncode == 0, run.stdout + run.stderr
    assert run.stdout.count(f"LOG model 1 logStatusWarning {PERCENT_TEXT}\n") == 2
    assert run.stdout.count("printed\n") == 2  # Python is not ended, so what it prints must not wait for that


def test_percent_in_messages_survives_in_fmpy(stock: Path) -> None:
    run = in_python(FMPY, stock / "Talker", "Talker", 2)
    assert run.returncode == 0, run.stderr
    assert PERCENT_TEXT in run.stdout + run.stderr


def test_logging_can_be_off(c_host: Path, stock: Path) -> None:
    run = in_host(c_host, stock / "Talker", options="-q")
    assert run.returncode == 0
    assert "LOG" not in run.stdout


@pytest.mark.parametrize("name", ["Raiser", "InitRaiser"])
def test_error_is_told_even_without_logging(c_host: Path, stock: Path, name: str) -> None:
    """Many hosts leave logging off, and then show nothing but the name of the call that failed."""
    run = in_host(c_host, stock / name, options="-q")
    assert run.stdout.count("LOG ") == 1 and f"LOG model 3 logStatusError `model` ({name}): ValueError" in run.stdout


@pytest.mark.parametrize(("name", "text"), [("Raiser", "cannot go on, 50 %s done %n"), ("InitRaiser", "bad start")])
def test_exception_is_an_error_and_nothing_worse(c_host: Path, stock: Path, name: str, text: str) -> None:
    run = in_host(c_host, stock / name, options="-c 2 -t 2")
    assert run.returncode == 13, run.stdout + run.stderr  # the status after which the host still frees the instance
    assert run.stdout.count(f"LOG model 3 logStatusError `model` ({name}): ValueError: {text}\nTraceback") == 3
    assert run.stdout.count("LOG ") == 3  # one message for each failure; after one, the main thread does not run again


def test_failure_to_instantiate_is_told_even_without_logging(c_host: Path, stock: Path, tmp_path: Path) -> None:
    folder = tmp_path / "Lag"
    shutil.copytree(stock / "Lag", folder)
    slave = folder / "resources" / "lag_slave.py"
    slave.write_text(slave.read_text().replace("from math", "import no_such_package\nfrom math"))
    run = in_host(c_host, folder, options="-q -c 2")
    assert run.returncode == 3
    assert "no_such_package" in run.stdout


@pytest.mark.parametrize("name", ["Raiser", "InitRaiser"])
def test_exception_in_fmpy(stock: Path, name: str) -> None:
    run = in_python(FMPY, stock / name, name, 10)
    assert run.returncode == 1
    assert "status 3" in run.stderr


@pytest.mark.skipif(find_spec("libcosimpy") is None, reason="libcosimpy is not installed")
def test_exception_in_libcosimpy(stock: Path) -> None:
    good = in_python(LIBCOSIMPY, stock / "Lag.fmu")
    bad = in_python(LIBCOSIMPY, stock / "Raiser.fmu")
    assert good.returncode == 0, good.stderr
    assert "STEPS True True True True True True" in good.stdout
    assert bad.returncode == 0, bad.stderr
    assert "STEPS True True True False" in bad.stdout
    assert "cannot go on" in bad.stdout + bad.stderr


# Exit: a damaged heap shows only now and then, so many processes ------------------------------------------------------


@pytest.mark.parametrize("count", FRESH_PROCESSES)
def test_c_host_always_exits_cleanly(c_host: Path, stock: Path, count: int) -> None:
    with ThreadPoolExecutor(2) as pool:
        runs = list(pool.map(lambda _: in_host(c_host, stock / "Lag", options="-n 50"), range(count)))
    assert [run.returncode for run in runs] == [0] * count


@pytest.mark.parametrize("count", FRESH_PROCESSES)
def test_fmpy_always_exits_cleanly(stock: Path, count: int) -> None:
    with ThreadPoolExecutor(2) as pool:
        runs = list(pool.map(lambda _: in_python(FMPY, stock / "Lag", "Lag", 50), range(count)))
    assert [run.returncode for run in runs] == [0] * count


# Memory ---------------------------------------------------------------------------------------------------------------


ANEW = """
import shutil, sys, tempfile, zipfile
from pathlib import Path
import fmpy.fmi2
def load(path, name, steps):
    folder = tempfile.mkdtemp(dir=sys.argv[1])
    zipfile.ZipFile(path).extractall(folder)
    fmu = fmpy.fmi2.FMU2Slave(guid="", unzipDirectory=folder, modelIdentifier=name, instanceName="model")
    fmu.instantiate(); fmu.setupExperiment(); fmu.enterInitializationMode(); fmu.exitInitializationMode()
    failed = 0
    for k in range(steps):
        try:
            fmu.doStep(k * 0.01, 0.01)
        except Exception:
            failed += 1
    value = fmu.getReal([1])[0] if not failed else None
    fmu.freeInstance()
    shutil.rmtree(folder)
    return value, failed
def maps():
    return len(Path("/proc/self/maps").read_text().splitlines())
def memory():
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096
lag, raiser = (Path(path) for path in sys.argv[2:])
values = {load(lag, "Lag", 10) for _ in range(10)}
before = maps(), memory()
values |= {load(lag, "Lag", 10) for _ in range(50)}
print(maps() - before[0], (memory() - before[1]) / 50, len(values), next(iter(values))[0])
print(load(raiser, "Raiser", 5), load(raiser, "Raiser", 5), load(lag, "Lag", 10) in values)
"""


def test_copies_of_an_fmu_that_a_host_unpacks_anew_share_what_cannot_be_unloaded(stock: Path, tmp_path: Path) -> None:
    done = in_python(ANEW, tmp_path, stock / "Lag.fmu", stock / "Raiser.fmu")
    assert done.returncode == 0, done
    first, *told, second = done.stdout.splitlines()  # FMPy prints what it is told, with logging off, too
    assert "ValueError" in told[0]
    grown, kept, different, value = map(float, first.split())
    assert grown <= 3  # mappings; it were 17 for each load
    assert kept < 30_000  # bytes for each load, 10,000 in fact; it were 350,000
    assert different == 1 and value == pytest.approx(LAG_AT_01)
    assert second == "(None, 2) (None, 2) True"
