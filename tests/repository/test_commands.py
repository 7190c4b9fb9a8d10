"""Commands and pieces of files that pages show outside of the pages whose blocks all run (`test_blocks.py`).

Each command exists and has its options, each piece of a scenario can be loaded; what takes seconds is run.
"""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from sources import ROOT
from test_readme import PAGES, command
from typer.testing import CliRunner

from gapsense.cli import app
from gapsense.cosim.document import Document
from gapsense.cosim.load import read_draft

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
PLACEHOLDER = re.compile(r"[A-Z]{2,}(\.\w+)?|\.\.\.|<.*>")
SCENARIO = {"title": "t", "experiment": {"start": 0.0, "stop": 1.0, "base_step": 0.1}, "components": {}}


def commands(page: Path) -> list[list[str]]:
    """Words of each command of ours on a page: in indented and fenced blocks, and in the text."""
    text = page.read_text(encoding="utf-8")
    fenced = "".join(block for kind, block in FENCE.findall(text) if kind in ("", "sh", "console"))
    shown = re.findall(r"^(?: {4}|\$ )?(gapsense [a-z].*)$", fenced, re.MULTILINE)
    indented = re.findall(r"^ {4}(gapsense .*)$", text, re.MULTILINE)
    inline = re.findall(r"`(gapsense [a-z][^`\n]*)`", FENCE.sub("", text))
    found = [shlex.split(part, comments=True) for line in (*shown, *indented, *inline) for part in line.split("&&")]
    return [words for words in found if words[0] == "gapsense" and not PLACEHOLDER.fullmatch(words[1])]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_commands_of_a_page_exist_and_have_their_options(page):
    for words in commands(page):
        if words[1:] == ["study"]:
            continue
        known = {option for parameter in command(words[1:]).params for option in parameter.opts}
        used = {word.partition("=")[0] for word in words if word.startswith("--") and word != "--help"}
        assert used <= known, words


def test_reader_of_commands_finds_them_wherever_they_are(tmp_path):
    page = tmp_path / "page.md"
    page.write_text(
        "# P\n\n    gapsense run a && gapsense test  # all\n\n`gapsense check X` or `gapsense STUDY`\n\n"
        "```console\n$ gapsense list\ngapsense\n```\n\n```python\ngapsense = 1\n```\n",
        encoding="utf-8",
    )
    found = [" ".join(words) for words in commands(page)]
    assert sorted(found) == ["gapsense check X", "gapsense list", "gapsense run a", "gapsense test"]
    assert sum(len(commands(page)) for page in PAGES) > 100


def pieces(page: Path) -> list[str]:
    """Indented blocks of a page that begin like a table of a scenario file."""
    text = page.read_text(encoding="utf-8")
    blocks = re.findall(r"(?:^ {4}.*\n)+", FENCE.sub("", text), re.MULTILINE)
    return [block.replace("\n    ", "\n")[4:] for block in blocks if block.startswith("    [")]


@pytest.mark.parametrize("page", [p for p in PAGES if pieces(p)], ids=lambda page: page.stem)
def test_pieces_of_scenarios_on_a_page_are_read(page):
    for piece in pieces(page):
        data = {**SCENARIO, **tomllib.loads(piece)}
        problems = read_draft(Document(Path("scenario.toml"), data)).problems
        assert not [p for p in problems if "omponent" not in p], piece  # which the piece does not have


RUN = {"run-to-run.md": 2}  # pages, and how many of their commands run
LEFT = ("build --native", "study")  # for all platforms, minutes, which other tests do


@pytest.mark.slow
@pytest.mark.parametrize("name", RUN)
def test_commands_of_a_page_run(name, tmp_path, fmus, natives, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "build").mkdir()
    (tmp_path / "build" / "fmus").symlink_to(fmus)
    (tmp_path / "build" / "native").symlink_to(natives)
    shutil.copytree(ROOT / "scenarios", tmp_path / "scenarios")
    text = FENCE.sub(lambda found: found[2] if found[1] == "sh" else "", (ROOT / "docs" / name).read_text("utf-8"))
    lines = re.findall(r"^(?: {4})?gapsense (.*)$", text, re.MULTILINE)
    ours = [line for line in lines if not line.startswith(LEFT) or "--platforms here" in line]
    assert len(ours) == RUN[name]
    for line in ours:
        words = shlex.split(line, comments=True)
        done = CliRunner().invoke(app, words) if words[0] != "build" else apart(words)
        assert done == 0 or done.exit_code == 0, (line, getattr(done, "output", ""))


def apart(words: list[str]) -> int:
    """Exit code of a command in a process of its own, in another folder than the FMUs of the other tests."""
    return subprocess.run([sys.executable, "-m", "gapsense.cli", *words, "--out", "mine"]).returncode
