"""Every native FMU: its files, its description, and the numbers of the Python FMU."""

from __future__ import annotations

import re
import subprocess
import zipfile
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import pytest
from drivers import ROOT
from fmpy.validation import validate_fmu
from parts import LARGEST, Part, some
from unpacked_native import STRICT, Unpacked, bits, expected, outputs

from gapsense.fmi.sentences import say


def test_gives_the_reference_to_the_last_bit(part: Part, unpacked: Unpacked, host: Path) -> None:
    assert bits(outputs([host], unpacked, part)) == bits(expected(part))


def test_fmpy_finds_nothing_to_complain_about(part: Part) -> None:
    assert validate_fmu(str(part.path)) == []


def test_is_small_and_complete(part: Part) -> None:
    with zipfile.ZipFile(part.path) as archive:
        names = archive.namelist()
        page = archive.read("documentation/index.html").decode()
        library = archive.getinfo(f"binaries/linux64/{part.component.name}.so").compress_size
    assert part.path.stat().st_size + library < LARGEST  # as if for two platforms
    assert {"documentation/licenses/license.txt", "model.png", "sources/kernel.c", "sources/fmi2Functions.h"} <= {
        *names
    }
    assert {f"resources/{name}" for name in part.component.resources} <= {*names}
    assert "This is the native FMU" in page


def root_of(part: Part) -> Element:
    with zipfile.ZipFile(part.path) as archive:
        return ElementTree.fromstring(archive.read("modelDescription.xml"))


def test_says_what_it_can_do(part: Part) -> None:
    flags = root_of(part).find("CoSimulation")
    assert flags is not None
    assert {flags.get("needsExecutionTool"), flags.get("canBeInstantiatedOnlyOncePerProcess")} == {"false"}
    assert {flags.get("canGetAndSetFMUstate"), flags.get("canSerializeFMUstate")} == {"true"}


def test_lists_its_sources(part: Part) -> None:
    listed = {file.get("name") for file in root_of(part).iterfind("CoSimulation/SourceFiles/File")}
    with zipfile.ZipFile(part.path) as archive:
        assert listed == {Path(n).name for n in archive.namelist() if n.startswith("sources/") and n.endswith(".c")}


@pytest.mark.parametrize("part", some("drive_voltage"), indirect=True)
def test_sources_compile_as_a_stranger_compiles_them(part: Part, unpacked: Unpacked, host: Path) -> None:
    root = root_of(part)
    files = [file.attrib["name"] for file in root.iterfind("CoSimulation/SourceFiles/File")]
    library = unpacked.library()
    command = ["cc", *STRICT, "-O1", "-shared", "-fPIC", *files, "-o", str(library), "-lm"]
    done = subprocess.run(command, cwd=unpacked.folder / "sources", capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert bits(outputs([host], unpacked, part)) == bits(expected(part))


def test_variables_are_those_of_the_python_fmu(part: Part, fmus: Path) -> None:
    python, native = (ElementTree.tostring(root_of(p).find("ModelVariables")) for p in (part, on_python(part, fmus)))
    assert python == native
    assert root_of(part).get("guid") != root_of(on_python(part, fmus)).get("guid")


def on_python(part: Part, fmus: Path) -> Part:
    """The same with the Python FMU."""
    return part._replace(path=fmus / part.path.name)


CHANGED = (
    ("-std=c99", "-ffast-math"),
    ("-std=gnu99", "-ffp-contract=fast", "-mfma"),
    ("-std=c99", "-ffinite-math-only"),
)


@pytest.mark.parametrize("part", [ROOT / "fmus" / "semera"], ids=["semera"], indirect=True)
@pytest.mark.parametrize(
    "options",
    [CHANGED[0], *(pytest.param(o, marks=pytest.mark.slow) for o in (*CHANGED[1:], ("-std=c99", "-mfma")))],
    ids=" ".join,
)
def test_a_binary_whose_compiler_has_changed_the_arithmetic_refuses(
    options: tuple[str, ...], part: Part, unpacked: Unpacked, host: Path
) -> None:
    """By a message, and NULL instead of an instance; processors with FMA are welcome."""
    if "-mfma" in options and not has_fma():
        pytest.skip("a processor without FMA")
    sources = sorted((unpacked.folder / "sources").glob("*.c"))
    command = ["gcc", "-O2", *options, "-shared", "-fPIC", *map(str, sources), "-o", str(unpacked.library()), "-lm"]
    subprocess.run(command, check=True, capture_output=True)
    if options == ("-std=c99", "-mfma"):
        assert bits(outputs([host], unpacked, part)) == bits(expected(part))
        return
    with pytest.raises(AssertionError, match=re.escape(say("not_exact"))):
        outputs([host], unpacked, part)


def has_fma() -> bool:
    """Whether the processor here can do a product and a sum in one operation."""
    about = Path("/proc/cpuinfo")
    return about.is_file() and " fma " in about.read_text(encoding="utf-8")


def test_c_calls_only_functions_of_the_library_that_round_in_one_way(part: Part) -> None:
    with zipfile.ZipFile(part.path) as archive:
        code = archive.read("sources/kernel.c").decode()
    assert {*re.findall(r"F\((\w+)\)\(", code)} <= {"sqrt", "fabs", "floor"} and "F(" in code
