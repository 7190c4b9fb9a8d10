"""A class for each component, such as `gapsense.Ertss`. What each takes and gives is in components.pyi."""

from __future__ import annotations

from typing import Any

from gapsense.runnable import component_class


def __getattr__(name: str) -> Any:
    try:
        return component_class(name)
    except FileNotFoundError as error:
        raise AttributeError(str(error)) from None
