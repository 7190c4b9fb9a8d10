"""FMUs in WebAssembly by the draft FMI-LS-WASM: their bits and messages in wasmtime, a host that is not ours."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import fmpy
import pytest
from lxml import etree

pytest.importorskip("wasmtime", reason="no wasmtime, which runs WebAssembly components")

from native3 import FOLDERS, Fmu, Instance, bits, reference
from wasm_host import CALLBACKS, ENGINE, RESOURCES, VERSION, WasmInstance, compiled
from wasmtime import component as wit

from gapsense._os.native import ZIG, NativeError, zig_version
from gapsense.fmi.components import own
from gapsense.fmi.native import package, platforms
from gapsense.fmi.native.compile import EMPTY, FOLDER, component, leb128
from gapsense.fmi.native.parts import gather
from gapsense.fmi.native.platforms import WASM, choose_platforms, compilers

DRIVE, EKF = own("drive_voltage"), own("ekf")
TYPES = f"fmi:fmi3/types@{VERSION}"
EXTRA = "extra/org.modelica.fmi-ls-wasm"
Made = Callable[[Path], Fmu]


@pytest.fixture(scope="module")
def fmus(shared: Callable[[str, Callable[[Path], object]], Path]) -> Made:
    """The FMUs of all components as WebAssembly, extracted."""
    if zig_version() != ZIG:
        pytest.skip(f"no ziglang {ZIG}, which compiles for WebAssembly")
    found: dict[Path, Fmu] = {}

    def make(out: Path) -> None:
        out.mkdir()
        assert [*package.build(FOLDERS, out, [WASM], {})]

    place = shared("wasm", make)
    return lambda folder: found.setdefault(folder, Fmu(folder, place))


@pytest.fixture(params=FOLDERS, ids=lambda folder: folder.name)
def folder(request: pytest.FixtureRequest) -> Path:
    return Path(request.param)


@pytest.mark.slow
def test_reproduces_its_reference_bit_for_bit(folder: Path, fmus: Made) -> None:
    run, one = reference(folder), WasmInstance(fmus(folder))
    assert bits(one.run(run)) == bits(run.outputs)
    one.slave.terminate()
    one.slave.freeInstance()
    assert one.log == []


@pytest.mark.slow
def test_runs_again_after_a_reset_and_from_a_saved_state(folder: Path, fmus: Made) -> None:
    run, one, other = reference(folder), WasmInstance(fmus(folder)), WasmInstance(fmus(folder), "other")
    one.run(run._replace(inputs=run.inputs[::-1]))
    one.slave.reset()
    half = len(run.inputs) // 2
    one.run(run._replace(inputs=run.inputs[:half]))
    state = one.slave.getFMUState()
    straight = one.go_on(run, half)
    one.slave.setFMUState(state)
    other.slave.setFMUState(state)
    assert bits(straight) == bits(run.outputs[half:]) == bits(one.go_on(run, half)) == bits(other.go_on(run, half))


@pytest.mark.slow
def test_imports_what_the_draft_has_and_files_only_with_resources(folder: Path, fmus: Made) -> None:
    fmu = fmus(folder)
    has_resources = (fmu.folder / "resources").is_dir()
    found = set(compiled(fmu.folder, fmu.component.name).type.imports(ENGINE))
    assert found == {TYPES, CALLBACKS, *([RESOURCES] if has_resources else [])}
    assert bool(fmu.component.resources) == has_resources


@pytest.mark.slow
@pytest.mark.parametrize("folder", [DRIVE, EKF], ids=lambda folder: folder.name)
def test_refuses_with_the_sentences_of_the_native_fmu(folder: Path, fmus: Made, natives: Path) -> None:
    fmu = fmus(folder)
    both = Instance(Fmu(folder, natives)), WasmInstance(fmu)
    (first, *_), texts = fmu.references("input"), [fmu[p.name] for p in fmu.component.of("parameter") if p.columns]
    calls: list[tuple[str, list[Any]]] = [
        ("getFloat64", [[123456]]),
        ("getInt8", [[first]]),
        ("getString", [[first]]),
        ("doStep", [0.0, 1e-4]),
        ("setFloat64", [[first], [1.0, 2.0]]),
        ("exitInitializationMode", []),
        ("getBinary", [[first]]),
        ("enterEventMode", []),
    ]
    for name, arguments in calls:
        said = [instance.refused(name, *arguments) for instance in both]
        assert said[0] == said[1], name
        for instance in both:
            instance.slave.reset()
    for instance in both:
        instance.slave.setString(texts, ["elsewhere/nowhere.csv"] * len(texts))
        instance.slave.enterInitializationMode()
    said = [instance.refused("exitInitializationMode") for instance in both]
    assert said[0] == said[1] and "nowhere.csv" in said[0]


@pytest.mark.slow
def test_is_not_instantiated_with_another_token_or_in_event_mode_or_without_its_files(
    fmus: Made, tmp_path: Path
) -> None:
    fmu = fmus(EKF)
    for how, said in (
        ({"token": "another"}, "the tool gave the GUID `another`"),
        ({"event_mode": True}, "the event mode is not provided"),
        ({"resources": tmp_path}, "its file `resources/fringing_29.csv` cannot be read"),
    ):
        one = WasmInstance(fmu, **how)
        assert one.slave.resource is None
        ((status, category, text),) = one.log
        assert (status, category) == (3, "logStatusError") and said in text


@pytest.mark.slow
def test_reads_files_of_its_resources_and_no_others(fmus: Made, tmp_path: Path) -> None:
    fmu = fmus(DRIVE)
    own = tmp_path / "own.csv"
    own.write_text("time,voltage\n0,1\n1,2\n")
    one = WasmInstance(fmu)
    one.set({"waveform": 3, "table.file": "voltage.csv"})
    one.start([1.0, 0.0])
    assert set(one.files) == {path.name for path in (fmu.folder / "resources").iterdir()}
    other = WasmInstance(fmu)
    read = list(other.files)
    other.set({"waveform": 3, "table.file": str(own)})
    other.slave.enterInitializationMode()
    assert f"`{own}` is not a file" in other.refused("exitInitializationMode")
    assert other.files.count(own.name) == 0 and len(other.files) >= len(read)


@pytest.mark.slow
def test_arrays_and_whole_numbers_are_those_of_the_native_fmu(fmus: Made, natives: Path) -> None:
    for folder in (DRIVE, EKF):
        fmu = fmus(folder)
        both = Instance(Fmu(folder, natives)), WasmInstance(fmu)
        for instance in both:
            instance.start(reference(folder).inputs[0])
        for name, variable in fmu.variables.items():
            kind = variable.type.replace("Enumeration", "Int64")
            found = getattr(both[1].slave, f"get{kind}")([fmu[name]])
            native = getattr(both[0].slave, f"get{kind}")([fmu[name]], len(found))
            assert (len(found) > 1) >= bool(variable.dimensions)
            assert found == list(native), name


# The interface, type by type: what wasmtime finds in the component, and the text of fmi3.wit.


def shown(kind: Any) -> str:
    """A type as WIT writes it, with all names of types replaced by what they mean."""
    if isinstance(kind, wit.ListType):
        return f"list<{shown(kind.element)}>"
    if isinstance(kind, wit.OptionType):
        return f"option<{shown(kind.payload)}>"
    if isinstance(kind, wit.ResultType):
        return f"result<{shown(kind.ok)},{shown(kind.err)}>"
    if isinstance(kind, wit.TupleType):
        return f"tuple<{','.join(map(shown, kind.elements))}>"
    if isinstance(kind, wit.EnumType):
        return f"enum{{{','.join(kind.names)}}}"
    if isinstance(kind, wit.RecordType):
        return f"record{{{','.join(f'{name}:{shown(of)}' for name, of in kind.fields)}}}"
    return {"OwnType": "co-simulation-instance"}.get(type(kind).__name__, type(kind).__name__.lower())


def shown_function(kind: Any) -> str:
    parameters = ",".join(f"{name}:{shown(of)}" for name, of in kind.params if name != "self")
    return f"({parameters})->{shown(kind.result)}" if kind.result else f"({parameters})"


def written() -> dict[str, str]:
    """Functions of fmi3.wit by name, in the same words."""
    text = re.sub(r"//.*", "", (FOLDER / "fmi3.wit").read_text(encoding="utf-8"))
    text = re.sub(r",\s*([)}])", r"\1", re.sub(r"\s+", " ", text))
    meant: dict[str, str] = {}

    def expanded(part: str) -> str:
        names = re.compile(r"(?<![\w-])([a-z][\w-]*)(?![\w:-])")
        return names.sub(lambda found: meant.get(found[1], found[1]), part.replace(" ", ""))

    for kind, name, more in re.findall(r"\b(type|enum|record) ([\w-]+)(?: =)? ?([^;}]*\}?)", text):
        kept = more.replace(" ", "") if kind == "enum" else expanded(more)
        meant[name] = kept if kind == "type" else kind + kept
    return {name: expanded(more) for name, more in re.findall(r"([\w-]+): (?:static )?func(\([^;]*);", text)}


@pytest.mark.slow
def test_interface_is_that_of_the_draft(fmus: Made) -> None:
    fmu = fmus(EKF)
    kind = compiled(fmu.folder, "Ekf").type
    parts = {**kind.imports(ENGINE), **kind.exports(ENGINE)}
    functions = {
        re.sub(r"\[.*\][\w-]*\.", "", name): shown_function(item.ty)
        for part in parts.values()
        for name, item in part.ty.exports(ENGINE).items()
        if isinstance(item.ty, wit.FuncType)
    }
    assert functions == written()


# The file.


@pytest.mark.slow
def test_fmu_has_the_manifest_where_the_draft_and_where_fmi_has_it(fmus: Made) -> None:
    schema = Path(fmpy.__file__).parent / "schema" / "fmi3" / "fmi3LayeredStandardManifest.xsd"
    with ZipFile(fmus(EKF).path) as file:
        (text,) = {file.read(f"{EXTRA}/{name}") for name in ("manifest.xml", "fmi-ls-manifest.xml")}
        assert {name for name in file.namelist() if name.startswith("binaries/wasm")} == {f"binaries/{WASM}/Ekf.wasm"}
    root = etree.fromstring(text)
    assert text.count(b"<fmiLayeredStandardManifest ") == 1  # without a prefix, by which some tools would not know it
    etree.XMLSchema(etree.parse(schema)).assertValid(root)
    assert root.get("{http://fmi-standard.org/fmi-ls-manifest}fmi-ls-name") == "org.modelica.fmi-ls-wasm"


@pytest.mark.slow
def test_alone_there_is_only_an_fmu_of_fmi_3(fmus: Made) -> None:
    path = fmus(own("semera")).path
    assert {*path.parents[1].rglob("*.fmu")} == {*path.parent.glob("*.fmu")} and path.parent.name == "fmi3"
    assert ZipFile(path).read(f"binaries/{WASM}/Semera.wasm")[:8] == b"\0asm\x0d\0\1\0"  # a component


def test_beside_a_library_it_is_in_the_same_fmu(tmp_path: Path) -> None:
    binaries = {WASM: b"\0asm", "linux64": b"ELF"}
    other, path = package.write_packages(gather(own("semera"), {}), binaries, tmp_path)
    assert other == tmp_path / "Semera.fmu" and path == tmp_path / "fmi3" / "Semera.fmu"
    with ZipFile(path) as file:
        assert file.read(f"binaries/{WASM}/Semera.wasm") == b"\0asm"
        assert file.read("binaries/x86_64-linux/Semera.so") == b"ELF"
    assert not [name for name in ZipFile(other).namelist() if "wasm" in name]


def test_module_takes_the_place_that_the_shell_keeps_for_it() -> None:
    module = b"\0asm\1\0\0\0" + bytes(300)
    plain, with_files = (component(module + more) for more in (b"", b"fmi:fmi3/resource-dir-callbacks@3.0.0"))
    before, after = (FOLDER / "shell.wasm").read_bytes().split(EMPTY)
    assert plain == before + b"\x01\xb4\x02" + module + after
    assert b"resource-dir-callbacks" not in plain and with_files.count(b"resource-dir-callbacks") > 1
    assert [leb128(number) for number in (0, 127, 128, 624485)] == [b"\0", b"\x7f", b"\x80\x01", b"\xe5\x8e\x26"]


def test_is_built_only_if_it_is_asked_for_and_only_by_zig(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(platforms, "zig_version", lambda: ZIG)
    assert WASM not in choose_platforms([]) and choose_platforms([WASM]) == [WASM]
    monkeypatch.setattr(platforms, "zig_version", lambda: None)
    with pytest.raises(NativeError, match=f"`{WASM}` needs ziglang {ZIG}, found none"):
        compilers(WASM)
