"""A component as C gives on a computer what the Python kernel gives, whichever of its outputs are wanted."""

from __future__ import annotations

import itertools
import random
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from host import ROOT, compile_, expected, played

from gapsense.embedded.design import REALS, Design, make_design
from gapsense.embedded.export import check_memory, export, make_texts, memory
from gapsense.fmi.components import find_components, load_component
from gapsense.problems import InputError

FOLDERS = {folder.name: folder for folder in find_components(ROOT / "fmus")}
# Largest error of float on the reference record, of the largest value of each output. The records of `ekf`, `ertss` and
# `bounded_ukf` are no physics: float and double part there; for them and `mhe` test_boards.py has records of a valve.
FLOAT = {
    "hybrid_ekf": 5e-6,
    "integral_estimator": 1e-4,
    "play_actuator": 1e-4,
    "pot_magnet": 1e-4,
    "reluctance_actuator": 1e-4,
    "semera": 2e-3,
    "solenoid_valve": 1e-3,
}
QUICK = ("drive_voltage", "ekf", "sensor")
SOME = [pytest.param(n, marks=() if n in QUICK else pytest.mark.slow) for n in FOLDERS]
CAUSES = "knownConditionTrueFalse"  # guards of divisors are conditions on conditions: compilers drop them
CHECK = (
    "cppcheck",
    "--enable=all",
    "--std=c99",
    "--quiet",
    "--suppress=missingIncludeSystem",
    "-D__GNUC__",  # else it looks at the files twice, for a line that other compilers need
    f"--suppress={CAUSES}",
    "--suppress=unmatchedSuppression",
)


@pytest.fixture(params=FOLDERS)
def folder(request: pytest.FixtureRequest) -> Path:
    return FOLDERS[request.param]


def some_outputs(folder: Path) -> list[str]:
    names = [port.name for port in load_component(folder).of("output")]
    rng = random.Random(folder.name)
    return rng.sample(names, rng.randrange(1, len(names)))


@pytest.mark.parametrize("name", SOME)
def test_double_has_the_bits_of_the_python_kernel(name: str, tmp_path: Path) -> None:
    design = make_design(FOLDERS[name], "double")
    assert same(played(design, tmp_path), expected(design))


@pytest.mark.parametrize("name", SOME)
def test_so_have_some_outputs_with_parameters_as_constants(name: str, tmp_path: Path) -> None:
    design = make_design(FOLDERS[name], "double", some_outputs(FOLDERS[name]), is_baked=True)
    assert same(played(design, tmp_path), expected(design))


@pytest.mark.slow
def test_so_have_some_outputs_with_parameters(folder: Path, tmp_path: Path) -> None:
    design = make_design(folder, "double", some_outputs(folder))
    assert same(played(design, tmp_path), expected(design, most=10**9))


def same(printed: list[list[float]], wanted: list[list[float]]) -> bool:
    return bool(np.array_equal(np.array(printed)[: len(wanted)], np.array(wanted), equal_nan=True))


@pytest.mark.parametrize("name", FLOAT)
def test_float_is_near(name: str, tmp_path: Path) -> None:
    design = make_design(FOLDERS[name], "float")
    wanted = np.array(expected(design))
    error = np.abs(np.array(played(design, tmp_path))[: len(wanted)] - wanted).max(axis=0)
    nominal = [port.nominal for port in design.component.of("output") if port.field in design.kept["outputs"]]
    assert np.all(error <= FLOAT[name] * np.maximum(np.abs(wanted).max(axis=0), nominal)), error


@pytest.mark.parametrize("name", SOME)
def test_compilers_of_c_and_of_cpp_have_nothing_to_say(name: str, tmp_path: Path) -> None:
    design = make_design(FOLDERS[name], "float")
    export([design], tmp_path)
    files = [str(tmp_path / f"{design.name}{ending}.c") for ending in ("", "_main")]
    compile_("gcc", "-std=c99", "-fsyntax-only", *files)
    if shutil.which("g++"):
        compile_("g++", "-x", "c++", "-fsyntax-only", *files)
    code = [line for line in Path(files[0]).read_text().splitlines() if "/*" not in line]
    assert "double" not in "\n".join(code)


@pytest.mark.parametrize("name", ["integral_estimator", "sensor"])
def test_cppcheck_has_nothing_to_say(name: str, tmp_path: Path) -> None:
    checked(make_design(FOLDERS[name]), tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["semera", "hybrid_ekf", "drive_voltage", "play_actuator", "pot_magnet"])
def test_nor_of_larger_ones(name: str, tmp_path: Path) -> None:
    """On the largest, `ekf`, `ertss`, `bounded_ukf`, `mhe` and actuators with micro-steps, it works for very long."""
    checked(make_design(FOLDERS[name], is_baked=True), tmp_path)


def checked(design: Design, folder: Path) -> None:
    if not shutil.which("cppcheck"):
        pytest.skip("cppcheck is not installed")
    export([design], folder)
    files = [str(folder / f"{design.name}{ending}.c") for ending in ("", "_main")]
    done = subprocess.run([*CHECK, "--error-exitcode=1", *files], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[:2000]


def test_no_output_but_those_wanted_is_computed() -> None:
    every, few = (make_design(FOLDERS["ertss"], "float", outputs) for outputs in ((), ("flux_linkage",)))
    assert {"waiting", "samples"} < set(every.kept["state"])
    assert not {"waiting", "samples", "windows"} & set(few.kept["state"])
    assert few.kept["outputs"] == ["flux_linkage"]


@pytest.mark.slow
@pytest.mark.parametrize("is_baked", [False, True])
def test_memory_is_for_the_samples_that_are_kept_and_its_bits_are_those_of_the_kernel(
    is_baked: bool, tmp_path: Path
) -> None:
    given = {"window.memory": 256.0, "window.longest": 2e-3, "option.command": True}
    design = make_design(FOLDERS["mhe"], "double", ("position", "smoothed_position"), given, is_baked)
    assert same(played(design, tmp_path), expected(design))
    text = (tmp_path / "mhe.h").read_text()
    assert all(f"double {name}[256];" in text for name in ("voltages", "weights", "commands", "positions"))
    assert "window_memory;" not in text  # it can no longer be changed
    assert memory(design) < 256 * 40 + 7100 and "10,240 bytes are for" in (tmp_path / "README.md").read_text()
    with pytest.raises(InputError, match=r"more than the 16,000 .*`--set window.memory=\d+`") as told:
        check_memory([design], 16000)
    count = int(str(told.value).partition("window.memory=")[2].partition("`")[0])
    check_memory([design._replace(values={**design.values, "window_memory": count})], 16000)
    with pytest.raises(InputError, match=f"window.memory={count}`"):
        check_memory([design._replace(values={**design.values, "window_memory": count + 1})], 16000)


def test_parameters_that_no_output_needs_are_not_asked_for() -> None:
    design = make_design(FOLDERS["semera"], "float", ("flux_linkage",))
    assert "coil_turns" not in make_texts([design])["semera.h"]
    assert "coil_turns" in make_texts([make_design(FOLDERS["semera"])])["semera.h"]


def test_comments_have_units_ranges_and_the_lines_of_the_kernel() -> None:
    files = make_texts([make_design(FOLDERS["semera"])])
    assert "float prior_resistance; /* [Ohm] Expected resistance at the start; at least 1e-09 */" in files["semera.h"]
    assert "float current; /* last current measurement that was not lost [A] */" in files["semera.h"]
    assert "/* semera._see: S = H @ (prior.cov @ H) + R */" in files["semera.c"]
    assert "/* kalman.condition: K = Ph / pivot(" in files["semera.c"]


def test_the_same_design_gives_the_same_files() -> None:
    assert make_texts([make_design(FOLDERS["ekf"])]) == make_texts([make_design(FOLDERS["ekf"])])


def test_page_has_a_row_of_every_component_in_float_and_double() -> None:
    page = (ROOT / "docs" / "microcontrollers.md").read_text(encoding="utf-8").partition("<!-- so is this -->")[2]
    rows = re.findall(r"^\| `(\w+)` \| (float|double) \|", page, re.MULTILINE)
    assert sorted(rows) == sorted(itertools.product(FOLDERS, REALS))


def test_memory_is_in_proportion_to_its_parameter() -> None:
    """That a smaller memory is enough is seen on a board: `motion.memory` among the rows of costs.py."""
    less, every = (make_design(FOLDERS["ertss"], given={"motion.memory": n}) for n in (25.0, 1024.0))
    assert less.memories() == {"waiting": 112, "samples": 1725} and memory(less) < 10_000 < 300_000 < memory(every)
    text = make_texts([less])
    assert "float samples[1725];" in text["ertss.h"] and "k < 1725" in text["ertss.c"]
    assert "within(" in text["ertss.c"] and "70656" not in text["ertss.c"]
    assert "7,350 bytes are for `motion.memory` = 25" in text["README.md"]
    with pytest.raises(InputError, match=r"`--set motion.memory=\d+`"):
        check_memory([every], 64_000)
