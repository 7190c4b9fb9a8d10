"""The command line: the modules of commands here and of studies, found by walking.

All of them take longer to load than many a run, so the program loads the module of the command that is asked for. The
attribute `app` is the program with all commands.
"""

import atexit
import signal
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gapsense._os.interrupts import ended_like_ctrl_c, handled, leave

if TYPE_CHECKING:
    from gapsense.cli.common import App, app

atexit.register(signal.signal, signal.SIGINT, signal.SIG_IGN)  # at the end there is nothing left to interrupt

__all__ = ["app", "loaded"]


def start(words: list[str]) -> None:
    """Run the command that the words on the command line name; a run that is given in the usual way needs no parser."""
    if words[:1] == ["run"]:
        with ended_like_ctrl_c(), handled(leave):
            from gapsense.cli.run import run_straight, straight

            if given := straight(words[1:]):
                return run_straight(given)
    loaded(*words[:1])()


def loaded(command: str = "") -> "App":
    """The program with the module that registers a command; with all modules if none here does."""
    with ended_like_ctrl_c(), handled(leave):  # loading takes a while
        from gapsense.cli.common import app

        files = sorted(Path(__file__).parent.glob("[!_]*.py"))
        own = [file for file in files if f'command("{command}")' in file.read_text(encoding="utf-8")]
        for file in own or files:
            import_module(f"{__name__}.{file.stem}")
        if not own:
            from gapsense.studies import modules

            for name in modules():
                import_module(name)
    return app


def __getattr__(name: str) -> Any:
    if name != "app":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return loaded()
