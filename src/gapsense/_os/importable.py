"""Functions that another process finds by their name."""

from __future__ import annotations

import importlib
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from gapsense.shipped import PACKAGE

# First a process of ours forgets the working folder, which Python puts first. Both modules are built into Python:
# nothing is looked for in a folder yet.
ALONE = "import sys, _signal; sys.path[:] = filter(None, sys.path); "


def python(code: str, *arguments: str) -> list[str]:
    """Command that runs code in another Python, which imports nothing from the working folder."""
    return [sys.executable, "-c", ALONE + code, *arguments]


def search_path(*first: Path) -> str:
    """The PYTHONPATH of a process of ours: `first`, then that of this one without the working folder."""
    here, entries = Path.cwd().resolve(), os.environ.get("PYTHONPATH", "").split(os.pathsep)
    kept = [str(folder) for entry in entries if entry and (folder := Path(entry).resolve()) != here]
    return os.pathsep.join(dict.fromkeys([*map(str, first), *kept]))


def importable_name(function: Callable[..., Any]) -> str:
    """`module:function`, under which another process finds the function."""
    module, name = function.__module__, function.__qualname__
    if module == "__main__" or "<" in name or "." in name:
        raise ValueError(f"`{name}` of `{module}`: workers cannot import it. Put it at the top level of a module.")
    return f"{module}:{name}"


def import_function(name: str) -> Any:
    """Import the function called `module:function`."""
    module, _, function = name.partition(":")
    return getattr(importlib.import_module(module), function)


def facts(function: Callable[..., Any]) -> list[str]:
    """Name of a function and hash of its module's file, for the key of what it computes."""
    from gapsense._os.files import sha256  # here, so that what needs no arrays starts fast

    return [importable_name(function), sha256(source_file(function))]


def root(function: Callable[..., Any]) -> Path:
    """Folder from which the module of a function is imported."""
    if function.__module__.partition(".")[0] == PACKAGE.name:  # whose studies stand in scenarios/
        return PACKAGE.parent
    file = source_file(function)
    return file.parents[function.__module__.count(".") + (file.name == "__init__.py")]


def source_file(function: Callable[..., Any]) -> Path:
    """File of a function's module."""
    return Path(str(sys.modules[function.__module__].__file__)).resolve()
