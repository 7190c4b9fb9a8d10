"""Native FMUs under sanitizers, in threads, in large numbers, and in processes with a locale of their own."""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Sequence
from pathlib import Path

import pytest
import warm
from drivers import IMPORTS, ROOT, call, fresh
from parts import FOLDERS, Part, sample_time, some, tuned
from refusals import refusals
from unpacked_native import STRICT, Unpacked, bits, compiled_host, expected, outputs, unpack

SANITIZED = ("-g1", "-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover=undefined")
KEPT = ROOT / "build" / "c_code"  # objects by their sources and options
INCLUDED = re.compile(r'^#include "(.+)"', re.MULTILINE)
Hosts = dict[int, Path]
OFTEN = ("drive_voltage", "mhe", "sensor")
THREADS = """
import sys, json
sys.path.insert(0, sys.argv[1])
from concurrent.futures import ThreadPoolExecutor
from fmu_host import Fmu, Instance
fmu = Fmu(sys.argv[2])
rows = fmu.stimulus(100)
def work(k):
    return [Instance(fmu, f"{k} {n}").run(rows) for n in range(3)]
with ThreadPoolExecutor(8) as pool:
    runs = [run for runs in pool.map(work, range(16)) for run in runs]
print(json.dumps([len(runs), all(run == runs[0] for run in runs)]))
"""
MANY = """
import sys, json
sys.path.insert(0, sys.argv[1])
from fmu_host import Fmu, Instance
fmu = Fmu(sys.argv[2])
rows = fmu.stimulus(3)
instances = [Instance(fmu, str(k)) for k in range(int(sys.argv[3]))]
traces = [one.start(rows[0]) for one in instances]
traces = [one.step(rows[1], 0.0, fmu.step) for one in instances]
for one in instances:
    one.free()
print(json.dumps([len(traces), all(trace == traces[0] for trace in traces)]))
"""
STEPS = """
import sys, json
sys.path.insert(0, sys.argv[1])
from fmu_host import Fmu, Instance
fmu = Fmu(sys.argv[2])
one, rows = Instance(fmu), fmu.stimulus(9, held=0.0)
one.start(rows[0])
print(json.dumps([one.step(row, *step) for row, step in zip(rows[1:], json.loads(sys.argv[3]))]))
"""
GERMAN = """
import sys, json, locale
locale.setlocale(locale.LC_NUMERIC, "de_DE.UTF-8")
sys.path.insert(0, sys.argv[1])
from fmu_host import Fmu, Instance, attempt
fmu = Fmu(sys.argv[2])
one = Instance(fmu)
trace = one.run(fmu.stimulus(20), json.loads(sys.argv[3]))
answer = attempt(one.slave.doStep, 1.5, 0.25)
print(json.dumps([locale.localeconv()["decimal_point"], trace, answer]))
"""


def child(code: str, *arguments: object, **environment: str) -> list[object]:
    """What a script prints last, in a process of its own."""
    words, env = [str(ROOT / "tests" / "fmus"), *map(str, arguments)], {**os.environ, **environment}
    done = warm.run(code, *words, imports=IMPORTS, given="", env=env, seconds=120)
    assert done.returncode == 0, done.stderr
    return list(json.loads(done.stdout.splitlines()[-1]))


@pytest.mark.parametrize("part", some("drive_voltage"), indirect=True)
def test_threads_have_instances_of_their_own(part: Part) -> None:
    assert child(THREADS, part.path) == [48, True]


@pytest.mark.parametrize("count", [300, pytest.param(1000, marks=pytest.mark.slow)])
@pytest.mark.parametrize("part", some("semera"), indirect=True)
def test_hundreds_of_instances(part: Part, count: int) -> None:
    assert child(MANY, part.path, count) == [count, True]


@pytest.mark.parametrize("part", some("sensor"), indirect=True)
def test_step_below_a_rounding_of_its_time_ends(part: Part, fmus: Path) -> None:
    period = sample_time(part.component)
    if not period:
        pytest.skip("a component that is not sampled takes any step")
    grid = [(0.0, period), (period, 1e-300), (period, period)]
    for path in (fmus / part.path.name, part.path):
        first, tiny, last = child(STEPS, path, json.dumps(grid))
        assert tiny == first != last


@pytest.mark.parametrize("part", some("mhe"), indirect=True)
def test_steps_allocate_no_memory(part: Part, unpacked: Unpacked, host: Path, tmp_path: Path) -> None:
    if sys.platform != "linux":
        pytest.skip("counts allocations by LD_PRELOAD")
    counter, source = tmp_path / "count.so", Path(__file__).with_name("count_malloc.c")
    subprocess.run(["cc", "-shared", "-fPIC", str(source), "-o", str(counter), "-ldl"], check=True)
    counts = [len(part.component.of(causality)) for causality in ("input", "output")]
    words = [host, unpacked.library(), unpacked.guid, unpacked.resources, part.folder / "reference.csv", *counts]
    environment = {**os.environ, "LD_PRELOAD": str(counter)}
    told = [
        subprocess.run([*map(str, words), times], env=environment, capture_output=True, text=True, check=True).stderr
        for times in ("1", "5")
    ]
    assert told[0] == told[1]
    assert "allocations" in told[0]


@pytest.fixture(scope="session")
def german(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Folder of locales with one whose numbers have a decimal comma; it has numbers only, as others take a second."""
    folder = tmp_path_factory.mktemp("locales")
    (folder / "numbers").write_text('LC_NUMERIC\ncopy "de_DE"\nEND LC_NUMERIC\n')
    command = ["localedef", "-c", "-i", str(folder / "numbers"), "-f", "UTF-8", str(folder / "de_DE.UTF-8")]
    if shutil.which("localedef"):
        subprocess.run(command, capture_output=True, check=False)  # it warns of all that is missing
    if not (folder / "de_DE.UTF-8" / "LC_NUMERIC").is_file():
        pytest.skip("no localedef, or no sources of locales (Debian's package `locales`)")
    return str(folder)


def test_decimal_comma_of_the_host_changes_nothing(natives: Path, german: str, tmp_path: Path) -> None:
    table = tmp_path / "own.csv"
    table.write_text("time [s],voltage [V]\n0,0.5\n0.001,1.25\n0.01,2.75\n")
    given = json.dumps({"waveform": "table", "table.file": str(table)})
    point, *plain = child(GERMAN.replace("de_DE.UTF-8", "C"), natives / "DriveVoltage.fmu", given)
    comma, *foreign = child(GERMAN, natives / "DriveVoltage.fmu", given, LOCPATH=german)
    assert (point, comma) == (".", ",")
    assert foreign == plain
    assert "0.25 s: this step begins" in json.dumps(plain)


def sanitized(unpacked: Unpacked, kernel: Sequence[str] = ("-O0",)) -> list[str]:
    """Compile the library of an FMU anew, so that it finds wrong accesses to memory.

    The kernel without optimisation takes a third of the time to compile, and three times as long to run.
    """
    folder, library = unpacked.folder / "sources", unpacked.library()
    objects = [compiled(folder, p.name, kernel if p.name == "kernel.c" else ()) for p in sorted(folder.glob("*.c"))]
    gcc_said(["gcc", *SANITIZED, "-shared", *map(str, objects), "-o", str(library), "-lm"], folder)
    return [gcc_said(["gcc", "-print-file-name=libasan.so"], folder).strip()]


def compiled(folder: Path, name: str, options: Sequence[str]) -> Path:
    """A source compiled once, also for other FMUs that have it: FMI 2.0 and 3.0 share kernels, components the rest."""
    command = ["gcc", *STRICT, *SANITIZED, *options, "-fPIC", "-c", name, "-o"]
    kept = KEPT / f"{hashlib.sha256(repr((command, included(folder, name))).encode()).hexdigest()[:32]}.o"
    if not kept.exists():
        KEPT.mkdir(parents=True, exist_ok=True)
        part = kept.with_suffix(f".{os.getpid()}")
        gcc_said([*command, str(part)], folder)
        part.replace(kept)
    return kept


def included(folder: Path, name: str) -> list[str]:
    """Texts of a source and of what it includes, except from the system."""
    text = (folder / name).read_text(encoding="utf-8")
    return [text, *(more for header in INCLUDED.findall(text) for more in included(folder, header))]


def gcc_said(command: Sequence[str], folder: Path) -> str:
    """What it prints; nothing is wrong."""
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture(scope="session")
def gcc() -> None:
    if sys.platform != "linux" or not shutil.which("gcc"):
        pytest.skip("no gcc, which has the sanitizers")


@pytest.fixture(scope="module")
def watching(gcc: None, tmp_path_factory: pytest.TempPathFactory) -> Hosts:
    """The hosts with sanitizers, by the version of FMI."""
    folder, sources = tmp_path_factory.mktemp("watching"), {2: "host.c", 3: "host3.c"}
    return {fmi: compiled_host(("gcc",), folder / f"host{fmi}", *SANITIZED, source=s) for fmi, s in sources.items()}


@pytest.mark.slow
def test_sanitizers_find_nothing_in_the_reference_run(part: Part, unpacked: Unpacked, watching: Hosts) -> None:
    sanitized(unpacked)
    assert bits(outputs([watching[2]], unpacked, part)) == bits(expected(part))


@pytest.mark.slow
def test_sanitizers_find_nothing_in_the_reference_run_of_fmi_3(part: Part, watching: Hosts, tmp_path: Path) -> None:
    unpacked = unpack(part.path.parent / "fmi3" / part.path.name, tmp_path / "fmu")
    sanitized(unpacked)
    assert bits(outputs([watching[3]], unpacked, part)) == bits(expected(part))


@pytest.mark.slow
@pytest.mark.usefixtures("watching")
@pytest.mark.parametrize("part", [f for f in FOLDERS if f.name in OFTEN], indirect=True, ids=lambda f: f.name)
def test_sanitizers_find_nothing_in_refusals_and_saved_states(
    part: Part, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    unpacked = unpack(part.path, tmp_path / "unpacked")
    cases = [{"name": name, **case} for name, (case, _) in refusals(part.component).items()]
    plain = fresh("refusals", part.path, tmp_path / "plain", cases)
    [library] = sanitized(unpacked)
    checked = tmp_path / part.path.name
    with zipfile.ZipFile(checked, "w") as archive:
        for path in sorted(unpacked.folder.rglob("*")):
            archive.write(path, path.relative_to(unpacked.folder))
    monkeypatch.setenv("LD_PRELOAD", library)
    monkeypatch.setenv("ASAN_OPTIONS", "detect_leaks=0")
    for function, *more in (("refusals", tmp_path / "checked", cases), ("save", tuned(part.component))):
        done = call(function, checked, *more)
        assert done.returncode == 0, done.stderr
        if function == "refusals":
            assert json.loads(done.stdout.splitlines()[-1])["answers"] == plain["answers"]
