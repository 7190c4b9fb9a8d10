"""Which Python the Linux binary finds and how it starts it, in a C host that has none."""

from __future__ import annotations

import re
import subprocess
import sys
import sysconfig
import zipfile
from pathlib import Path

import pytest
from hosting import LAG_AT_01, build_slaves, final_values, in_host

from gapsense.fmi.shim import BINARY

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the shim is for Linux")

FOLDER, NAME = sysconfig.get_config_var("LIBDIR") or "", sysconfig.get_config_var("INSTSONAME") or ""
LIBPYTHON = Path(FOLDER, NAME)
is_shared = pytest.mark.skipif(
    not LIBPYTHON.is_file() or ".so" not in NAME, reason="this Python has no shared library (libpython3.x.so.1.0)"
)
OLD = """
const char *Py_GetVersion(void) { return "3.8.99 (default)"; }
int Py_IsInitialized(void) { return 0; }
"""
GREETER = """
import greeting
from pythonfmu import Fmi2Causality, Fmi2Slave, Real

class Greeter(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.u = self.y = 0.0
        self.register_variable(Real("u", causality=Fmi2Causality.input))
        self.register_variable(Real("y", causality=Fmi2Causality.output))
        self.log(greeting.TEXT)

    def do_step(self, current_time, step_size):
        return True
"""


def test_needs_an_old_c_library_and_nothing_else(fmus: Path) -> None:
    with zipfile.ZipFile(fmus / "Semera.fmu") as archive:
        (name,) = [name for name in archive.namelist() if "linux64" in name]
        content = archive.read(name)
    assert content == BINARY.read_bytes()
    versions = {tuple(map(int, v.split(b"."))) for v in re.findall(rb"GLIBC_([0-9.]+)", content)}
    assert max(versions) <= (2, 17)
    assert b"GLIBCXX" not in content and b"libstdc++" not in content and b"libpython3.so" not in content


def runs(c_host: Path, stock: Path, **changes: str) -> None:
    run = in_host(c_host, stock / "Lag", **changes)
    assert run.returncode == 0, run.stdout + run.stderr
    assert final_values(run.stdout) == [pytest.approx(LAG_AT_01, rel=1e-12)]
    assert run.stderr == ""


def test_home_of_another_python_does_no_harm(c_host: Path, stock: Path, tmp_path: Path) -> None:
    runs(c_host, stock, PYTHONHOME=str(tmp_path))


def test_modules_of_another_python_do_no_harm(c_host: Path, stock: Path, tmp_path: Path) -> None:
    for name in ("json", "traceback", "encodings", "threading"):
        (tmp_path / f"{name}.py").write_text("raise ImportError('not for this Python')")
    runs(c_host, stock, PYTHONPATH=str(tmp_path))


def python3(folder: Path, script: str) -> str:
    """A PATH whose `python3` is a shell script."""
    file = folder / "python3"
    file.write_text(f"#!/bin/sh\n{script}\n")
    file.chmod(0o755)
    return str(folder)


@is_shared
@pytest.mark.parametrize("script", ["exit 1", "echo", "echo /nonexistent/libpython2.7.so.1.0", "kill -9 $$"])
def test_broken_python3_does_not_hide_a_library_found_by_name(
    c_host: Path, stock: Path, tmp_path: Path, script: str
) -> None:
    runs(c_host, stock, PATH=python3(tmp_path, script), LD_LIBRARY_PATH=FOLDER)


@pytest.fixture
def old(gcc: str, tmp_path: Path) -> Path:
    """What looks like the library of a Python that is too old."""
    (tmp_path / "old.c").write_text(OLD)
    library = tmp_path / "libpython3.8.so.1.0"
    subprocess.run([gcc, "-shared", "-fPIC", str(tmp_path / "old.c"), "-o", str(library)], check=True)
    return library


@is_shared
def test_old_python3_does_not_hide_a_newer_library(c_host: Path, stock: Path, tmp_path: Path, old: Path) -> None:
    runs(c_host, stock, PATH=python3(tmp_path, f"echo {old}"), LD_LIBRARY_PATH=FOLDER)


def test_old_library_that_is_named_is_refused(c_host: Path, stock: Path, old: Path) -> None:
    run = in_host(c_host, stock / "Lag", GAPSENSE_LIBPYTHON=str(old))
    assert run.returncode == 3
    assert f"cannot be used (`{old}` is not of Python 3.9 or newer)" in run.stdout


def test_old_python_of_the_host_itself_is_refused(c_host: Path, stock: Path, old: Path) -> None:
    run = in_host(c_host, stock / "Lag", LD_PRELOAD=str(old))
    assert run.returncode == 3
    assert "needs Python 3.9 or newer, and the Python in this process is 3.8.99" in run.stdout


@is_shared
def test_python_without_its_standard_library_says_so(c_host: Path, stock: Path, tmp_path: Path) -> None:
    """The same library, but with another prefix built in, where there is nothing."""
    prefix, library = sys.base_prefix.encode(), tmp_path / NAME
    elsewhere = b"/_" + prefix[2:]  # its end may be shared with other texts
    library.write_bytes(LIBPYTHON.read_bytes().replace(prefix, elsewhere))
    run = in_host(c_host, stock / "Lag", options="-c 2 -t 2", GAPSENSE_LIBPYTHON=str(library), PATH=str(tmp_path))
    assert run.returncode == 3, run.stdout + run.stderr
    assert run.stdout.count("LOG model 3 logStatusError This FMU could not start Python 3.") == 3
    assert "GAPSENSE_LIBPYTHON" in run.stdout


@is_shared
def test_packages_of_a_virtual_environment_are_found(c_host: Path, tmp_path: Path) -> None:
    (tmp_path / "greeting.py").write_text("TEXT = 'from the builder'")
    build_slaves(tmp_path, {"Greeter": GREETER})
    (tmp_path / "greeting.py").unlink()
    bin_, version = tmp_path / "venv" / "bin", f"python{sys.version_info.major}.{sys.version_info.minor}"
    packages = tmp_path / "venv" / "lib" / version / "site-packages"
    bin_.mkdir(parents=True)
    packages.mkdir(parents=True)
    base = Path(sys.base_prefix, "bin")
    (bin_ / "python3").symlink_to(base / version)
    (tmp_path / "venv" / "pyvenv.cfg").write_text(f"home = {base}\ninclude-system-site-packages = false\n")
    (packages / "greeting.py").write_text("TEXT = 'from the environment'")
    run = in_host(c_host, tmp_path / "Greeter", PATH=str(bin_))
    assert run.returncode == 0, run.stdout + run.stderr
    assert "LOG model 0 logAll from the environment" in run.stdout
