"""Code blocks of pages, and a reader who does with them what they say.

A block of TOML is checked; one without a title is laid over the last whole scenario, on the page or made by a command.
Python runs in one namespace per page. Lines after `$` of a console block are commands; one that ends in `&` runs until
the page ends, as in another window. What they print must be what the block, or the text block after Python, says; `...`
stands for anything. A block for `sh` runs as a whole, without a network. Before a block, `<!-- file: NAME -->` writes
it first of all, `<!-- exit: CODE -->` tells how its commands end, `<!-- in: FOLDER -->` where it runs. No block is left
out.
"""

from __future__ import annotations

import contextlib
import doctest
import io
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from typer.testing import CliRunner

from gapsense import check_study
from gapsense.cli import app
from gapsense.cosim import check
from gapsense.cosim.scenario.read import Document, read_draft
from gapsense.tables import merge_tables

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

REFERENCE = "scenario-file.md"  # whose examples of single keys fit no one scenario: these are only loaded
FENCE = re.compile(r"^(?:<!-- (file|exit|in): ([^\n]+) -->\n)?```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
MODULES = {
    "gapsense": "gapsense.cli",
    "dask": "dask",
    "pytest": "pytest",
    "pythonfmu": "pythonfmu",
}  # run by this Python
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


def read(page: Path) -> None:
    """Do what a page says, from top to bottom, in the working folder."""
    do(blocks(page))


def do(every: Sequence[Block]) -> None:
    """Do what some blocks say, one after the other."""
    for block in every:
        if block.note == "file":
            write(block, every)
    with contextlib.closing(Reader()) as reader:
        for block in every:
            assert block.note != "in" or block.kind == "sh", block.place
            if block.note != "file" or "title =" in block.text:
                getattr(reader, block.kind)(block)


def write(block: Block, every: Sequence[Block]) -> None:
    """The file of a block, which another block of the page must use, unless it is a whole one that is checked."""
    file = Path(block.about)
    used = any(file.name in other.text for other in every if other is not block)
    assert used or "title =" in block.text, block.place
    file.parent.mkdir(exist_ok=True)
    file.write_text(block.text, encoding="utf-8")


class Reader:
    """Does what a reader of a page would do with its blocks."""

    def __init__(self) -> None:
        self.file, self.whole = Path("scenario.toml"), {}
        self.names: dict = {"__name__": "page"}
        self.printed = ""
        self.running: list[subprocess.Popen] = []

    def toml(self, block: Block) -> None:
        data = tomllib.loads(block.text)
        if "scenario" in data:  # a study
            assert not check_study(block.about), block.place
            return
        if "title" in data and "components" in data:
            self.file, self.whole = Path(block.about if block.note == "file" else "scenario.toml"), data
        document = Document(self.file, merge_tables(self.whole, data))
        problems = read_draft(document).problems if block.place.startswith(REFERENCE) else check(document)
        assert not problems, (block.place, problems)

    def python(self, block: Block) -> None:
        with contextlib.redirect_stdout(io.StringIO()) as printed:
            exec(compile(block.text, block.place, "exec"), self.names)
        self.printed = printed.getvalue()

    def text(self, block: Block) -> None:
        """What the Python block before it has printed."""
        same(block.text, self.printed, block.place)

    def sh(self, block: Block) -> None:
        where = block.about if block.note == "in" else None
        done = subprocess.run(["sh", "-e"], input=block.text, cwd=where, env=offline(), capture_output=True, text=True)
        assert done.returncode == 0, (block.place, done.stdout + done.stderr)

    def console(self, block: Block) -> None:
        assert block.text.startswith("$ "), block.place
        for line, expected in re.findall(r"^\$ (.+)\n((?:[^$\n].*\n|\n)*)", block.text, re.MULTILINE):
            if line.endswith(" &"):
                self.running.append(started(shlex.split(line[:-2])))
                continue
            output = "".join(self.command(shlex.split(part, comments=True), block) for part in line.split(" && "))
            if expected.strip():
                same(expected, output, block.place)

    def command(self, words: list[str], block: Block) -> str:
        """Output of a command, which must end as the block says."""
        code, output = called(words)
        assert code == (int(block.about) if block.note == "exit" else 0), (block.place, output)
        if words[:2] == ["gapsense", "new"]:
            self.file = Path(words[2], "scenario.toml")
            self.whole = tomllib.loads(self.file.read_text(encoding="utf-8"))
        return output

    def close(self) -> None:
        """End what still runs, the last one first; what was to run until now has not ended by itself."""
        for process in reversed(self.running):
            ended = process.poll()
            process.terminate()
            process.wait(60)
            assert ended is None, process.args


def offline() -> dict[str, str]:
    """Environment in which `python3` is this one, and pip takes the packages of this one and nothing from elsewhere."""
    packages = [folder for folder in sys.path if Path(folder).name in ("site-packages", "dist-packages")]
    paths = {"PATH": [str(Path(sys.executable).parent), os.environ["PATH"]], "PYTHONPATH": packages}
    pip = {"PIP_NO_INDEX": "1", "PIP_NO_BUILD_ISOLATION": "0"}  # 0: without isolation, as pip reads it
    return {**os.environ, **{name: os.pathsep.join(folders) for name, folders in paths.items()}, **pip}


def called(words: list[str]) -> tuple[int, str]:
    """Exit code and output of a command."""
    if words[0] == "gapsense" and words[1] != "build":  # which is no work for a process that has run FMUs of pythonfmu
        result = CliRunner().invoke(app, words[1:])
        return result.exit_code, result.output
    done = subprocess.run(line_of(words), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    return done.returncode, done.stdout


def started(words: list[str]) -> subprocess.Popen:
    return subprocess.Popen(line_of(words), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def line_of(words: list[str]) -> list[str]:
    """The command line, in which programs in Python are those of this one."""
    if words[0] == "python":
        return [sys.executable, *words[1:]]
    return [sys.executable, "-m", MODULES[words[0]], *words[1:]] if words[0] in MODULES else words


def same(expected: str, found: str, place: str) -> None:
    assert doctest.OutputChecker().check_output(expected, found, SAME), f"{place}:\n{found}"
