"""Gapsense: FMI co-simulation components for short-stroke reluctance actuators.

>>> from gapsense import Scenario
>>> scenario = Scenario("my valve", stop=20e-3, base_step=25e-6)

What is offered here is loaded when it is asked for, so that `import gapsense` is fast.
"""

from __future__ import annotations

import os
import sys

# `python -m gapsense...`: what is in the working folder comes last.
_is_module = sys.argv[:1] == ["-m"] and sys.path[0] == os.getcwd()  # noqa: PTH109
sys.path.extend([sys.path.pop(0)] if _is_module else [])

from gapsense.version import __version__ as __version__  # noqa: E402

TYPE_CHECKING = False  # that of `typing` takes a while to load, in which a Ctrl-C would be shown as a traceback
if TYPE_CHECKING:
    from gapsense.cosim.model import Scenario as Scenario
    from gapsense.cosim.prepare import check as check
    from gapsense.cosim.record import Result as Result
    from gapsense.cosim.record import read_result as read_result
    from gapsense.cosim.run import run as run

OFFERED = {
    "Scenario": "gapsense.cosim.model",
    **dict.fromkeys(("Result", "read_result"), "gapsense.cosim.record"),
    "check": "gapsense.cosim.prepare",
    "run": "gapsense.cosim.run",
}


def __getattr__(name: str) -> object:
    from importlib import import_module

    if name not in OFFERED:
        raise AttributeError(f"module 'gapsense' has no attribute {name!r}")
    return getattr(import_module(OFFERED[name]), name)


def __dir__() -> list[str]:
    return [*globals(), *OFFERED]
