"""What the reference has of functions whose arguments come from a table: their docstrings as `help` shows them."""

from __future__ import annotations

import inspect
from typing import Any

import griffe

from gapsense import functions


class Arguments(griffe.Extension):
    """Takes docstrings of `gapsense.functions` from the functions, not from their source."""

    def on_function(self, *, func: griffe.Function, **_: Any) -> None:
        """Of one function."""
        made = getattr(functions, func.name, None) if func.path == f"gapsense.functions.{func.name}" else None
        if made is not None and (text := inspect.getdoc(made)):
            func.docstring = griffe.Docstring(text, parent=func)
