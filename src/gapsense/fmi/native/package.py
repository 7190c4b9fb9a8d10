"""Build native FMUs: gather what a component is in C, compile it for each platform, package it."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from gapsense.fmi import package, page, picture, references
from gapsense.fmi.native import package3
from gapsense.fmi.native.compile import binary, compile_common
from gapsense.fmi.native.description import description
from gapsense.fmi.native.parts import Parts, common, gather
from gapsense.fmi.native.platforms import PLATFORMS, compilers
from gapsense.version import __version__

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
            yield from ((part.folder, path) for path in packaged(part, binaries, destination))


def packaged(parts: Parts, binaries: Mapping[str, bytes], destination: Path) -> Iterator[Path]:
    """Write the FMUs of FMI 2.0, and that of FMI 3.0."""
    apart = {name for name in binaries if name != PLATFORMS[name].folder}
    for together in (sorted(binaries.keys() - apart), *([name] for name in sorted(apart))):
        if together:
            folder = destination / together[0] if together[0] in apart else destination
            folder.mkdir(parents=True, exist_ok=True)
            members = {**members_of(parts, together), **libraries(parts, binaries, together)}
            yield package.write(members, folder / f"{parts.component.name}.fmu")
    page3 = documentation(parts, sorted(binaries), "3.0")
    members = package3.members_of(parts, binaries, listed(parts.sources(3)), page3)
    (destination / "fmi3").mkdir(parents=True, exist_ok=True)
    yield package.write(members, destination / "fmi3" / f"{parts.component.name}.fmu")


def libraries(parts: Parts, binaries: Mapping[str, bytes], platforms: Sequence[str]) -> dict[str, bytes]:
    """The binaries of some platforms, where FMI 2.0 has them."""
    places = {name: PLATFORMS[name] for name in platforms}
    return {f"binaries/{p.folder}/{parts.component.name}{p.ending}": binaries[n] for n, p in places.items()}


def members_of(parts: Parts, platforms: Sequence[str]) -> dict[str, bytes]:
    """All other files of an FMU of FMI 2.0."""
    component, sources = parts.component, parts.sources(2)
    return {
        "modelDescription.xml": description(component, parts.guid, __version__, listed(sources)),
        "documentation/index.html": documentation(parts, platforms).encode(),
        "documentation/licenses/license.txt": (package.HERE / "license.txt").read_bytes(),
        "model.png": (package.HERE / "icon.png").read_bytes(),
        **{f"resources/{name}": content for name, content in parts.resources.items()},
        **sources,
        **references.files(parts.folder, parts.given),
    }


def listed(sources: Mapping[str, bytes]) -> list[str]:
    """The files among these that are to be compiled."""
    return sorted(Path(name).name for name in sources if name.endswith(".c"))


def documentation(parts: Parts, platforms: Sequence[str], fmi: str = "2.0") -> str:
    """The page of a component, which says what this FMU runs on."""
    markdown = (parts.folder / "page.md").read_text(encoding="utf-8")
    run = RUN.format(platforms=" and ".join(NAMES[name] for name in platforms), fmi=fmi)
    drawing = picture.figure(parts.component, parts.folder)
    return page.html(parts.component, markdown, __version__, drawing, run)
