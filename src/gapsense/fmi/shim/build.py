"""Compile the shim: `python -m gapsense.fmi.shim.build`; or see if the committed binary is current: `--check`.

The FMI headers are those that FMPy ships; the rest is in `gapsense.native`.
"""

from __future__ import annotations

import re
from importlib.util import find_spec
from pathlib import Path

from gapsense.fmi.shim import BINARY, SOURCE
from gapsense.native import Library, NativeError

CALLS = SOURCE.with_name("calls.h")


def headers() -> Path:
    """Folder with `fmi2Functions.h`, inside the installed FMPy."""
    spec = find_spec("fmpy")
    if spec is None or spec.origin is None:
        raise NativeError("The FMI headers come from FMPy, which is not installed. Run `pip install fmpy`.")
    folder = Path(spec.origin).parent / "c-code"
    if not (folder / "fmi2Functions.h").is_file():
        raise NativeError(f"`{folder}` has no `fmi2Functions.h`. Install FMPy 0.3.32, which ships it.")
    return folder


def exported() -> tuple[str, ...]:
    """Names of all functions that the shim must export."""
    forwarded = re.findall(r"^CALL\((\w+),", CALLS.read_text("utf-8"), flags=re.MULTILINE)
    written_out = re.findall(r"^FMI2_Export [^=]*?(fmi2\w+)\(", SOURCE.read_text("utf-8"), flags=re.MULTILINE)
    return tuple(sorted({*forwarded, *written_out}))


SHIM = Library(
    module="gapsense.fmi.shim.build",
    source=SOURCE,
    binary=BINARY,
    exports=exported(),
    libraries=("-ldl", "-lpthread"),  # part of libc since glibc 2.34
    headers=headers,
)

if __name__ == "__main__":
    raise SystemExit(SHIM.main())
