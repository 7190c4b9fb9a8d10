"""The FMU of FMI 3.0: the same libraries as those of FMI 2.0, all platforms in one file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from gapsense.fmi import package, references
from gapsense.fmi.fmi3 import terminals
from gapsense.fmi.fmi3.description import build_description, model_description
from gapsense.fmi.native.compile import thin
from gapsense.fmi.native.parts import Parts
from gapsense.fmi.native.platforms import PLATFORMS
from gapsense.version import __version__

FOLDERS = {"linux64": "x86_64-linux", "win64": "x86_64-windows", "aarch64-linux": "aarch64-linux"}


def members_of(
    parts: Parts, binaries: Mapping[str, bytes], compiled: Sequence[str], documentation: str
) -> dict[str, bytes]:
    """All files of the FMU; `binaries` by platform, as for FMI 2.0; `compiled` are the sources to compile."""
    component = parts.component
    icon = (package.HERE / "icon.png").read_bytes()
    return {
        "modelDescription.xml": model_description(component, parts.variables, parts.guid, __version__),
        "documentation/index.html": documentation.encode(),
        "documentation/licenses/license.txt": (package.HERE / "license.txt").read_bytes(),
        terminals.NAME: terminals.terminals_and_icons(component),
        terminals.ICON: icon,
        **{f"resources/{name}": content for name, content in parts.resources.items()},
        **parts.sources(3),
        "sources/buildDescription.xml": build_description(component.name, compiled),
        **{place: library for name, content in binaries.items() for place, library in libraries(parts, name, content)},
        **references.files(parts.folder, parts.given, fmi=3),
    }


def libraries(parts: Parts, platform: str, content: bytes) -> Iterator[tuple[str, bytes]]:
    """Where FMI 3.0 has the library of a platform; one for several processors has a folder for each."""
    folders = {FOLDERS[platform]: content} if platform in FOLDERS else {}
    folders = folders or {f"{processor}-darwin": library for processor, library in thin(content).items()}
    for folder, library in folders.items():
        yield f"binaries/{folder}/{parts.component.name}{PLATFORMS[platform].ending}", library
