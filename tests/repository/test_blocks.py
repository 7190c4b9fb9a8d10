"""Every code block of the pages for users runs, page by page, from top to bottom, in a folder of its own.

A block of TOML is loaded (one without a title is laid over the last whole scenario), Python runs in one namespace per
page, lines after `$` of a console block are commands. What they print must be what the block, or the text block after
Python, says; `...` stands for anything. Before a block, `<!-- file: NAME -->` writes it first of all, and
`<!-- skip: REASON -->` leaves it out.
"""

from __future__ import annotations

import contextlib
import doctest
import io
import re
import shlex
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest
from sources import ROOT
from typer.testing import CliRunner

from gapsense.cli import app
from gapsense.cosim import check
from gapsense.cosim.document import Document
from gapsense.cosim.load import read_draft
from gapsense.tables import merged

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

PAGES = [ROOT / "docs" / name for name in ("scenario-file.md", "python.md")]
FENCE = re.compile(r"^(?:<!-- (file|skip|exit): ([^\n]+) -->\n)?```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
SAME = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


class Block(NamedTuple):
    """A code block of a page: its language, its text, where it is, and the note before it."""

    kind: str
    text: str
    place: str
    note: str
    about: str


def blocks(page: Path) -> list[Block]:
    text = page.read_text(encoding="utf-8")
    return [
        Block(found[3], found[4], f"{page.name}:{text.count(chr(10), 0, found.start()) + 1}", found[1], found[2])
        for found in FENCE.finditer(text)
    ]


class Reader:
    """Does what a reader of a page would do with its blocks."""

    def __init__(self) -> None:
        self.whole: dict = {}
        self.names: dict = {"__name__": "page"}
        self.printed = ""

    def toml(self, block: Block) -> None:
        data = tomllib.loads(block.text)
        is_whole = "title" in data and "components" in data
        self.whole = data if is_whole else self.whole
        document = Document(Path(block.place), merged(self.whole, data))
        problems = check(document) if is_whole else read_draft(document).problems
        assert not problems, (block.place, problems)

    def python(self, block: Block) -> None:
        with contextlib.redirect_stdout(io.StringIO()) as printed:
            exec(compile(block.text, block.place, "exec"), self.names)
        self.printed = printed.getvalue()

    def text(self, block: Block) -> None:
        """What the Python block before it has printed."""
        same(block.text, self.printed, block.place)

    def console(self, block: Block) -> None:
        for command, expected in re.findall(r"^\$ (.+)\n((?:[^$\n].*\n|\n)*)", block.text, re.MULTILINE):
            program, *arguments = shlex.split(command, comments=True)
            assert program == "gapsense", block.place
            done = CliRunner().invoke(app, arguments)
            assert done.exit_code == (int(block.about) if block.note == "exit" else 0), (block.place, done.output)
            if expected.strip():
                same(expected, done.output, block.place)


def same(expected: str, found: str, place: str) -> None:
    assert doctest.OutputChecker().check_output(expected, found, SAME), f"{place}:\n{found}"


@pytest.fixture
def folder(tmp_path: Path, fmus: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    (tmp_path / "build").mkdir()
    (tmp_path / "build" / "fmus").symlink_to(fmus)
    monkeypatch.chdir(tmp_path)
    yield tmp_path


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_blocks_of_a_page_run_in_order(page, folder):
    reader, every = Reader(), blocks(page)
    assert len(every) > 5
    for block in every:
        if block.note == "file":
            (folder / block.about).parent.mkdir(exist_ok=True)
            (folder / block.about).write_text(block.text, encoding="utf-8")
    for block in every:
        if block.note != "skip" and (block.note != "file" or "title =" in block.text):
            getattr(reader, block.kind)(block)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_page_has_no_code_outside_of_blocks(page):
    rest = FENCE.sub("", page.read_text(encoding="utf-8"))
    assert "```" not in rest and not re.search(r"^ {4}\S", rest, re.MULTILINE)
    assert all(block.kind for block in blocks(page))
