"""The command line: the modules of commands here and of studies, found by walking.

All of them take longer to load than many a run, so the program loads only the module of the command that is given. The
attribute `app` is the program with all commands.
"""

import atexit
import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gapsense._os.interrupts import count_interrupts, ended_like_ctrl_c, handle, leave

if TYPE_CHECKING:
    from gapsense.cli.common import App, app

atexit.register(signal.signal, signal.SIGINT, signal.SIG_IGN)  # at the end there is nothing left to interrupt

__all__ = ["app", "load_app"]


def start(words: list[str]) -> None:
    """Run the command that the words on the command line name; a run that is given in the usual way needs no parser."""
    if words[:1] == ["run"]:
        with ended_like_ctrl_c(), handle(leave):
            from gapsense.cli.console import report_errors
            from gapsense.cli.straight import parse_run
            from gapsense.cosim.run.ahead import run_ahead

            if given := parse_run(words[1:]):
                # Another process loads what the run needs while this one does; no Ctrl-C must leave it behind.
                with ended_at_once(), report_errors(), count_interrupts() as interrupts, run_ahead():
                    from gapsense.cli.run import run_straight

                    return run_straight(given, interrupts)
    load_app(*words[:1])()


@contextmanager
def ended_at_once() -> Iterator[None]:
    """End the program without taking its interpreter down in order, which takes a tenth of a short run."""
    try:
        yield
    except SystemExit as end:
        atexit._run_exitfuncs()
        with suppress(OSError):  # of an output that nobody reads: Python tells it in its own way
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(end.code if isinstance(end.code, int) else 0)
        raise


def load_app(command: str = "") -> "App":
    """Load the program with the module that registers a command; with all modules if none here does."""
    with ended_like_ctrl_c(), handle(leave):  # loading takes a while
        from gapsense.cli.common import app

        files = sorted(Path(__file__).parent.glob("[!_]*.py"))
        own = [file for file in files if f'command("{command}")' in file.read_text(encoding="utf-8")]
        for file in own or files:
            import_module(f"{__name__}.{file.stem}")
        if not own:
            from gapsense.studies import modules

            for name in modules():
                import_module(name)
            app.registered_commands.sort(key=lambda one: one.name or "")
    return app


def __getattr__(name: str) -> Any:
    if name != "app":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return load_app()
