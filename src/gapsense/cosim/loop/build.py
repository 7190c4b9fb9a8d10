"""Compile loop.c: `python -m gapsense.cosim.loop.build`; or see if the committed binary is current: `--check`."""

from __future__ import annotations

from gapsense.cosim.loop.library import BINARY, SOURCE
from gapsense.native import Library

LOOP = Library(
    module="gapsense.cosim.loop.build",
    source=SOURCE,
    binary=BINARY,
    exports=("loop",),
    options=("-ffp-contract=off",),  # Python rounds the product too
)

if __name__ == "__main__":
    raise SystemExit(LOOP.main())
