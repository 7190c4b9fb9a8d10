"""Each command that a page names, in a block or in the text, exists and has its options; those in blocks run too."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest
from sources import ROOT
from test_readme import PAGES, command

FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
PLACEHOLDER = re.compile(r"[A-Z]{2,}(\.\w+)?|\.\.\.|<.*>")


def commands(page: Path) -> list[list[str]]:
    """Words of each command of ours on a page: in blocks, and in the text."""
    text = page.read_text(encoding="utf-8")
    fenced = "".join(block for kind, block in FENCE.findall(text) if kind in ("sh", "console"))
    shown = re.findall(r"^(?:\$ )?(gapsense [a-z].*)$", fenced, re.MULTILINE)
    inline = re.findall(r"`(gapsense [a-z][^`\n]*)`", FENCE.sub("", text))
    found = [shlex.split(part, comments=True) for line in (*shown, *inline) for part in line.split("&&")]
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
        "# P\n\n```sh\ngapsense run a && gapsense test  # all\n```\n\n`gapsense check X` or `gapsense STUDY`\n\n"
        "```console\n$ gapsense list\ngapsense\n```\n\n```python\ngapsense = 1\n```\n",
        encoding="utf-8",
    )
    found = [" ".join(words) for words in commands(page)]
    assert sorted(found) == ["gapsense check X", "gapsense list", "gapsense run a", "gapsense test"]
    assert sum(len(commands(page)) for page in PAGES) > 100
