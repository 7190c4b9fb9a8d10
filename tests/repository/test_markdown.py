"""Lists and tables of the pages are lists and tables: Markdown of the site wants an empty line before them."""

from __future__ import annotations

import inspect
import re
from pathlib import Path
from typing import Any

import pytest
from sources import ROOT

import gapsense

markdown = pytest.importorskip("markdown")
yaml = pytest.importorskip("yaml")
pytest.importorskip("pymdownx")

PAGES = [ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md")), *sorted((ROOT / "fmus").glob("*/page.md"))]
CELL = re.compile(r"^# %% \[markdown\].*\n((?:#.*\n?)+)", re.MULTILINE)  # of an example
LINE = re.compile(r"^\s*(?:- |\d\. |\| )", re.MULTILINE)  # looks like one of either
RUN_ON = re.compile(r"<p>(?:[^<]|<(?!/p>))*?\n(?:- |\d\. |\| )")


@pytest.fixture(scope="module")
def extensions() -> tuple[list[str], dict[str, Any]]:
    """Names and options of the extensions of the site."""
    listed = yaml.safe_load((ROOT / "mkdocs.yml").read_text(encoding="utf-8"))["markdown_extensions"]
    named = [entry if isinstance(entry, dict) else {entry: {}} for entry in listed]
    options = {name: given for entry in named for name, given in entry.items()}
    return [*options], options


def run_on(text: str, extensions: tuple[list[str], dict[str, Any]]) -> list[str]:
    """Lists and tables that became a part of the paragraph before them."""
    if not LINE.search(text):
        return []
    html = markdown.markdown(text, extensions=extensions[0], extension_configs=extensions[1])
    return RUN_ON.findall(re.sub(r"<pre.*?</pre>", "", html, flags=re.DOTALL))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.parent.name if page.name == "page.md" else page.stem)
def test_lists_and_tables_of_a_page_are_lists_and_tables(page: Path, extensions: Any) -> None:
    assert run_on(page.read_text(encoding="utf-8"), extensions) == []


def test_lists_and_tables_of_examples_are_lists_and_tables(extensions: Any) -> None:
    for script in sorted((ROOT / "docs" / "examples").glob("*.py")):
        texts = [re.sub("^# ?", "", cell, flags=re.MULTILINE) for cell in CELL.findall(script.read_text("utf-8"))]
        assert texts and run_on("\n\n".join(texts), extensions) == [], script.name


def test_lists_in_docstrings_of_the_reference_are_lists(extensions: Any) -> None:
    names = re.findall(r"^::: gapsense\.(\w+)$", (ROOT / "docs" / "api.md").read_text(encoding="utf-8"), re.MULTILINE)
    shown = {name: getattr(gapsense, name) for name in names}
    shown |= {f"{name}.{k}": v for name, one in shown.items() for k, v in inspect.getmembers(one) if k[0] != "_"}
    assert len(names) > 10
    for name, one in shown.items():
        text = (inspect.getdoc(one) or "").partition("\nParameters\n---")[0]
        assert run_on(text, extensions) == [], name


@pytest.mark.parametrize("text", ["Words\n- item", "Words\n1. item", "- a\n\n    more\n    - b", "Words\n| a |\n| - |"])
def test_a_missing_empty_line_is_found(text: str, extensions: Any) -> None:
    assert run_on(text, extensions)
