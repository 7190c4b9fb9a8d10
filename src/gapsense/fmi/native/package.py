"""Build native FMUs: gather what a component is in C, compile it for each platform, package it."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, SubElement

from gapsense.fmi import describe, package, page, picture, references
from gapsense.fmi.fmi3.description import (
    TERMINALS,
    TERMINALS_ICON,
    build_description,
    model_description,
    terminals_and_icons,
)
from gapsense.fmi.native.compile import binary, compile_common, manifest, thin
from gapsense.fmi.native.parts import Parts, common, gather
from gapsense.fmi.native.platforms import PLATFORMS, WASM, compilers
from gapsense.fmi.ports import Component, Port
from gapsense.version import __version__

FOLDERS = {"linux64": "x86_64-linux", "win64": "x86_64-windows", "aarch64-linux": "aarch64-linux", WASM: WASM}
FLAGS = {
    "needsExecutionTool": "false",
    "canHandleVariableCommunicationStepSize": "true",
    "canInterpolateInputs": "false",
    "canBeInstantiatedOnlyOncePerProcess": "false",
    "canNotUseMemoryManagementFunctions": "true",
    "canGetAndSetFMUstate": "true",
    "canSerializeFMUstate": "true",
}
CATEGORIES = ("Warning", "Discard", "Error", "Fatal")
COMPILERS_AT_ONCE = 2
RUN = """## How to run

This is the native FMU: a compiled library, which needs nothing else on the machine, for {platforms}.
Take it in Simulink, in Modelica tools, and wherever Python is not. The Python FMU of the same name computes the same
bits, and shows its arithmetic as Python source. The folder `sources` holds all C files, for other platforms: compile
them together, with `-std=c99 -ffp-contract=off`, and link with `-lm`.
A good communication step is {{step:g}} s. Inputs are held during a step, outputs are valid at its end.

Profile: FMI {fmi} co-simulation, variable communication step, several instances, get, set and serialise all its state.
"""
NAMES = {"linux64": "Linux", "win64": "Windows", "darwin64": "macOS", "aarch64-linux": "Linux on aarch64"}
NAMES[WASM] = "WebAssembly by the draft FMI-LS-WASM"
MANIFESTS = [f"extra/org.modelica.fmi-ls-wasm/{name}.xml" for name in ("manifest", "fmi-ls-manifest")]  # draft, FMI


def build(
    folders: Sequence[Path],
    destination: Path,
    platforms: Sequence[str],
    values: Mapping[Path, Mapping[str, Any]],
    *,
    with_arrays: bool = True,
) -> Iterator[tuple[Path, Path]]:
    """Build the FMUs of the components in `folders`, and tell of each its component's folder and its file.

    Those of platforms that need one of their own are in a folder of `destination`; `with_arrays` is as in `gather`.

    Raises
    ------
    NativeError
        If there is no compiler for a platform, or it fails.
    """
    used = {name: compilers(name) for name in platforms}
    with tempfile.TemporaryDirectory() as temporary, ThreadPoolExecutor(COMPILERS_AT_ONCE) as pool:
        work, files = Path(temporary), common()
        list(pool.map(lambda c: compile_common(files, c, work), [c for own in used.values() for c in own]))
        parts = [gather(folder, values.get(folder, {}), with_arrays=with_arrays) for folder in folders]
        made = {
            (part.component.name, name): pool.submit(binary, part.files, part.component.name, own, work)
            for part in parts
            for name, own in used.items()
        }
        for part in parts:
            binaries = {name: made[part.component.name, name].result() for name in used}
            yield from ((part.folder, path) for path in write_packages(part, binaries, destination))


def write_packages(parts: Parts, binaries: Mapping[str, bytes], destination: Path) -> Iterator[Path]:
    """Write the FMUs of FMI 2.0, and that of FMI 3.0."""
    of_2 = {name for name in binaries if PLATFORMS[name].folder}
    apart = {name for name in of_2 if name != PLATFORMS[name].folder}
    for together in (sorted(of_2 - apart), *([name] for name in sorted(apart))):
        if together:
            folder = destination / together[0] if together[0] in apart else destination
            folder.mkdir(parents=True, exist_ok=True)
            yield package.write(members_2(parts, binaries, together), folder / f"{parts.component.name}.fmu")
    (destination / "fmi3").mkdir(parents=True, exist_ok=True)
    yield package.write(members_3(parts, binaries), destination / "fmi3" / f"{parts.component.name}.fmu")


def members_2(parts: Parts, binaries: Mapping[str, bytes], platforms: Sequence[str]) -> dict[str, bytes]:
    """All files of an FMU of FMI 2.0 for some platforms."""
    component, places = parts.component, {name: PLATFORMS[name] for name in platforms}
    about = model_description_2(component, parts.guid, __version__, files_to_compile(parts.sources(2)))
    return {
        "modelDescription.xml": about,
        "model.png": (package.HERE / "icon.png").read_bytes(),
        **{f"binaries/{p.folder}/{component.name}{p.ending}": binaries[name] for name, p in places.items()},
        **shared_files(parts, platforms, 2),
    }


def shared_files(parts: Parts, platforms: Sequence[str], fmi: int) -> dict[str, bytes]:
    """Files that have the same place whatever the version of FMI."""
    return {
        "documentation/index.html": documentation(parts, platforms, fmi).encode(),
        "documentation/licenses/license.txt": (package.HERE / "license.txt").read_bytes(),
        **{f"resources/{name}": content for name, content in parts.resources.items()},
        **parts.sources(fmi),
        **references.files(parts.folder, parts.given, fmi),
    }


def files_to_compile(sources: Mapping[str, bytes]) -> list[str]:
    """Files among these that are to be compiled."""
    return sorted(Path(name).name for name in sources if name.endswith(".c"))


def documentation(parts: Parts, platforms: Sequence[str], fmi: int) -> str:
    """The page of a component, which says what this FMU runs on."""
    markdown = (parts.folder / "page.md").read_text(encoding="utf-8")
    run = RUN.format(platforms=" and ".join(NAMES[name] for name in platforms), fmi=f"{fmi}.0")
    drawing = picture.figure(parts.component, parts.folder)
    return page.html(parts.component, markdown, __version__, drawing, run)


# The FMU of FMI 3.0: the libraries of FMI 2.0, all platforms in one file.


def members_3(parts: Parts, binaries: Mapping[str, bytes]) -> dict[str, bytes]:
    """All files of the FMU; `binaries` by platform, as for FMI 2.0."""
    component, compiled = parts.component, files_to_compile(parts.sources(3))
    libraries = (library for name, content in binaries.items() for library in libraries_3(parts, name, content))
    return {
        "modelDescription.xml": model_description(component, parts.variables, parts.guid, __version__),
        TERMINALS: terminals_and_icons(component),
        TERMINALS_ICON: (package.HERE / "icon.png").read_bytes(),
        "sources/buildDescription.xml": build_description(component.name, compiled),
        **dict(libraries),
        **(dict.fromkeys(MANIFESTS, manifest()) if WASM in binaries else {}),
        **shared_files(parts, sorted(binaries), 3),
    }


def libraries_3(parts: Parts, platform: str, content: bytes) -> Iterator[tuple[str, bytes]]:
    """Where FMI 3.0 has the library of a platform; one for several processors has a folder for each."""
    folders = {FOLDERS[platform]: content} if platform in FOLDERS else {}
    folders = folders or {f"{processor}-darwin": library for processor, library in thin(content).items()}
    for folder, library in folders.items():
        yield f"binaries/{folder}/{parts.component.name}{PLATFORMS[platform].ending}", library


def model_description_2(component: Component, guid: str, version: str, sources: Iterable[str]) -> bytes:
    """`modelDescription.xml`."""
    about = {"fmiVersion": "2.0", "modelName": component.name, "description": component.description}
    root = Element("fmiModelDescription", about)
    kind = SubElement(root, "CoSimulation", {"modelIdentifier": component.name, **FLAGS})
    files = SubElement(kind, "SourceFiles")
    for name in sources:
        SubElement(files, "File", name=name)
    log = SubElement(root, "LogCategories")
    for name in CATEGORIES:
        SubElement(log, "Category", name=f"logStatus{name}", description=f"Log messages with fmi2{name} status.")
    SubElement(log, "Category", name="logAll", description="Log all messages.")
    variables = SubElement(root, "ModelVariables")
    for reference, port in enumerate(component.ports):
        _add_variable(variables, reference, port)
    SubElement(root, "ModelStructure")
    describe.complete(root, component, guid, version)
    root.set("generationTool", describe.TOOL)
    return describe.text(root)


def _add_variable(variables: Element, reference: int, port: Port) -> None:
    is_output = port.causality == "output"
    about = {"name": port.name, "valueReference": str(reference), "description": port.description}
    kinds = {"causality": port.causality, "variability": port.variability}
    more = {"initial": "calculated"} if is_output else {}
    variable = SubElement(variables, "ScalarVariable", {**about, **kinds, **more})
    start = str(port.start).lower() if port.kind == "Boolean" else str(port.start)
    SubElement(variable, port.kind, {} if is_output else {"start": start})
