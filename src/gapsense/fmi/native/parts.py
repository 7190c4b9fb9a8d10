"""What the native FMUs of a component are made of: sources, resources, variables and the identity of all these."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple
from uuid import UUID

from gapsense._os.native import NO_FOLDING
from gapsense.fmi import package
from gapsense.fmi.fmi3.arrays import shapes
from gapsense.fmi.fmi3.constants import arrays_c
from gapsense.fmi.fmi3.variables import Variable, variables
from gapsense.fmi.native import SOURCES, headers, model
from gapsense.fmi.native.platforms import FLAGS, PLATFORMS, SMALL
from gapsense.fmi.ports import Component
from gapsense.fmi.shim.build import headers as fmi_headers
from gapsense.fmi.tables import heads, read_table
from gapsense.kernels.kernel import Kernel
from gapsense.version import __version__


class Parts(NamedTuple):
    """What the native FMUs of a component are made of, whatever the version of FMI."""

    component: Component
    given: Mapping[str, Any]  # start values in place of those of the port table
    guid: str
    variables: list[Variable]  # of FMI 3.0
    files: dict[str, str]  # C sources and headers
    resources: dict[str, bytes]
    folder: Path  # of the component

    def sources(self, fmi: int) -> dict[str, bytes]:
        """C sources and headers that it takes to compile the library for one version of FMI."""
        other = f"fmi{5 - fmi}"
        return {f"sources/{n}": text.encode() for n, text in self.files.items() if not n.startswith(other)}


def gather(folder: Path, values: Mapping[str, Any], *, with_arrays: bool = True) -> Parts:
    """Parts of the component in a folder, with these start values of its parameters.

    `with_arrays` says whether FMI 3.0 lists variables that are arrays; there are hosts that take all for scalars.
    """
    component, kernel, paths = package.prepared(folder, values)
    resources = {path.name: path.read_bytes() for path in paths}
    tables = shipped(component, {path.name: path for path in paths})
    files = {**common(), "kernel.c": kernel.c(), "arrays.c": arrays_c(component, kernel, tables)}
    flags = (FLAGS, SMALL, NO_FOLDING, sorted(PLATFORMS.items()))
    content = (__version__, component, sorted(files.items()), sorted(resources.items()), flags, with_arrays)
    identity = hashlib.sha256(repr(content).encode()).hexdigest()[:32]
    found = variables(component, tables, shapes(kernel))
    found = found if with_arrays else found[: len(component.ports) + 1]  # those of FMI 2.0, and the time
    parts = Parts(
        component=component,
        given=values,
        guid=f"{{{UUID(identity)}}}",
        variables=found,
        files=files,
        resources=resources,
        folder=folder,
    )
    return with_identity(parts, kernel, identity)


def shipped(component: Component, paths: Mapping[str, Path]) -> dict[str, list[list[float]]]:
    """Columns of the tables that travel with the component, by parameter."""
    named = {port.name: (paths[port.start], tuple(heads(port.columns))) for port in component.ports if port.columns}
    return {name: read_table(path, columns) for name, (path, columns) in named.items()}


def with_identity(parts: Parts, kernel: Kernel, identity: str) -> Parts:
    """The same, with the source that knows the identity of all others."""
    text = model.source(parts.component, kernel, parts.guid, identity)
    return parts._replace(files={**parts.files, "model.c": text})


def common() -> dict[str, str]:
    """C sources and headers that are the same for all components."""
    paths = (*SOURCES.glob("*.[ch]"), *fmi_headers().glob("fmi[23]*.h"))
    files = {path.name: path.read_text(encoding="utf-8") for path in sorted(paths)}
    return {**files, "sentences.h": headers.sentences(), "life.h": headers.life()}
