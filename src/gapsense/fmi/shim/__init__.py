"""The Linux binary of our Python FMUs, in place of pythonfmu's.

Inside an FMU, `binaries/linux64/<ModelIdentifier>.so` is a copy of `BINARY`. What it does is told in `SOURCE`.
"""

from pathlib import Path

SOURCE = Path(__file__).resolve().with_name("shim.c")
BINARY = SOURCE.with_name("linux64") / "shim.so"
