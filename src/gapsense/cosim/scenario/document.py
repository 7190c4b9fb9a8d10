"""What a scenario says before it is read: a file, or the same tables made by a program, and values laid over it."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from gapsense.cosim.scenario.kinds import SCENARIO, other_kind
from gapsense.parameters import located_values
from gapsense.problems import ScenarioError, suggest
from gapsense.shipped import example, examples
from gapsense.tables import Kind, Table, Value, merged, parsed_value, read_toml

OVER = "--set"  # on the command line, and as the place of a value in messages


@dataclass(frozen=True)
class Document:
    """Tables of a scenario; `path` is its file, or, of one that has none, its name in the folder of its other files."""

    path: Path
    data: Mapping[str, Any]
    changes: Mapping[str, Any] = field(default_factory=dict)  # values by `component.variable`, over all others
    is_file: bool = False  # as it stands in `path`

    @property
    def name(self) -> str:
        """Name of the scenario: that of its file's folder, or its own."""
        path = self.path.resolve()
        return path.parent.name if self.is_file or path.suffix == ".toml" else path.name

    @property
    def hashes(self) -> dict[str, str]:
        """Hashes of what stands in no file."""
        parts = {"changes": self.changes, "content": {} if self.is_file else self.data}
        return {
            part: hashlib.sha256(json.dumps(tables).encode()).hexdigest() for part, tables in parts.items() if tables
        }

    def with_variant(self, variant: str | None, problems: list[str]) -> Document | None:
        """The document with one of its variants laid over it, or None after noting that there is none."""
        if variant is None:
            return self
        variants = self.data.get("variants")
        if not isinstance(variants, dict) or not isinstance(variants.get(variant), dict):
            known = variants if isinstance(variants, dict) else {}
            problems.append(f"{self.path.name}: there is no variant `{variant}`. {suggest(variant, known)}")
            return None
        base = {key: value for key, value in self.data.items() if key != "variants"}
        return replace(self, data=merged(base, variants[variant]) | {"variants": variants})


Source = str | Path | Document  # of a scenario: its file or folder, or its content


def scenario_file(source: Source) -> Path:
    """The scenario file itself, also if its folder, its content, or the name of an example is given.

    An example counts where there is no such file.
    """
    if isinstance(source, Document):
        return source.path
    path = Path(source)
    file = path / "scenario.toml" if path.is_dir() else path
    folder = None if file.exists() else example(path)
    return folder / "scenario.toml" if folder else file


def missing(path: Path) -> str:
    """Sentence on a scenario that there is not, with one that was perhaps meant, or what its folder is."""
    folder = path.parent
    if path.name == "scenario.toml" and (wrong := other_kind(folder, SCENARIO)):
        return wrong
    beside = [file.name for file in folder.glob("*.toml")]
    around = [file.parent.name for file in folder.glob("*/scenario.toml")] + (examples() if folder == Path() else [])
    near = get_close_matches(path.name, sorted({*beside, *around}), n=1)
    hint = f"Did you mean `{folder / near[0]}`?" if near else "Correct the path."
    return f"{path}: there is no such file. {hint}"


def read_document(source: Source, problems: list[str]) -> Document | None:
    """Content of a scenario file, or None after noting why it cannot be read."""
    if isinstance(source, Document):
        return source
    path = scenario_file(source)
    if wrong := other_kind(path, SCENARIO) if path.exists() else missing(path):
        problems.append(wrong)
        return None
    data = read_toml(path, problems)
    return None if data is None else Document(path, data, is_file=True)


# Values laid over a scenario from outside: `--set component.variable=value`.


def changed(source: Source, settings: Sequence[str]) -> Source:
    """A scenario with values laid over it that are written as on the command line.

    Parameters
    ----------
    source : str, Path or Document
        The scenario.
    settings : sequence of str
        As `valve.damping=0.4`. What TOML does not take as a value is a text; files are relative to the working folder.

    Returns
    -------
    str, Path or Document
        The scenario itself where there is nothing to lay over it.
    """
    if not settings:
        return source
    problems: list[str] = []
    changes: dict[str, Any] = {}
    for setting in settings:
        name, equals, text = (part.strip() for part in setting.partition("="))
        if not all((equals, *name.partition("."))):
            problems.append(f"{OVER}, {setting}: `component.parameter=value` expected. Correct it.")
        elif name in changes:
            problems.append(f"{OVER}, {name}: given twice. Keep one.")
        changes[name] = parsed_value(text)
    document = read_document(source, problems)
    if problems or document is None:
        raise ScenarioError(problems)
    return replace(document, changes={**document.changes, **changes})


class Changes:
    """Values laid over a scenario: first come those of inputs and seeds that it states, the others are parameters."""

    def __init__(self, given: Mapping[str, Any], problems: list[str]) -> None:
        self.left = dict(given)
        self.table = Table(given, OVER, "", problems)

    def instead(self, names: Iterable[str], kind: Kind) -> dict[str, Any]:
        """Values of that kind instead of what the scenario states under these names."""
        return self.popped([name for name in names if name in self.left]).flat(kind)

    def parameters(self, component: str) -> dict[str, Value]:
        """Values for the parameters of a component."""
        head = f"{component}."
        mine = self.popped([name for name in self.left if name.startswith(head)])
        return {name.removeprefix(head): value for name, value in located_values(mine, Path()).items()}

    def popped(self, names: Iterable[str]) -> Table:
        """Values that nobody else gets."""
        return self.table.child({name: self.left.pop(name) for name in names}, "")

    def finish(self, components: Iterable[str]) -> None:
        """Note what names no component."""
        for name in self.left:
            component = name.partition(".")[0]
            self.table.note(name, f"there is no component `{component}`. {suggest(component, components)}")
