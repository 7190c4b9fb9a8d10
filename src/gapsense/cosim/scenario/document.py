"""What a scenario says before it is read: a file, or the same tables made by a program, and values laid over it."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from gapsense.cosim.scenario.kinds import SCENARIO, other_kind
from gapsense.problems import suggest
from gapsense.shipped import example, examples
from gapsense.tables import merged, read_toml


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
