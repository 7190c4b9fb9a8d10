"""The command line: the modules of commands here and of studies, found by walking."""

import atexit
import signal
from importlib import import_module
from pathlib import Path

from gapsense._os.interrupts import ended_like_ctrl_c, handled, leave

with ended_like_ctrl_c(), handled(leave):  # loading takes a while
    from gapsense.cli.common import app
    from gapsense.studies import modules

    for _file in sorted(Path(__file__).parent.glob("[!_]*.py")):
        import_module(f"{__name__}.{_file.stem}")
    for _name in modules():
        import_module(_name)

atexit.register(signal.signal, signal.SIGINT, signal.SIG_IGN)  # at the end there is nothing left to interrupt

__all__ = ["app"]
