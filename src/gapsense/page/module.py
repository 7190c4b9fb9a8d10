"""The WebAssembly module of a scenario: its components, compiled as for native FMUs, and the loop over base steps.

The sources are those of the native FMUs, unchanged. They call their component `model`, and its arrays `arrays`. For
each component, macros turn these names into other ones. The shell exists once; there the names stand for the component
that acts.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path

from gapsense._os.native import ZIG, NativeError, zig_compiler, zig_version
from gapsense.cosim.run.loop.compiled import SOURCE as LOOP
from gapsense.fmi.components import own
from gapsense.fmi.native.compile import OWN, put, run
from gapsense.fmi.native.parts import Parts, common, gather
from gapsense.fmi.native.platforms import FLAGS, SMALL

GLUE = Path(__file__).with_name("c") / "page.c"
WASM = ("-target", "wasm32-wasi", "-mexec-model=reactor", "-fno-sanitize=all")
SYMBOLS = ("model", "arrays", "kernel_is_exact")  # of a component
ACTING = ("-Dmodel=(*acting_model)", "-Darrays=(*acting_arrays)")  # in what is there once
LINKED = ("-std=gnu99", "-s")  # with the clock of POSIX, which C99 alone has not
FROM_DISK = ("-Dis_file=is_on_disk", "-Dfile_content=from_disk")  # of which a page has none
COMPILERS_AT_ONCE = 2


def module(names: Iterable[str], plan: str) -> bytes:
    """The module of some components, by the names of their FMUs; `plan` is the text of plan.h.

    A NativeError tells that the compiler is missing, or fails.
    """
    refuse_without_zig()
    used = sorted(set(names))
    with tempfile.TemporaryDirectory() as temporary, ThreadPoolExecutor(COMPILERS_AT_ONCE) as pool:
        folder, objects = Path(temporary), pool.map(lambda f: f(), [shell, *(lambda n=n: component(n) for n in used)])
        found = [(name, content) for files in objects for name, content in files.items()]
        for name, content in found:
            (folder / name).write_bytes(content)
        headers = {name: text for name, text in common().items() if name.endswith(".h")}
        glue = {"page.c": GLUE.read_text("utf-8"), "loop.c": LOOP.read_text("utf-8"), "plan.h": plan}
        put({**headers, **glue}, folder)
        compile_to(folder / "page.wasm", [folder / "page.c", *(folder / name for name, _ in found)], LINKED)
        return (folder / "page.wasm").read_bytes()


def refuse_without_zig() -> None:
    """Raise a NativeError that says what to install if the compiler is missing or is another version."""
    if zig_version() != ZIG:
        found = f"A page is compiled by ziglang {ZIG}, found {zig_version() or 'none'}."
        raise NativeError(f"{found} Run `pip install ziglang=={ZIG}`.")


@cache
def shell() -> Mapping[str, bytes]:
    """Object files of what is the same for all components; the layer of FMI 2.0 is the one that is called."""
    sources = {n: text for n, text in common().items() if not n.startswith("fmi3")}
    flags = {name: (*SMALL, *ACTING, *(FROM_DISK if name == "files.c" else ())) for name in sources}
    return objects(sources, flags)


@cache
def component(name: str) -> Mapping[str, bytes]:
    """Object files of one component."""
    files = parts(name).files
    own_names = [f"-D{symbol}={symbol}_{name}" for symbol in SYMBOLS]
    sources = {n: text for n, text in files.items() if n in OWN or n.endswith(".h")}
    return {f"{name}-{file}": content for file, content in objects(sources, dict.fromkeys(OWN, own_names)).items()}


@cache
def parts(name: str) -> Parts:
    """What the native FMU of a component is made of."""
    return gather(own(name), {})


def objects(sources: Mapping[str, str], flags: Mapping[str, Sequence[str]]) -> dict[str, bytes]:
    """Object file of each source."""
    made = {}
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        put(sources, folder)
        for name in (name for name in sources if name.endswith(".c")):
            compile_to(folder / f"{name}.o", [folder / name], ("-c", *flags[name]))
            made[f"{name}.o"] = (folder / f"{name}.o").read_bytes()
    return made


def compile_to(file: Path, sources: Sequence[Path], more: Sequence[str]) -> None:
    """Compile, and without `-c` link, into a file."""
    run((*zig_compiler(), *WASM, *FLAGS, *more, *map(str, sources), "-o", str(file)), file.name)
