"""Compile loop.c: `python -m gapsense.cosim.run.loop.build`; or see if the committed binary is current: `--check`."""

from __future__ import annotations

from gapsense._os.native import Library
from gapsense.cosim.run.loop.compiled import BINARY, SOURCE

LOOP = Library(
    module="gapsense.cosim.run.loop.build",
    source=SOURCE,
    binary=BINARY,
    exports=("loop", "solve"),
    options=("-ffp-contract=off",),  # Python rounds the product too
)

if __name__ == "__main__":
    raise SystemExit(LOOP.main())
