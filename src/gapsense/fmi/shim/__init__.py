"""The C library that stands in front of pythonfmu's Linux binary in each FMU.

Inside an FMU, `binaries/linux64/<ModelIdentifier>.so` is a copy of `BINARY`, and pythonfmu's own binary lies beside it
under the name `WRAPPER`, which the library opens at run time. What it does and why is told in `SOURCE`.
"""

from pathlib import Path

SOURCE = Path(__file__).resolve().with_name("shim.c")
BINARY = SOURCE.with_name("linux64") / "shim.so"
WRAPPER = "pythonfmu-export.bin"
