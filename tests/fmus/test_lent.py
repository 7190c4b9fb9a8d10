"""What a running slave lends to the Linux binary: the answers are the slave's own, and Python is asked little."""

from __future__ import annotations

import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
from hosting import in_python, raw
from parts import FEW, FOLDERS, Part

FUNCTIONS = """
import math, random, shutil, sys, tempfile, zipfile
import fmpy, fmpy.fmi2

def stepped():
    folder = tempfile.mkdtemp(dir=sys.argv[1])
    zipfile.ZipFile(sys.argv[2]).extractall(folder)
    guid = fmpy.read_model_description(folder, validate=False).guid
    names = {"modelIdentifier": "ReluctanceActuator", "instanceName": "one"}
    fmu = fmpy.fmi2.FMU2Slave(guid=guid, unzipDirectory=folder, **names)
    fmu.instantiate(); fmu.setupExperiment(); fmu.enterInitializationMode(); fmu.exitInitializationMode()
    fmu.setReal([0], [30.0])
    for k in range(20):
        fmu.doStep(k * 1e-4, 1e-4)
    values = fmu.getReal([1, 2, 3, 4])
    fmu.freeInstance()
    shutil.rmtree(folder)
    return values

def attempt(function, x):
    try:
        return function(x)
    except ArithmeticError as error:
        return repr(error)
    except ValueError as error:
        return repr(error)

assert stepped() == stepped() == stepped()  # the first library is unloaded, as far as the host knows
(name,) = [name for name in sys.modules if name.startswith("_gapsense_reluctance") and name.endswith(".kernel")]
kernel = sys.modules[name]
rng = random.Random(1)
odd = [0.0, -0.0, 1.0, -1.0, 710.0, -746.0, math.inf, -math.inf, 5e-324, 3, True]
for name in ("exp", "log", "tanh"):
    lent = getattr(kernel, name)
    own = lent.__self__
    assert type(lent) is type(math.exp) and type(own) is type(stepped)
    for x in [*odd, *(rng.uniform(-30.0, 30.0) for _ in range(2000))]:
        assert attempt(lent, x) == attempt(own, x), (name, x)
    assert math.isnan(lent(math.nan))
    try:
        lent("1")
    except TypeError:
        print(name)
"""
pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the shim is for Linux")


# 5,000 calls of each of 17 components: what lends is the same code in all of them, so it gets 85,000; few are quick
@pytest.mark.parametrize(
    ("part", "count"),
    [
        *(pytest.param(folder, 800, id=folder.name) for folder in FOLDERS if folder.name in FEW),
        *(pytest.param(folder, 5_000, id=f"{folder.name}-long", marks=pytest.mark.slow) for folder in FOLDERS),
    ],
    indirect=["part"],
)
def test_binary_and_slave_answer_alike(part: Part, tmp_path: Path, count: int) -> None:
    with zipfile.ZipFile(part.path) as archive:
        archive.extractall(tmp_path)
    ranges = [
        (-p.nominal if p.min is None else p.min, p.nominal if p.max is None else p.max)
        for p in part.component.of("input")
    ]
    seen = raw("twins", tmp_path, ranges, len(part.component.of("output")), part.component.step_size, count, 1)
    assert seen["DoStep 0"] > count // 5 and seen["save 0"] > 3 and seen["restore 0"] > 3, seen
    assert seen["DoStep 3"] > 3, seen


def test_usual_calls_do_not_ask_the_slave(semera: Path) -> None:
    """After any other call, the slave is asked until the next step."""
    found = raw("lending.asked", semera)
    assert all(facts["stati"] == [0] for facts in found.values())
    between = {"lend": 100, "set_real": 100}
    assert {name: facts["calls"] for name, facts in found.items()} == {
        "nothing": {},
        "no variable": {},
        "parameter": {"lend": 99, "set_real": 99, "get_real": 100},
        "saved": between | {"_get_fmu_state": 100},
        "restored": between | {"_set_fmu_state": 100},
    }


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ("raises", "ArithmeticError: in the kernel"),
        ("interrupted", "KeyboardInterrupt"),
        ("infinite", "output `resistance` is not finite. Check the parameters, or reduce the step."),
        ("no numbers", "TypeError"),
    ],
)
def test_step_that_fails_is_told_and_outputs_are_kept(semera: Path, kind: str, words: str) -> None:
    found = raw("lending.failing", semera, kind)
    ((status, category, text),) = found["said"]
    assert (found["status"], status, category) == (3, 3, "logStatusError")
    assert text.startswith("`one` (Semera), t = 0.00015 s, step = 5e-05 s: ") and words in text
    assert found["is_kept"] and found["afterwards"] == [[3, 3, 0], 0]


def test_values_can_be_set_and_got_after_the_end_of_python(semera: Path, gcc: str, tmp_path: Path) -> None:
    from gapsense.fmi.shim.build import headers

    source, library = Path(__file__).with_name("after_python.c"), tmp_path / "after_python.so"
    subprocess.run([gcc, "-shared", "-fPIC", f"-I{headers()}", str(source), "-o", str(library)], check=True)
    fatal = 4
    assert raw("lending.without_python", semera, str(library)) == [0, 0, fatal, fatal, 0.5]


def test_kernels_call_exp_log_and_tanh_in_c_with_the_values_and_errors_of_their_own(fmus: Path, tmp_path: Path) -> None:
    done = in_python(FUNCTIONS, tmp_path, fmus / "ReluctanceActuator.fmu")
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["exp", "log", "tanh"]
