"""Sentences of pages are short: at most one in twenty has more than 35 words."""

from __future__ import annotations

import re

import pytest
from sources import ROOT

PAGES = [
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    *sorted((ROOT / "docs").glob("*.md")),
    *sorted((ROOT / "fmus").glob("*/page.md")),
]
LONG = 35  # words
SHARE = 0.05
FENCE = re.compile(r"^```.*?^```$|^<!--.*?-->$", re.MULTILINE | re.DOTALL)
NO_PROSE = re.compile(r"^(#|\||!\[|---)")
ITEM = re.compile(r"^\s*(?:[-*]|\d+\.)\s+")
END = re.compile(r"[.!?][)\"*]*\s+(?=[\"(*\[]*[A-Z0-9])")


def sentences(text: str) -> list[str]:
    """Sentences of the paragraphs and items of a page, without tables, headings and blocks; code counts as one word."""
    parts, part = [], ""
    for line in [*FENCE.sub("", text).splitlines(), ""]:
        is_prose = not NO_PROSE.match(line)
        if not line.strip() or ITEM.match(line) or not is_prose:
            parts.append(part)
            part = ""
        part += " " + ITEM.sub("", line).strip() if is_prose else ""
    plain = [re.sub(r"`[^`]*`", "CODE", re.sub(r"\]\([^)]*\)", "]", p)) for p in parts]
    return [s.strip() for p in plain for s in END.split(p) if len(s.split()) > 1]


def long_ones(text: str) -> list[str]:
    """Sentences of more than 35 words."""
    return [s for s in sentences(text) if len(s.split()) > LONG]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_sentences_of_a_page_are_short(page):
    text = page.read_text(encoding="utf-8")
    found = long_ones(text)
    assert len(found) <= SHARE * len(sentences(text)), "\n\n".join(found)


def test_sentences_are_told_apart_and_counted():
    text = "# A heading. Here\n\nOne ends. `Two` ends here, of 1.5 mm.\nThree\ngoes on.\n\n- Four\n- Five [is](x.md)\n"
    found = sentences(text + "\n| a | b |\n\n```sh\na b. C d\n```\n")
    assert found == ["One ends", "CODE ends here, of 1.5 mm", "Three goes on.", "Five [is]"]
    assert len(long_ones("word " * 36 + "ends. Then " + "word " * 34)) == 1
