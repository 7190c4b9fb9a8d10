"""What FMUs of FMI 3.0 say about themselves: valid, complete, and the same as those of FMI 2.0."""

from __future__ import annotations

import subprocess
import sys
import zipfile
from pathlib import Path
from xml.etree import ElementTree

import fmpy
import pytest
from fmpy.validation import validate_fmu
from lxml import etree
from native3 import FOLDERS, Fmu, Instance, built, fmu, placed  # noqa: F401

from gapsense.fmi import references
from gapsense.fmi.fmi3.description import TERMINALS, TERMINALS_ICON, terminals
from gapsense.fmi.native import package
from gapsense.fmi.native import parts as native_parts
from gapsense.fmi.native.compile import fat, thin, timeless
from gapsense.fmi.native.package import libraries_3
from gapsense.fmi.tables import heads, read_table
from gapsense.kernels.kernel import Kernel

SCHEMAS = Path(fmpy.__file__).parent / "schema" / "fmi3"
TYPES = {"Real": "Float64", "Integer": "Int32", "Boolean": "Boolean", "String": "String"}


@pytest.fixture(params=FOLDERS, ids=lambda folder: folder.name)
def folder(request: pytest.FixtureRequest) -> Path:
    return Path(request.param)


@pytest.fixture
def own(folder: Path) -> Fmu:
    return fmu(folder)


def member(own: Fmu, name: str) -> bytes:
    with zipfile.ZipFile(own.path) as archive:
        return archive.read(name)


def test_fmpy_finds_nothing_to_complain_about(own: Fmu) -> None:
    assert validate_fmu(str(own.path)) == []


@pytest.mark.parametrize(
    ("name", "schema"), [(TERMINALS, "fmi3TerminalsAndIcons"), ("sources/buildDescription.xml", "fmi3BuildDescription")]
)
def test_other_xml_obeys_its_schema(own: Fmu, name: str, schema: str) -> None:
    etree.XMLSchema(file=str(SCHEMAS / f"{schema}.xsd")).assertValid(etree.fromstring(member(own, name)))


def test_variables_are_those_of_fmi_2(own: Fmu) -> None:
    two = fmpy.read_model_description(str(built() / own.path.name)).modelVariables
    three = own.description.modelVariables[: len(two)]
    for a, b in zip(two, three):
        about = [(v.name, v.valueReference, v.causality, v.variability, v.description) for v in (a, b)]
        assert about[0] == about[1]
        assert b.type == ("Enumeration" if own.component.ports[a.valueReference].choices else TYPES[a.type])
        if a.type == "Real":
            limits = [(v.unit, v.displayUnit, v.min, v.max, v.nominal, v.start) for v in (a, b)]
            assert limits[0] == limits[1]


def test_abilities(own: Fmu) -> None:
    kind = own.description.coSimulation
    assert kind.canGetAndSetFMUState if hasattr(kind, "canGetAndSetFMUState") else kind.canGetAndSetFMUstate
    assert kind.canHandleVariableCommunicationStepSize
    text = member(own, "modelDescription.xml")
    assert b"canReturnEarly" not in text and b"EarlyFrom" not in text and b"hasEventMode" not in text
    assert b"needsExecutionTool" not in text and b"<Clock" not in text


def test_tables_are_arrays_with_the_shipped_numbers(own: Fmu, folder: Path) -> None:
    one = Instance(own)
    one.start()
    for port in own.component.ports:
        if port.columns:
            columns = read_table(folder / port.start, tuple(heads(port.columns)))
            rows = len(columns[0])
            assert one.get(f"{port.name}.rows") == rows
            names = [head.split(" [")[0] for head in heads(port.columns)]
            assert [one.get(f"{port.name}.{name}", rows) for name in names] == columns
            starts = [own.variables[f"{port.name}.{name}"].start for name in names]
            assert [[float(word) for word in start.split()] for start in starts] == columns


def test_terminals_name_variables_that_exist_and_fit_each_other(own: Fmu) -> None:
    found = terminals(own.component)
    members = [variable for own_members in found.values() for variable in own_members.values()]
    assert set(members) <= set(own.variables) and len(members) == len(set(members))
    assert {port.name for port in own.component.of("output")} <= set(members)
    given: dict[str, set[str]] = {}
    for folder in FOLDERS:
        outputs = {port.name for port in fmu(folder).component.of("output")}
        for name in (terminals_of_outputs(folder), folder.name):  # an input may come from one component only
            given.setdefault(name, set()).update(outputs)
    for port in own.component.of("input"):
        owner, _, signal = port.source.partition(".")
        assert not signal or signal in given[owner]


def terminals_of_outputs(folder: Path) -> str:
    outputs = [port.name for port in fmu(folder).component.of("output")]
    return next(name for name, members in terminals(fmu(folder).component).items() if outputs[0] in members.values())


def test_archive_is_complete(own: Fmu) -> None:
    with zipfile.ZipFile(own.path) as archive:
        names = set(archive.namelist())
    sources = ElementTree.fromstring(member(own, "sources/buildDescription.xml")).iter("SourceFile")
    wanted = {"documentation/index.html", "documentation/licenses/license.txt", TERMINALS_ICON, TERMINALS}
    wanted |= {f"sources/{source.attrib['name']}" for source in sources}
    wanted |= {f"{references.FOLDER}fmi-ls-manifest.xml", f"{references.FOLDER}{references.EXPERIMENTS}"}
    assert wanted <= names and "model.png" not in names
    assert f"binaries/{fmpy.platform_tuple}/{own.component.name}{fmpy.sharedLibraryExtension}" in names
    assert own.path.stat().st_size < 300_000
    assert b"FMI 3.0 co-simulation" in member(own, "documentation/index.html")


def test_library_exports_every_function_of_the_standard() -> None:
    own = fmu(FOLDERS[0])
    library = own.folder / "binaries" / fmpy.platform_tuple / f"{own.component.name}{fmpy.sharedLibraryExtension}"
    header = (Path(fmpy.__file__).parent / "c-code" / "fmi3Functions.h").read_text()
    names = {line.split()[-1].rstrip(";") for line in header.splitlines() if line.startswith("FMI3_Export fmi3")}
    assert len(names) > 60
    code = f"import ctypes, sys; l = ctypes.CDLL({str(library)!r}); [getattr(l, n) for n in {sorted(names)}]"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_library_for_several_processors_is_taken_apart_again() -> None:
    made = {"x86_64-macos.11.0": b"a" * 20000, "aarch64-macos.11.0": b"b" * 100}
    assert thin(fat(made)) == {"x86_64": b"a" * 20000, "aarch64": b"b" * 100}


def test_every_platform_has_its_folder() -> None:
    class Parts:
        component = fmu(FOLDERS[0]).component

    made = {"x86_64-macos.11.0": b"a", "aarch64-macos.11.0": b"b"}
    content = {"linux64": b"l", "win64": b"w", "aarch64-linux": b"r", "darwin64": fat(made)}
    found = dict(item for name, data in content.items() for item in libraries_3(Parts, name, data))  # type: ignore[arg-type]
    name = Parts.component.name
    assert found == {
        f"binaries/x86_64-linux/{name}.so": b"l",
        f"binaries/x86_64-windows/{name}.dll": b"w",
        f"binaries/aarch64-linux/{name}.so": b"r",
        f"binaries/x86_64-darwin/{name}.dylib": b"a",
        f"binaries/aarch64-darwin/{name}.dylib": b"b",
    }


def test_library_for_windows_has_no_time() -> None:
    library = b"MZ".ljust(60, b"x") + (64).to_bytes(4, "little") + b"PE\0\0....TIMErest"
    assert timeless(library) == library.replace(b"TIME", bytes(4))
    assert timeless(b"\x7fELF") == b"\x7fELF"


def test_scalars_alone_are_the_ports_and_the_time(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """For hosts that read every output into one number; the kernel's C, which takes long to write, is not looked at."""
    monkeypatch.setattr(Kernel, "c", lambda kernel: kernel.name)
    monkeypatch.setattr(native_parts, "source", lambda *_: "")
    parts, whole = (package.gather(folder, {}, with_arrays=flag) for flag in (False, True))
    assert [v.name for v in parts.variables] == [*(port.name for port in parts.component.ports), "time"]
    assert not any(v.shape or v.rows is not None for v in parts.variables)
    assert parts.variables == whole.variables[: len(parts.variables)]
    assert parts.guid != whole.guid


def test_sources_name_the_library_that_they_are_linked_with(own: Fmu) -> None:
    root = ElementTree.fromstring(member(own, "sources/buildDescription.xml"))
    assert [library.get("name") for library in root.iter("Library")] == ["m"]
    assert "-lm" in member(own, "documentation/index.html").decode()
