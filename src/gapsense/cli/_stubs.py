"""Types of the classes of all components, for editors: `python -m gapsense.cli._stubs` writes components.pyi again."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from gapsense.fmi.components import find_components, load_component
from gapsense.fmi.ports import Component
from gapsense.runnable import TYPES, make_docstring
from gapsense.shipped import COMPONENTS, PACKAGE

FILE = PACKAGE / "components.pyi"
HEAD = """# Made by `python -m gapsense.cli._stubs` from the port tables; do not edit.
from collections.abc import Iterable
from typing import NamedTuple

import numpy.typing as npt

from gapsense.runnable import Floats, Response, Runnable
"""


def text() -> str:
    """Content of the file."""
    return (
        "\n\n".join([HEAD, *("\n".join(of(load_component(folder))) for folder in find_components(COMPONENTS))]) + "\n"
    )


def of(ports: Component) -> Iterator[str]:
    """Lines of one component: its outputs in a step and over samples, and its class."""
    name, outputs = ports.name, [port.name for port in ports.of("output")]
    yield from (f"class {name}Outputs(NamedTuple):", *(f"    {output}: float" for output in outputs), "")
    yield from (f"class {name}Response(Response):", *(f"    {output}: Floats" for output in outputs), "")
    yield from (f"class {name}(Runnable):", '    """')
    yield from (f"    {line}".rstrip() for line in make_docstring(ports).splitlines())
    yield from ('    """', "", "    def __init__(", "        self,", "        *,")
    yield from (f"        {port.field}: {TYPES[port.kind]} = ...," for port in ports.of("parameter"))
    yield "    ) -> None: ..."
    for function, kind, more, made in (
        ("run", "npt.ArrayLike", ("start_time: float = ...", "outputs: Iterable[str] = ..."), "Response"),
        ("step", "float", (), "Outputs"),
    ):
        yield from (f"    def {function}(  # type: ignore[override]", "        self,")
        yield from (f"        {p.name}: {kind}{' = ...' * p.is_optional}," for p in ports.of("input"))
        yield from ("        *,", "        sample_time: float | None = ...,", *(f"        {line}," for line in more))
        yield f"    ) -> {name}{made}: ..."
    yield ""


def main(file: Path = FILE) -> None:
    """Write the file."""
    file.write_text(text(), encoding="utf-8")


if __name__ == "__main__":
    main()
