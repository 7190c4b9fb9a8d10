"""Write components as C into a folder: all files, or none."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

from gapsense.embedded.design import Design
from gapsense.embedded.example import example
from gapsense.embedded.readme import readme
from gapsense.embedded.source import header, source
from gapsense.problems import InputError

CORTEX_M = Path(__file__).with_name("cortex_m")
MARK = re.compile(r"(Made|Exported)\s+by\s+Gapsense")  # in every file but those of a board, which users change


def export(designs: Sequence[Design], folder: Path) -> list[Path]:
    """Write the files of some components, what a Cortex-M needs to start, and a README; the files written."""
    texts = written(designs)
    keep_foreign({folder / name: text for name, text in texts.items()})
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder, prefix=".export-") as temporary:
        parts = {name: Path(temporary, str(k)) for k, name in enumerate(texts)}
        for name, part in parts.items():
            part.write_text(texts[name], encoding="utf-8", newline="\n")
        for name in texts:
            (folder / name).parent.mkdir(exist_ok=True)
        return [part.replace(folder / name) for name, part in parts.items()]


def keep_foreign(texts: Mapping[Path, str]) -> None:
    """Refuse to write over files that no export has made, or that were to be changed and have been."""
    there = {path: path.read_text(encoding="utf-8", errors="replace") for path in texts if path.is_file()}
    foreign = [path for path, found in there.items() if not MARK.search(found) and found != texts[path]]
    if foreign:
        raise InputError(
            [f"`{path}` is there, and is not as we export it. Move it, or choose another folder." for path in foreign]
        )


def written(designs: Sequence[Design]) -> Mapping[str, str]:
    """Text of every file, by its path in the folder."""
    files: dict[str, str] = {}
    for design in designs:
        made = {".h": header(design), ".c": source(design), "_main.c": example(design)}
        files |= {f"{design.name}{ending}": text for ending, text in made.items()}
    start = {f"cortex_m/{p.name}": p.read_text(encoding="utf-8") for p in sorted(CORTEX_M.iterdir()) if p.is_file()}
    return {**files, **start, "README.md": readme(designs)}
