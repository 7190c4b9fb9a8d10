"""The command line: one module per group of commands here and one in each study's folder, found by walking."""

import os
import signal
import sys

# Before all else, since a Ctrl-C may come at once; a program that has a handler of its own keeps it.
if is_early := signal.getsignal(signal.SIGINT) is signal.default_int_handler and "threading" not in sys.modules:
    signal.signal(signal.SIGINT, lambda *_: (os.write(2, b"interrupted.\n"), os._exit(130)))

import atexit
from importlib import import_module
from pathlib import Path

from gapsense.interrupts import ended_like_ctrl_c, handled, leave

if is_early:
    signal.signal(signal.SIGINT, signal.default_int_handler)
with ended_like_ctrl_c(), handled(leave):  # loading takes a while
    from gapsense import studies
    from gapsense.cli.common import app

    for _file in sorted(Path(__file__).parent.glob("[!_]*.py")):
        import_module(f"{__name__}.{_file.stem}")
    for _name in studies.modules("command"):
        import_module(_name)

atexit.register(signal.signal, signal.SIGINT, signal.SIG_IGN)  # at the end there is nothing left to interrupt

__all__ = ["app"]
