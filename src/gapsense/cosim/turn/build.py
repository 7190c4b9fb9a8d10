"""Compile turn.c: `python -m gapsense.cosim.turn.build`; or see if the committed binary is current: `--check`."""

from __future__ import annotations

from gapsense.cosim.turn import BINARY, SOURCE
from gapsense.native import Library

TURN = Library(
    module="gapsense.cosim.turn.build",
    source=SOURCE,
    binary=BINARY,
    exports=("turn",),
    options=("-ffp-contract=off",),  # Python rounds the product too
)

if __name__ == "__main__":
    raise SystemExit(TURN.main())
