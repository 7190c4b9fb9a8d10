"""Package a component's folder as an FMU: pythonfmu builds it, then the archive is completed and made reproducible."""

from __future__ import annotations

import hashlib
import importlib
import shutil
import sys
import tempfile
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from importlib import metadata
from importlib.metadata import distribution
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple, TextIO
from uuid import UUID
from xml.etree import ElementTree

from gapsense._os.files import write_atomically
from gapsense.fmi import describe, page, picture, references, shim
from gapsense.fmi.components import HOLDS, kernel_of, load_component
from gapsense.fmi.ports import Component, Port
from gapsense.fmi.tables import column_name
from gapsense.fmi.values import fields as checked
from gapsense.kernels.kernel import Kernel
from gapsense.kernels.layout import choices, fields, names
from gapsense.problems import code
from gapsense.version import __version__

HERE = Path(__file__).parent
PARTS = ("failing", "life", "ports", "sentences", "slave", "state", "steps", "tables", "values", "variables")
SHELL = tuple(f"{name}.py" for name in PARTS)  # travel in every FMU
FLAGS = {
    "needsExecutionTool": True,
    "canHandleVariableCommunicationStepSize": True,
    "canGetAndSetFMUstate": True,
    "canSerializeFMUstate": True,
}
EPOCH = (1980, 1, 1, 0, 0, 0)  # the earliest time that a ZIP can hold

SCRIPT = """from {package} import {name}
from {package}.slave import HELD

HELD.append(globals())
"""

ENTRY = '''"""{name}: {description}.  Generated; see documentation/index.html."""

from . import kernel, table
from .slave import Slave


class {name}(Slave):
    component, kernel, build = table.COMPONENT, kernel, "{build}"
    guid = "{guid}"  # of the model description; the Linux binary compares it with the host's
'''


def build(folder: Path, destination: Path, values: Mapping[str, Any] | None = None) -> Path:
    """Build `destination/<Name>.fmu` from a component's folder; the same sources and values give the same bytes.

    Parameters
    ----------
    folder : Path
        With component.py and what belongs to it.
    destination : Path
        Folder for the FMU.
    values : mapping, optional
        Start values of parameters, in place of those of the port table.

    Raises
    ------
    ValueError
        With all values that the component does not take, or what its folder lacks.
    """
    found = prepare_component(folder, values or {})
    component, _, resources = found
    files, identity = _identify(found)
    with tempfile.TemporaryDirectory() as temporary:
        stock = _build_stock(Path(temporary), component, files, identity, resources)
        with zipfile.ZipFile(stock) as archive:
            members = {name: archive.read(name) for name in archive.namelist() if "__pycache__" not in name}
    _complete(members, component, folder, _guid(identity))
    members |= references.files(folder, values or {})
    destination.mkdir(parents=True, exist_ok=True)
    return write(members, destination / f"{component.name}.fmu")


def guid(folder: Path) -> str:
    """GUID of the FMU that `build` makes of a component's folder."""
    return _guid(_identify(prepare_component(folder, {}))[1])


class Prepared(NamedTuple):
    """What any FMU of a component is made of."""

    component: Component  # with its start values
    kernel: Kernel
    resources: list[Path]  # files that travel with it


def prepare_component(folder: Path, given: Mapping[str, Any]) -> Prepared:
    """The component of a folder with other start values, checked: table of ports, kernel and files fit each other."""
    component = load_component(folder)
    checked(component, given, folder)
    if not (folder / "page.md").is_file():
        raise FileNotFoundError(f"{folder}: no page.md. {HOLDS}")
    with code(folder / "component.py"):
        kernel = kernel_of(component)
    with code(str(kernel.module.__file__)):
        check_records(component, kernel)
    component, tables = with_start_values(component, given)
    resources = [tables.get(name, folder / name) for name in component.resources]
    return Prepared(component, kernel, resources)


def with_start_values(component: Component, given: Mapping[str, Any]) -> tuple[Component, dict[str, Path]]:
    """Component with these start values of its parameters, and the table files for its resources."""
    files = {Path(given[p.name]).name: Path(given[p.name]) for p in component.ports if p.columns and p.name in given}
    ports = tuple(_start_with(port, given[port.name]) if port.name in given else port for port in component.ports)
    resources = tuple(dict.fromkeys((*component.resources, *files)))
    step_size = float(given.get("sample_time", component.step_size))  # of the default experiment
    return component._replace(ports=ports, resources=resources, step_size=step_size), files


def _start_with(port: Port, value: Any) -> Port:
    if port.kind == "Real":
        return port._replace(start=float(value), nominal=abs(float(value)) or 1.0)
    return port._replace(start=Path(value).name if port.columns else value)


def check_records(component: Component, kernel: Kernel) -> None:
    """Refuse a port table that does not fit the records of its kernel."""
    expected = {
        "Inputs": [p.field for p in component.of("input")],
        "Outputs": [p.field for p in component.of("output")],
        "Parameters": [
            f
            for p in component.of("parameter")
            for f in [f"{p.field}_{column_name(c)}" for c in p.columns] or [p.field]
        ],
    }
    for record, ports in expected.items():
        have = [f for f in fields(getattr(kernel.module, record)) if record != "Inputs" or f not in ("time", "dt")]
        if record == "Parameters":
            have, ports = sorted(have), sorted(ports)
        if have != ports:
            odd = sorted(set(have) ^ set(ports)) or "their order"
            raise ValueError(
                f"{component.name}: {record} of {component.kernel} and the port table differ in {odd}. Make them equal."
            )
    known = choices(kernel.module.Parameters)
    for port in component.of("parameter"):
        if port.choices != known.get(port.field, ()):
            raise ValueError(
                f"{component.name}: `{port.name}` has the choices {list(port.choices)}, its field in {component.kernel}"
                f" {list(known.get(port.field, ()))}. Make them equal."
            )


def _sources(component: Component, kernel: Kernel) -> dict[str, str]:
    """Files of the private package that travels in the FMU."""
    constants: dict[str, tuple[Any, ...]]
    constants = {n.upper(): tuple(fields(getattr(kernel.module, n))) for n in ("Inputs", "Parameters")}
    sizes = {name: field.size for name, field in fields(kernel.module.State).items() if field.kind == "memory"}
    constants["STATE"] = tuple(sizes.get(name, 0) for name in names(kernel.module.State))  # 0 for a number
    constants["WHOLES"] = tuple(map(tuple, kernel.wholes))
    given = "".join(f"{name} = {value!r}\n" for name, value in constants.items())
    ports = "".join(f"        {port!r},\n" for port in component.ports)
    table = (
        '"""The port table."""\n\nfrom .ports import Component, Limit, Port  # noqa: F401\n\n'
        f"COMPONENT = {component._replace(ports=())!r}._replace(\n    ports=(\n{ports}    )\n)\n"
    )
    shell = {name: (HERE / name).read_text(encoding="utf-8") for name in SHELL}
    title = f'"""{component.description}  Generated from {component.kernel}."""\n\n'
    return {"table.py": table, "kernel.py": title + kernel.python() + "\n\n" + given, **shell}


def _identify(found: Prepared) -> tuple[dict[str, str], str]:
    """The sources that travel in the FMU, and the hash of all that it is made of."""
    component, kernel, resources = found
    with code(str(kernel.module.__file__)):
        files = _sources(component, kernel)
    content = (__version__, component, sorted(files.items()), [path.read_bytes() for path in resources])
    return files, hashlib.sha256(repr(content).encode()).hexdigest()


def _guid(identity: str) -> str:
    return f"{{{UUID(identity[:32])}}}"


def _build_stock(work: Path, component: Component, files: dict[str, str], identity: str, paths: list[Path]) -> Path:
    """What pythonfmu makes of the generated class; names carry the build, so that no two FMUs mix up their modules."""
    build = identity[:12]
    package = work / f"_gapsense_{component.name.lower()}_{build}"
    package.mkdir()
    about = {"name": component.name, "description": component.description, "package": package.name}
    about |= {"build": build, "guid": _guid(identity)}
    for name, text in {**files, "__init__.py": ENTRY.format(**about)}.items():
        (package / name).write_text(text, encoding="utf-8")
    script = work / f"{component.name}_{build}.py"
    script.write_text(SCRIPT.format(**about), encoding="utf-8")
    resources = [Path(shutil.copy2(path, work)) for path in paths]
    with as_if_fresh(work, package.name, script.stem):  # pythonfmu imports the script, for the model description
        builder = importlib.import_module("pythonfmu").FmuBuilder
        return Path(builder.build_FMU(script, work / f"{component.name}.fmu", [package, *resources], **FLAGS))


def _complete(members: dict[str, bytes], component: Component, folder: Path, guid: str) -> None:
    root = ElementTree.fromstring(members["modelDescription.xml"])
    describe.complete(root, component, guid, __version__)
    members["modelDescription.xml"] = describe.text(root)
    members[f"binaries/linux64/{component.name}.so"] = shim.BINARY.read_bytes()
    members["model.png"] = (HERE / "icon.png").read_bytes()
    markdown, drawing = (folder / "page.md").read_text(encoding="utf-8"), picture.figure(component, folder)
    text = page.html(component, markdown, __version__, drawing)
    members["documentation/index.html"] = text.encode()
    members["documentation/licenses/license.txt"] = (HERE / "license.txt").read_bytes()
    members["documentation/licenses/pythonfmu.txt"] = _license_of("pythonfmu")  # travels in the FMU


def _license_of(package: str) -> bytes:
    for file in metadata.files(package) or ():
        if file.name == "LICENSE":
            return file.read_binary()
    raise FileNotFoundError(
        f"The installed {package} lacks its licence, which travels in the FMU. Install it with pip."
    )


def write(members: dict[str, bytes], path: Path) -> Path:
    """Write the archive in a fixed order with fixed times; a failure leaves the old one as it was, and nothing else."""

    def pack(file: TextIO) -> None:
        with zipfile.ZipFile(file.buffer, "w", zipfile.ZIP_DEFLATED) as archive:
            for name in sorted(members, key=lambda n: (n != "modelDescription.xml", n)):
                info = zipfile.ZipInfo(name, EPOCH)
                info.compress_type, info.external_attr = zipfile.ZIP_DEFLATED, 0o644 << 16
                archive.writestr(info, members[name], compresslevel=9)

    write_atomically(path, pack)
    return path


# Build an FMU in a process that may have loaded FMUs, or may load this one later.


@contextmanager
def as_if_fresh(folder: Path, *names: str) -> Iterator[None]:
    """Imports from a folder and of the installed pythonfmu; afterwards it is as if nothing had been imported.

    A loaded FMU has put its own copy of pythonfmu, without what building needs, before the installed one.
    """
    names = (*names, "pythonfmu")
    path, before = sys.path[:], drop(names)
    sys.path[:0] = [str(folder), str(distribution("pythonfmu").locate_file(""))]
    importlib.invalidate_caches()
    try:
        yield
    finally:
        sys.path[:] = path
        drop(names)
        sys.modules.update(before)


def drop(names: tuple[str, ...]) -> dict[str, ModuleType]:
    """Forget the modules of some packages, and give them."""
    return {name: sys.modules.pop(name) for name in list(sys.modules) if name.partition(".")[0] in names}
