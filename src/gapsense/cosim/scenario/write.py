"""The content of a scenario as a TOML file, in whichever folder."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from gapsense._os.files import write_atomically
from gapsense.cosim.scenario.keys import FILE, key_of
from gapsense.cosim.scenario.read import Document
from gapsense.tables import Key, Section


def write_document(document: Document, path: Path) -> None:
    """Write a scenario file; what it names by a relative path is found from there too."""
    import tomli_w  # here, so that what writes none starts fast

    path.parent.mkdir(parents=True, exist_ok=True)
    data = moved(document.data, FILE, document.path.parent.resolve(), path.parent.resolve())
    text = tomli_w.dumps(data, multiline_strings="\\r" not in repr(data))  # over several lines TOML drops these
    write_atomically(path, lambda file: print(text, end="", file=file))


def moved(tables: Mapping[str, Any], section: Section, old: Path, new: Path) -> dict[str, Any]:
    """Content of a table whose file moves from one folder to another."""

    def value(name: str, item: Any) -> Any:
        key = key_of(section, name)
        if isinstance(item, dict):
            return moved(item, (key and key.section) or section, old, new)
        if isinstance(item, list):
            return [value(name, entry) for entry in item]
        return rebased(item, old, new) if names_path(key, name, item) else item

    return {name: value(name, item) for name, item in tables.items()}


def names_path(key: Key | None, name: str, item: Any) -> bool:
    """True for the value of a key that is a path."""
    return bool(isinstance(item, str) and key and key.is_path and key.is_path(name, item))


def rebased(text: str, old: Path, new: Path) -> str:
    """A path relative to one folder as one relative to another, where there is a way from there."""
    if old == new or Path(text).is_absolute():
        return text
    try:
        return Path(os.path.relpath(old / text, new)).as_posix()
    except ValueError:  # another drive
        return (old / text).as_posix()
