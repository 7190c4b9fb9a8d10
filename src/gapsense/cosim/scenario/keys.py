"""The keys of a scenario file, from their table `keys.toml`: the loader asks for them, their pages are made of them."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import Any

from gapsense.cosim.result.metrics import KINDS
from gapsense.cosim.scenario.records import ACTIONS, INTERPOLATIONS, ISOLATIONS, METHODS, NAME
from gapsense.parameters import is_file
from gapsense.tables import TYPES, Key, Section, parse_toml

PATHS: dict[str, Callable[[str, str], bool]] = {  # whether a key of some name has a text that is a path
    "any": lambda name, text: True,
    "fmu": lambda name, text: text.endswith(".fmu"),  # without its ending it is the name of one
    "file": is_file,
}


def read_sections(file: Path, choices: Mapping[str, Collection[str]]) -> dict[str, Section]:
    """The sections of a table of keys by name; `choices` has the words that a row names."""
    data, made = parse_toml(file.read_text("utf-8")) or {}, dict[str, Section]()

    def section(name: str) -> Section:
        """Section of that name, made once; its last key stands for names that are free if it is called `<...>`."""
        if name not in made:
            *others, last = [key(of, row) for of, row in data[name].pop("keys").items()]
            is_free = last.name.startswith("<")
            keys = tuple(others) if is_free else (*others, last)
            made[name] = Section(**{"header": "", **data[name]}, keys=keys, free=last if is_free else None)
        return made[name]

    def key(name: str, row: dict[str, Any]) -> Key:
        """Key of a row; without anything else the first of its choices holds."""
        words = tuple(choices[row.pop("choices")]) if "choices" in row else ()
        if words and not (row.get("required") or row.get("otherwise")):
            row["default"] = words[0]
        if "section" in row:
            row["section"] = section(row["section"])
        pattern, path = NAME if row.pop("is_name", False) else "", PATHS.get(row.pop("path", ""))
        return Key(name, TYPES[row.pop("type")], choices=words, pattern=pattern, is_path=path, **row)

    for name in data:
        section(name)
    return made


CHOICES = {
    "actions": ACTIONS,
    "interpolations": INTERPOLATIONS,
    "isolations": ISOLATIONS,
    "kinds": KINDS,
    "methods": METHODS,
}
SECTIONS = read_sections(Path(__file__).with_name("keys.toml"), CHOICES)
FILE, VARIANT = SECTIONS["file"], SECTIONS["variant"]


def key_of(section: Section, name: str) -> Key | None:
    """The key of that name in a section; a variant may have all that a file has."""
    own = {key.name: key for key in (*(FILE.keys if section is VARIANT else ()), *section.keys)}
    return own.get(name, section.free)
