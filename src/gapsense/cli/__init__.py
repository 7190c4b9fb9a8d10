"""The command line: one module per group of commands here and one in each study's folder, found by walking."""

import atexit
import signal
from importlib import import_module
from pathlib import Path

from gapsense._os.interrupts import ended_like_ctrl_c, handled, leave

with ended_like_ctrl_c(), handled(leave):  # loading takes a while
    from gapsense import studies
    from gapsense.cli.common import app

    for _file in sorted(Path(__file__).parent.glob("[!_]*.py")):
        import_module(f"{__name__}.{_file.stem}")
    for _name in studies.modules("command"):
        import_module(_name)

atexit.register(signal.signal, signal.SIGINT, signal.SIG_IGN)  # at the end there is nothing left to interrupt

__all__ = ["app"]
