"""Sentences that pages quote are those of the programs: each part between `...` stands in some text of the sources."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest
from sources import PYTHON, ROOT, SRC, nodes

from gapsense.cosim.result.metrics import KINDS

PAGES = ("foreign-fmus", "import", "troubleshooting")
FENCE = re.compile(r"^```.*?^```$", re.MULTILINE | re.DOTALL)
GAP = "\0"  # stands for what a program puts in
LEAST = 8  # letters of the longest part of a quotation


def quoted(text: str) -> list[str]:
    """Quotations in a page, outside of blocks and of code that has quotation marks itself."""
    plain = re.sub(r"`([^`\n]*)`", lambda span: "" if '"' in span[1] else span[0], FENCE.sub("", text))
    return re.findall(r'"([^"\n]+)"', plain)


def python_texts(file: Path) -> Iterator[str]:
    """Texts of a Python file, but for what documents it."""
    said = {id(node.value) for node in nodes(file) if isinstance(node, ast.Expr)}
    for node in nodes(file):
        if isinstance(node, ast.JoinedStr):
            yield "".join(str(p.value) if isinstance(p, ast.Constant) else GAP for p in node.values)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in said:
            yield re.sub(r"%[.\d]*[a-z]", GAP, node.value)


def c_texts(text: str) -> Iterator[str]:
    """Texts of a C file, neighbours put together."""
    whole = re.sub(r'"\s*(\w*)\s*"', lambda found: GAP if found[1] else "", re.sub(r"%[.*\d]*[a-z]", GAP, text))
    yield from re.findall(r'"([^"\n]*)"', whole)


@cache
def texts() -> tuple[str, ...]:
    shim = [file.read_text(encoding="utf-8") for file in sorted((SRC / "fmi" / "shim").glob("*.[ch]"))]
    return tuple({*(t for file in PYTHON for t in python_texts(file)), *(t for c in shim for t in c_texts(c))})


def is_said(quotation: str) -> bool:
    """True if programs say this."""
    parts = [part.strip() for part in quotation.split("...")]
    return len(max(parts, key=len)) >= LEAST and all(any(part in text for text in texts()) for part in parts)


@pytest.mark.parametrize("name", PAGES)
def test_quotations_of_a_page_are_said_by_the_programs(name):
    found = quoted((ROOT / "docs" / f"{name}.md").read_text(encoding="utf-8"))
    assert found and [quotation for quotation in found if not is_said(quotation)] == []


def test_page_on_metrics_has_every_kind():
    rows = re.findall(r"^\| (`.+?`) \|", (ROOT / "docs" / "metrics.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert set(KINDS) <= {name for row in rows for name in re.findall(r"`(\w+)`", row)}


def test_what_nobody_says_is_found():
    assert quoted('| "its `x` is ... wrong" | `unit = "mA"` |\n\n```toml\na = "b"\n```\n') == ["its `x` is ... wrong"]
    assert is_said("output ... is not finite. Check the parameters") and is_said("This FMU needs Python 3... or newer")
    assert not is_said("the flux capacitor is empty") and not is_said("... ...")
