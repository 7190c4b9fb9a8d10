"""Compile the shim: `python -m gapsense.fmi.shim.build`; or see if the committed binary is current: `--check`.

The FMI headers are those that FMPy ships; the rest is in `gapsense._os.native`.
"""

from __future__ import annotations

import re
from importlib.util import find_spec
from pathlib import Path

from gapsense._os.native import Library, NativeError
from gapsense.fmi.shim import BINARY, SOURCE
from gapsense.kernels.emit.c import same


def headers() -> Path:
    """Folder with `fmi2Functions.h`, inside the installed FMPy."""
    spec = find_spec("fmpy")
    if spec is None or spec.origin is None:
        raise NativeError("The FMI headers come from FMPy, which is not installed. Run `pip install fmpy`.")
    folder = Path(spec.origin).parent / "c-code"
    if not (folder / "fmi2Functions.h").is_file():
        raise NativeError(f"`{folder}` has no `fmi2Functions.h`. Install FMPy 0.3.32, which ships it.")
    return folder


def exported_names() -> tuple[str, ...]:
    """Names of all functions that the shim must export."""
    text = "".join(file.read_text("utf-8") for file in SOURCE.parent.glob("*.[ch]"))
    return tuple(sorted(set(re.findall(r"^(?:STATUS\(|FMI2_Export [^=;]*?)(fmi2\w+)\b[(,]", text, flags=re.MULTILINE))))


def write_math_header() -> dict[str, str]:
    """The header with exp, log and tanh."""
    return {"same.h": same("double", ("same_exp(", "same_log(", "same_tanh("))}


SHIM = Library(
    module="gapsense.fmi.shim.build",
    source=SOURCE,
    binary=BINARY,
    exports=exported_names(),
    embedded=("loader.py",),
    libraries=("-ldl", "-lpthread"),  # part of libc since glibc 2.34
    options=("-ffp-contract=off",),
    headers=headers,
    generated=write_math_header,
)

if __name__ == "__main__":
    raise SystemExit(SHIM.main())
