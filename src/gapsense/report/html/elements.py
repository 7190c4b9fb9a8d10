"""Pieces of HTML. Every text is escaped here; `Markup` is what already is HTML."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape


class Markup(str):
    """HTML, which is not escaped again."""


Cell = str | Markup


def text(value: object) -> Markup:
    """Any text as HTML."""
    return value if isinstance(value, Markup) else Markup(escape(str(value), quote=True))


def element(tag: str, *content: Cell, **attributes: str) -> Markup:
    """An element; `of` stands for the attribute `class`, a low line in a name for a hyphen."""
    names = {"of": "class"}
    given = "".join(f' {names.get(n, n.replace("_", "-"))}="{text(value)}"' for n, value in attributes.items())
    return Markup(f"<{tag}{given}>{''.join(map(text, content))}</{tag}>")


def joined(parts: Iterable[Markup]) -> Markup:
    """Pieces one after the other."""
    return Markup("".join(parts))


def section(title: str, key: str, *content: Cell) -> Markup:
    """A part of the page under a heading."""
    if not any(content):
        return Markup("")
    return element("section", element("h3", title, id=key), *content, aria_labelledby=key)


def table(caption: str, heads: Sequence[str], rows: Iterable[Sequence[Cell]], texts: int = 1) -> Markup:
    """A table that is scrolled where it is too wide; after `texts` columns come numbers. Nothing without rows."""
    lines = [
        element("tr", *(cell("td", c, k, texts) if k else element("th", c, scope="row") for k, c in enumerate(row)))
        for row in rows
    ]
    if not lines:
        return Markup("")
    head = element("tr", *(cell("th", name, k, texts, scope="col") for k, name in enumerate(heads)))
    body = element("caption", caption), element("thead", head), element("tbody", *lines)
    return element("div", element("table", *body), of="wide", tabindex="0", role="group", aria_label=caption)


def cell(tag: str, content: Cell, place: int, texts: int, **attributes: str) -> Markup:
    """A cell of a table."""
    return element(tag, content, **({"of": "number"} if place >= texts else {}), **attributes)


def details(summary: str, *content: Cell) -> Markup:
    """What is shown when asked for, and in print."""
    return element("details", element("summary", summary), *content) if any(content) else Markup("")


def bar(share: float, kind: str = "") -> Markup:
    """A share of 1 as a bar; the number stands beside it."""
    width = f"{100 * min(max(share, 0.0), 1.0):.1f}"
    inner = Markup(f'<rect class="of {kind}" width="{width}" height="8"/>')
    return Markup(f'<svg class="bar" viewBox="0 0 100 8" preserveAspectRatio="none" aria-hidden="true">{inner}</svg>')
