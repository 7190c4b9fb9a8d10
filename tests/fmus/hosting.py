"""Slaves as pythonfmu has them, with our Linux binary, and hosts to run them in.  Everything in fresh processes."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import zipfile
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from gapsense.fmi.shim import BINARY

PERCENT_TEXT = "100 %s %d %n"
LAG_AT_01 = 1.0 - 2.718281828459045**-1.0  # ten steps of 0.01 with a time constant of 0.1

SLAVE = """
from math import exp
from pythonfmu import Fmi2Causality, Fmi2Slave, Real
from pythonfmu.enums import Fmi2Status

class {name}(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.u = 1.0
        self.y = 0.0
        self.register_variable(Real("u", causality=Fmi2Causality.input))
        self.register_variable(Real("y", causality=Fmi2Causality.output))

    def exit_initialization_mode(self):
        {on_init}

    def do_step(self, current_time, step_size):
        {on_step}
        self.y += (self.u - self.y) * (1.0 - exp(-step_size / 0.1))
        return True
"""
SLAVES = {
    "Lag": ("pass", "pass"),
    "Raiser": ("pass", "if current_time > 0.025: raise ValueError('cannot go on, 50 %s done %n')"),
    "Talker": ("pass", f"self.log('{PERCENT_TEXT}', Fmi2Status.warning, 'logStatusWarning'); print('printed')"),
    "InitRaiser": ("raise ValueError('bad start')", "pass"),
}
BUILD = "import sys; from pythonfmu import FmuBuilder; [FmuBuilder.build_FMU(s, dest='.') for s in sys.argv[1:]]"


def build_slaves(folder: Path, slaves: dict[str, str]) -> Path:
    """Put `<name>.fmu` and the extracted `<name>/` of each slave into the folder; their scripts are given."""
    for name, script in slaves.items():
        (folder / f"{name.lower()}_slave.py").write_text(script)
    scripts = [f"{name.lower()}_slave.py" for name in slaves]
    subprocess.run([sys.executable, "-c", BUILD, *scripts], cwd=folder, check=True, capture_output=True)
    for name in slaves:
        insert_shim(folder / f"{name}.fmu", name)
        with zipfile.ZipFile(folder / f"{name}.fmu") as archive:
            archive.extractall(folder / name)
    return folder


def insert_shim(fmu: Path, name: str) -> None:
    """Put our binary in the place of pythonfmu's, as the packager does."""
    library = f"binaries/linux64/{name}.so"
    with zipfile.ZipFile(fmu) as archive:
        entries = {item.filename: archive.read(item) for item in archive.infolist() if not item.is_dir()}
    entries[library] = BINARY.read_bytes()
    with zipfile.ZipFile(fmu, "w") as archive:
        for path, content in entries.items():
            archive.writestr(path, content)


def environment(**changes: str) -> dict[str, str]:
    """Environment in which the `python3` on PATH is the interpreter of this test."""
    env = {
        key: value for key, value in os.environ.items() if key not in ("GAPSENSE_LIBPYTHON", "PYTHONPATH", "LD_PRELOAD")
    }
    env["PATH"] = os.pathsep.join((str(Path(sys.executable).parent), env.get("PATH", os.defpath)))
    return env | changes


def in_host(
    host: Path, *folders: Path, options: str = "", uri: str = "", instance: str = "model", **changes: str
) -> subprocess.CompletedProcess[str]:
    """Run extracted FMUs in the C host."""
    fmus = []
    for folder in folders:
        name = next((folder / "binaries" / "linux64").glob("*.so"))
        fmus += [str(name), uri or (folder / "resources").as_uri(), ""]
    command = [str(host), *options.split(), "-i", instance, *fmus, "--", "1"]
    how = {"capture_output": True, "text": True, "errors": "surrogateescape", "timeout": 60}
    return subprocess.run(command, env=environment(**changes), **how)  # type: ignore[call-overload,no-any-return]


def final_values(output: str) -> list[float]:
    return [float(line.split()[2]) for line in output.splitlines() if line.split()[1:2] == ["0.1"]]


def in_python(code: str, *arguments: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", code, *map(str, arguments)]
    return subprocess.run(command, env=environment(), capture_output=True, text=True, timeout=60)


def raw(function: str, folder: Path, *arguments: Any, **changes: str) -> Any:
    """What a function of raw.py gives for an extracted FMU; or fuzz.py, twins.py, or `lending.f` in lending.py."""
    name = next((folder / "binaries" / "linux64").glob("*.so"))
    guid = ElementTree.parse(folder / "modelDescription.xml").getroot().attrib["guid"]
    file, _, inside = function.rpartition(".")
    script = [f"{function}.py"] if function in ("fuzz", "twins") else [f"{file or 'raw'}.py", inside]
    command = [sys.executable, str(Path(__file__).with_name(script[0])), *script[1:], str(name)]
    command += [(folder / "resources").as_uri(), guid, *map(json.dumps, arguments)]
    run = subprocess.run(command, env=environment(**changes), capture_output=True, text=True, timeout=300)
    assert run.returncode == 0, run.stdout + run.stderr
    return json.loads(run.stdout.splitlines()[-1])
