"""Examples as scripts in cells: run, made into a page with what they print and draw, and into a notebook."""

from __future__ import annotations

import ast
import contextlib
import io
import json
import os
import pickle
import re
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from kept import kept

MARK = re.compile(r"^# %%(?: \[(markdown)\])?.*\n", re.MULTILINE)


class Cell(NamedTuple):
    """A part of a script: text in Markdown, or code."""

    is_text: bool
    source: str


class Ran(NamedTuple):
    """What a cell printed, with the value of its last line, and the picture that this is."""

    printed: str
    picture: bytes | None


def cells(script: str) -> list[Cell]:
    """Cells of a script in percent format."""
    _, *parts = MARK.split(script)
    made = []
    for kind, source in zip(parts[::2], parts[1::2]):
        text = re.sub(r"^# ?", "", source, flags=re.MULTILINE) if kind else source
        made.append(Cell(kind is not None, text.strip()))
    return made


def shown(script: Path) -> list[tuple[Cell, Ran]]:
    """Cells of a script that was run."""
    parts = cells(script.read_text(encoding="utf-8"))

    def make(file: Path) -> None:
        """Run the cells and keep what they showed."""
        with elsewhere():
            done = [tuple(ran) for _, ran in run(parts)]
        file.write_bytes(pickle.dumps(done))

    done = pickle.loads(kept(f"examples/{script.stem}.pickle", make).read_bytes())
    return [(part, Ran(*ran)) for part, ran in zip(parts, done)]


def run(parts: list[Cell]) -> Iterator[tuple[Cell, Ran]]:
    """Run the code of a script, cell by cell, in the working folder, as a notebook does."""
    names: dict[str, Any] = {"__name__": "example"}
    for part in parts:
        yield part, Ran("", None) if part.is_text else ran(part.source, names)


def ran(source: str, names: dict[str, Any]) -> Ran:
    """Run one cell."""
    tree = ast.parse(source)
    last = tree.body.pop() if tree.body and isinstance(tree.body[-1], ast.Expr) else None
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        exec(compile(tree, "<cell>", "exec"), names)
        value = eval(compile(ast.Expression(last.value), "<cell>", "eval"), names) if last else None
        picture = png(value) if hasattr(value, "savefig") else None
        if value is not None and picture is None:
            print(value)
    return Ran(printed.getvalue().rstrip(), picture)


def png(figure: Any) -> bytes:
    """A figure, as a notebook shows it."""
    file = io.BytesIO()
    figure.savefig(file, format="png", dpi=120)
    return file.getvalue()


def page(name: str, done: list[tuple[Cell, Ran]]) -> str:
    """Markdown of a script that was run; its pictures are `NAME_K.png`, beside the page."""
    parts = []
    for k, (cell, made) in enumerate(done):
        parts.append(cell.source if cell.is_text else f"```python\n{cell.source}\n```")
        if made.printed:
            parts.append(f"```text\n{made.printed}\n```")
        if made.picture:
            parts.append(f"![Figure of the cell above]({name}_{k}.png)")
    title, *rest = parts
    head, _, intro = title.partition("\n")
    links = f"Download: [notebook]({name}.ipynb), [script]({name}.py)."
    return "\n\n".join([head, intro.strip(), links, *rest]) + "\n"


def notebook(parts: list[Cell]) -> str:
    """The script as a notebook of Jupyter, without outputs."""
    made = [
        {
            "id": f"cell-{k}",
            "cell_type": "markdown" if part.is_text else "code",
            "metadata": {},
            "source": part.source.splitlines(keepends=True),
            **({} if part.is_text else {"execution_count": None, "outputs": []}),
        }
        for k, part in enumerate(parts)
    ]
    kernel = {"kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"}}
    return json.dumps({"cells": made, "metadata": kernel, "nbformat": 4, "nbformat_minor": 5}, indent=1) + "\n"


@contextlib.contextmanager
def elsewhere() -> Iterator[None]:
    """An empty working folder, for what a script writes."""
    before = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            yield
        finally:
            os.chdir(before)
