"""Packaging of a small component made here: what is refused, and what its identity depends on."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from xml.etree import ElementTree

import pytest
from drivers import ROOT, call, fresh

from gapsense.fmi.components import find_components, load_component
from gapsense.fmi.package import build, check_records
from gapsense.fmi.page import html
from gapsense.fmi.ports import Component
from gapsense.kernels.kernel import Kernel

COMPONENT = """
import amplifier_kernel
from gapsense.fmi.ports import Component
from gapsense.kernels.interface import ports_of

COMPONENT = Component(
    name="Amplifier",
    description="Gain & <offset>",
    kernel="amplifier_kernel",
    ports=ports_of(amplifier_kernel),
    resources=("curve.csv",),
)
"""
KERNEL = """
from typing import Annotated, NamedTuple

from gapsense.kernels.interface import COLUMN, choice, input_, output, parameter, ports, table
from gapsense.kernels.layout import Array, Choice, Scalar, Table


class Law(Choice):
    linear, table = range(2)


@ports()
class Parameters(NamedTuple):
    gain: Scalar = parameter("1", "Factor < 3", 2.0, min=0.0)
    law: Annotated[Scalar, Law] = choice("Law")
    curve_file_x: Annotated[Array, Table()] = table("Curve", ("x", "y"), "curve.csv")
    curve_file_y: Annotated[Array, Table()] = COLUMN


class State(NamedTuple):
    last: Scalar


@ports()
class Inputs(NamedTuple):
    time: Scalar
    voltage: Scalar = input_("V", "What goes in")


@ports(feedthrough=("voltage",))
class Outputs(NamedTuple):
    amplified: Scalar = output("V", "What comes out")


def initial(inputs, par):
    return step(State(0.0), inputs, par)


def step(state, inputs, par):
    return State(inputs.voltage), Outputs(par.gain * inputs.voltage + 0.0 * state.last)
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Folder of the component; its kernel lies beside it."""
    folder = tmp_path / "amplifier"
    folder.mkdir()
    (folder / "component.py").write_text(COMPONENT)
    (folder / "page.md").write_text("Amplifies `voltage`.\n")
    (folder / "curve.csv").write_text("x,y\n0,0\n1,1\n")
    (tmp_path / "amplifier_kernel.py").write_text(KERNEL)
    return folder


@pytest.fixture
def author(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Folder of the component; its kernel can be imported, and is forgotten afterwards."""
    monkeypatch.syspath_prepend(folder.parent)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    yield folder
    sys.modules.pop("amplifier_kernel", None)


@pytest.fixture
def component(author: Path) -> Component:
    return load_component(author)


@pytest.fixture
def kernel(monkeypatch: pytest.MonkeyPatch) -> Kernel:
    module = ModuleType("amplifier_kernel")
    monkeypatch.setitem(sys.modules, module.__name__, module)
    exec(compile(KERNEL, "amplifier_kernel.py", "exec", dont_inherit=True), module.__dict__)
    return Kernel(module)


def changed(file: Path, old: str, new: str) -> None:
    text = file.read_text()
    assert old in text
    later = file.stat().st_mtime + 2.0  # a source of the same second and size would be the one that is compiled
    file.write_text(text.replace(old, new))
    os.utime(file, (later, later))


def built(folder: Path, name: str = "out") -> Path:
    out = folder.parent / name
    fresh("build", [str(folder)], out, folder.parent)
    return out / "Amplifier.fmu"


def guid(fmu: Path) -> str:
    with zipfile.ZipFile(fmu) as archive:
        return ElementTree.fromstring(archive.read("modelDescription.xml")).attrib["guid"]


# Port table and records -----------------------------------------------------------------------------------------------


def refusal(component: Component, kernel: Kernel) -> str:
    with pytest.raises(ValueError) as caught:
        check_records(component, kernel)
    assert str(caught.value).startswith("Amplifier: ")
    return str(caught.value)


def without(component: Component, name: str) -> Component:
    return component._replace(ports=tuple(p for p in component.ports if p.name != name))


def renamed(component: Component, **names: str) -> Component:
    return component._replace(ports=tuple(p._replace(name=names.get(p.name, p.name)) for p in component.ports))


def test_fitting_records_are_accepted_and_time_needs_no_port(component: Component, kernel: Kernel) -> None:
    check_records(component, kernel)


@pytest.mark.parametrize(
    ("name", "record", "fields"),
    [
        ("voltage", "Inputs", ["voltage"]),
        ("amplified", "Outputs", ["amplified"]),
        ("gain", "Parameters", ["gain"]),
        ("curve.file", "Parameters", ["curve_file_x", "curve_file_y"]),
    ],
)
def test_missing_port_is_named(component: Component, kernel: Kernel, name: str, record: str, fields: list[str]) -> None:
    text = refusal(without(component, name), kernel)
    assert f"{record} of amplifier_kernel and the port table differ in {fields}" in text


def test_both_names_of_a_misspelt_port_are_told(component: Component, kernel: Kernel) -> None:
    assert "['gain', 'gian']" in refusal(renamed(component, gain="gian"), kernel)


def test_other_order_of_outputs_is_told(component: Component, kernel: Kernel) -> None:
    class Outputs(tuple):
        _fields = ("second", "first")

    Outputs.__annotations__ = {"second": float, "first": float}
    kernel.module.Outputs = Outputs
    one = next(p for p in component.ports if p.causality == "output")
    ports = tuple(p for p in component.ports if p is not one)
    component = component._replace(ports=(*ports, one._replace(name="first"), one._replace(name="second")))
    assert "their order" in refusal(component, kernel)


@pytest.mark.parametrize("found", [(), ("table", "linear"), ("linear",), ("linear", "spline")])
def test_choices_must_be_those_of_the_kernel(component: Component, kernel: Kernel, found: tuple[str, ...]) -> None:
    ports = tuple(p._replace(choices=found) if p.name == "law" else p for p in component.ports)
    text = refusal(component._replace(ports=ports), kernel)
    assert f"`law` has the choices {list(found)}, its field in amplifier_kernel ['linear', 'table']" in text


# Folders --------------------------------------------------------------------------------------------------------------


FULL = """
import os, pathlib, resource, signal, sys
from gapsense.fmi.package import write
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, 10_000))
write({"a": os.urandom(50_000)}, pathlib.Path(sys.argv[1]))
"""


def test_archive_that_cannot_be_written_leaves_nothing_behind(tmp_path: Path) -> None:
    done = subprocess.run([sys.executable, "-c", FULL, tmp_path / "A.fmu"], capture_output=True, text=True)
    assert "OSError: [Errno 27] File too large: '" in done.stderr and "A.fmu" in done.stderr
    assert not [*tmp_path.iterdir()]


def test_folder_without_component_is_told(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"no component\.py"):
        load_component(tmp_path)


def test_components_are_found_by_folder_or_name_in_any_case(folder: Path) -> None:
    assert find_components(folder.parent) == [folder]
    assert find_components(folder.parent, ["AMPLIFIER"]) == [folder]
    assert find_components(ROOT / "fmus", ["SolenoidValve"]) == find_components(ROOT / "fmus", ["solenoid_valve"])


def test_unknown_component_is_told_with_those_that_exist(folder: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"no component `Amplifyer`.*Did you mean `amplifier`\?"):
        find_components(folder.parent, ["Amplifyer"])


def test_root_without_components_is_told(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="no component in this folder"):
        find_components(tmp_path)


def test_command_line_refuses_unknown_names(tmp_path: Path) -> None:
    command = [sys.executable, str(ROOT / "build_fmus.py"), "Nonsense", "--out", str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, env={"PYTHONPATH": str(ROOT / "src")})
    assert done.returncode == 2
    assert "there is no component `Nonsense`" in done.stderr and "Traceback" not in done.stderr


# The archive ----------------------------------------------------------------------------------------------------------


def test_identity_depends_on_interface_kernel_and_resources(folder: Path) -> None:
    seen = [guid(built(folder, "first"))]
    for name, old, new in (
        ("amplifier_kernel.py", "2.0, min", "2.5, min"),
        ("amplifier_kernel.py", "What goes in", "The input"),
        ("amplifier_kernel.py", "0.0 * state.last", "1e-3 * state.last"),
        ("amplifier/curve.csv", "1,1", "1,2"),
    ):
        changed(folder.parent / name, old, new)
        seen.append(guid(built(folder, f"after {len(seen)}")))
    assert len(set(seen)) == len(seen)


def test_other_page_changes_bytes_but_not_identity(folder: Path) -> None:
    first = built(folder, "first")
    changed(folder / "page.md", "Amplifies", "Raises")
    second = built(folder, "second")
    assert guid(first) == guid(second)
    assert first.read_bytes() != second.read_bytes()


def test_archive_has_the_resources_and_no_times(folder: Path) -> None:
    with zipfile.ZipFile(built(folder)) as archive:
        assert "resources/curve.csv" in archive.namelist()
        assert {item.date_time[0] for item in archive.infolist()} == {1980}
        assert archive.namelist()[0] == "modelDescription.xml"
        assert not any("__pycache__" in name for name in archive.namelist())
        assert b"generationDateAndTime" not in archive.read("modelDescription.xml")


@pytest.mark.parametrize(
    ("name", "old", "new", "words"),
    [
        ("amplifier_kernel.py", ' = parameter("1", "Factor < 3", 2.0, min=0.0)', "", ["Amplifier", "['gain']"]),
        ("amplifier/component.py", 'resources=("curve', 'resources=("kurve', ["kurve.csv"]),
        (
            "amplifier_kernel.py",
            '"V", "What goes in"',
            '"volt", "What goes in"',
            ["Amplifier", "unit volt", "gapsense/units.py"],
        ),
        (
            "amplifier_kernel.py",
            "return State(inputs",
            "if state.last > 0: pass\n    return State(inputs",
            ["kernel.py:40"],
        ),
    ],
)
def test_failed_build_says_why_and_leaves_nothing(
    folder: Path, name: str, old: str, new: str, words: list[str]
) -> None:
    changed(folder.parent / name, old, new)
    done = call("build", [str(folder)], folder.parent / "out", folder.parent)
    assert done.returncode == 1
    reason = done.stderr.rstrip().splitlines()[-1]
    assert [word for word in words if word not in reason] == [], done.stderr
    assert not list((folder.parent / "out").glob("*"))


def test_page_shows_every_port_and_escapes_text(component: Component) -> None:
    page = html(component, "Amplifies `voltage`.", "1.2.3")
    assert "Gain &amp; &lt;offset&gt;" in page and "Factor &lt; 3" in page and "1.2.3" in page
    assert "<code>voltage</code>" in page and ">Outputs</h2>" in page
    for port in component.ports:
        assert f"<code>{port.name}</code>" in page.replace("<wbr>", "")


# What an author may get wrong: one sentence with file and line, no traceback ------------------------------------------

KERNEL_FILE, PORTS = "amplifier_kernel.py", "amplifier/component.py"
GAIN = "par.gain * inputs.voltage + 0.0"
MISTAKES = {
    "if on data": (KERNEL_FILE, GAIN, "(1.0 if inputs.voltage > 0.0 else 2.0) + 0.0", ["kernel.py:40", "Use where()"]),
    "function of math": (KERNEL_FILE, GAIN, "__import__('math').sqrt(par.gain)", ["kernel.py:40", "operations of"]),
    "misspelt name": (KERNEL_FILE, GAIN, "gain * inputs.voltage", ["kernel.py:40", "NameError", "'gain'"]),
    "misspelt field": (KERNEL_FILE, GAIN, "par.gian", ["kernel.py:40", "AttributeError", "'gian'"]),
    "wrong syntax": (KERNEL_FILE, GAIN, "par.gain *", ["kernel.py:40", "SyntaxError"]),
    "bad import": (
        KERNEL_FILE,
        "from typing",
        "import nonsens\nfrom typing",
        ["kernel.py:2", "No module named 'nonsens'"],
    ),
    "derivative by a constant": (
        KERNEL_FILE,
        GAIN,
        "__import__('gapsense.kernels.derivative').kernels.derivative.derivative(par.gain, 1.0)",
        ["kernel.py:40", "a derivative by the constant 1.0"],
    ),
    "wrong arguments": (
        KERNEL_FILE,
        "def step(state, inputs, par)",
        "def step(state, inputs)",
        ["kernel.py", "step()"],
    ),
    "state forgotten": (KERNEL_FILE, "State(inputs.voltage), ", "", ["kernel.py:35, in initial: it returns Outputs;"]),
    "nothing returned": (
        KERNEL_FILE,
        "return State(inputs",
        "State(inputs",
        ["kernel.py:35, in initial: it returns NoneType; expected State"],
    ),
    "no record": (KERNEL_FILE, "class Outputs", "class Output", ["amplifier_kernel", "'Outputs'"]),
    "no kernel": (
        PORTS,
        '"amplifier_kernel"',
        '"amplifier_kernl"',
        ["component.py", "No module named 'amplifier_kernl'"],
    ),
    "wrong syntax of ports": (PORTS, 'name="Amplifier",', 'name="Amplifier"', ["component.py:", "SyntaxError"]),
    "unknown maker": (KERNEL_FILE, 'input_("V', 'inptu("V', ["kernel.py:27", "NameError", "'inptu'"]),
    "no description": (KERNEL_FILE, ', "What goes in"', "", ["kernel.py:27", "missing", "'description'"]),
    "no component": (PORTS, "COMPONENT = ", "PORTS = ", ["component.py", "'COMPONENT'"]),
    "follows nothing": (
        KERNEL_FILE,
        '("voltage",)',
        '("voltag",)',
        ["`amplified`", "`voltag`", "Did you mean `voltage`?"],
    ),
    "unknown unit": (
        KERNEL_FILE,
        '"V", "What goes',
        '"volt", "What goes',
        ["Amplifier", "unit volt", "gapsense/units.py"],
    ),
    "no port": (KERNEL_FILE, ' = parameter("1", "Factor < 3", 2.0, min=0.0)', "", ["Amplifier", "['gain']"]),
}


def told(folder: Path) -> str:
    """The sentence with which a build is refused."""
    with pytest.raises((ValueError, OSError)) as caught:
        build(folder, folder.parent / "out")
    text = str(caught.value)
    assert text.endswith((".", "?")) and "\n" not in text and "Traceback" not in text
    assert not list((folder.parent / "out").glob("*"))
    return text


@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistake_of_an_author_is_told_in_one_sentence(author: Path, mistake: str) -> None:
    name, old, new, words = MISTAKES[mistake]
    changed(author.parent / name, old, new)
    text = told(author)
    assert [word for word in words if word not in text] == [], text


def test_mistake_in_a_table_that_another_takes_is_told_at_its_own_line(author: Path) -> None:
    other = author.parent / "other"
    other.mkdir()
    (other / "component.py").write_text(
        "from pathlib import Path\nfrom gapsense.fmi.components import load_component\n"
        "COMPONENT = load_component(Path(__file__).parents[1] / 'amplifier')\n"
    )
    changed(author / "component.py", "ports_of(amp", "prots_of(amp")
    assert told(other).startswith(f"{author / 'component.py'}:10: NameError")


def test_missing_page_is_told(author: Path) -> None:
    (author / "page.md").unlink()
    assert "amplifier: no page.md. A component's folder holds" in told(author)


@pytest.mark.parametrize("mistake", ["if on data", "wrong syntax of ports", "unknown unit"])
def test_command_line_tells_mistakes_without_a_traceback(author: Path, mistake: str) -> None:
    name, old, new, words = MISTAKES[mistake]
    changed(author.parent / name, old, new)
    root = author.parent
    (root / "fmus").mkdir()
    author.rename(root / "fmus" / "amplifier")
    shutil.copy(ROOT / "build_fmus.py", root)
    command = [sys.executable, "-m", "gapsense.cli", "build", "Amplifier"]
    path = os.pathsep.join(map(str, (ROOT / "src", root)))
    done = subprocess.run(command, cwd=root, capture_output=True, text=True, env={**os.environ, "PYTHONPATH": path})
    assert (done.returncode, done.stdout) == (2, "")
    assert len(done.stderr.splitlines()) == 1
    assert [word for word in words if word not in done.stderr] == [], done.stderr


MAKE = """
import sys
from pathlib import Path
import make_references
make_references.ROOT = Path(sys.argv[1])
sys.exit(make_references.main(["amplifier"]))
"""


def referenced(author: Path) -> subprocess.CompletedProcess[str]:
    """`make_references.py` for the component, which has a reference already."""
    root = author.parent
    (root / "fmus").mkdir()
    author.rename(root / "fmus" / "amplifier")
    (root / "fmus" / "amplifier" / "reference.csv").write_text("old\n")
    path = os.pathsep.join(map(str, (Path(__file__).parent, ROOT / "src", root)))
    command = [sys.executable, "-c", MAKE, str(root)]
    return subprocess.run(command, capture_output=True, text=True, env={**os.environ, "PYTHONPATH": path})


def test_reference_is_written(author: Path) -> None:
    done = referenced(author)
    assert (done.returncode, done.stderr) == (0, "")
    rows = (author.parent / "fmus" / "amplifier" / "reference.csv").read_text().splitlines()
    assert rows[0] == "time,voltage,amplified" and len(rows) == 42


@pytest.mark.parametrize(
    ("name", "new", "words"),
    [
        (KERNEL_FILE, "1.0 / par.law", ["(Amplifier)", "ZeroDivisionError"]),
        (KERNEL_FILE, "par.gain / 1e-300 / 1e-300 + 0.0", ["(Amplifier)", "output `amplified` is not finite. Check"]),
        (KERNEL_FILE, "gian", ["kernel.py:40", "'gian'"]),
    ],
)
def test_refused_reference_is_told_in_one_sentence_and_the_old_one_stays(
    author: Path, name: str, new: str, words: list[str]
) -> None:
    changed(author.parent / name, GAIN, new)
    done = referenced(author)
    assert (done.returncode, done.stdout) == (2, "")
    assert len(done.stderr.splitlines()) == 1
    assert [word for word in words if word not in done.stderr] == [], done.stderr
    assert (author.parent / "fmus" / "amplifier" / "reference.csv").read_text() == "old\n"


def test_members_are_compressed_as_well_as_can_be(fmus):
    """At level 9, which Python does not take from the archive for members with a date of their own."""
    with zipfile.ZipFile(fmus / "Mhe.fmu") as archive:
        member = archive.getinfo("modelDescription.xml")
        whole = archive.read(member)
    packed = zlib.compressobj(9, zlib.DEFLATED, -15)
    assert member.compress_size == len(packed.compress(whole) + packed.flush()) < len(zlib.compress(whole, 6)) - 6
