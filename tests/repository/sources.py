"""The sources of the repository, as text and as syntax trees."""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path

import numpy as np
from scipy.sparse.csgraph import connected_components

ROOT = Path(__file__).resolve().parents[2]
SRC = ROOT / "src" / "gapsense"
FOLDERS = ("src", "fmus", "scenarios", "tests", "docs", "benchmarks", ".ci")
TEXT = (".py", ".md", ".toml", ".txt", ".csv", ".c", ".h", ".css", ".yml", ".yaml", "")
SCENARIOS = ROOT / "scenarios"  # the package `gapsense.scenarios`
PYTHON = sorted([*SRC.rglob("*.py"), *SCENARIOS.rglob("*.py")])
BUILD = ROOT / "build_fmus.py"
MODULES = [*(path for path in PYTHON if path != SRC / "__init__.py"), BUILD]
Function = ast.FunctionDef | ast.AsyncFunctionDef


def name_of(path: Path) -> str:
    """Path of a file as messages show it."""
    return path.relative_to(ROOT).as_posix()


@cache
def tree(path: Path) -> ast.Module:
    """Syntax tree of a Python file."""
    return ast.parse(path.read_text(encoding="utf-8"), str(path))


@cache
def nodes(path: Path) -> tuple[ast.AST, ...]:
    """All nodes of it."""
    return tuple(ast.walk(tree(path)))


@cache
def texts() -> tuple[Path, ...]:
    """All text files that belong to the repository; nothing that was built, cached or installed."""
    return (*_texts(),)


def _texts() -> Iterator[Path]:
    yield from (
        p
        for p in sorted(ROOT.iterdir())
        if p.is_file() and p.suffix in TEXT and p.name != ".git" and not p.name.startswith(".coverage")
    )
    for folder in FOLDERS:
        for path in sorted((ROOT / folder).rglob("*")):
            is_made = any(part == "__pycache__" or part.endswith(".egg-info") for part in path.parts)
            if path.suffix in TEXT and not is_made and path.is_file():
                yield path


def functions(path: Path) -> Iterator[tuple[str, Function]]:
    """Every function of a file, methods and inner ones too, with the place to show."""
    for node in nodes(path):
        if isinstance(node, Function):
            yield f"{name_of(path)}:{node.lineno} {node.name}", node


def public(path: Path) -> Iterator[tuple[str, ast.AST]]:
    """The module, its public classes and functions, and their public methods, each with the place to show."""
    yield name_of(path), tree(path)
    yield from _public(path, tree(path).body)


def _public(path: Path, body: list[ast.stmt]) -> Iterator[tuple[str, ast.AST]]:
    for node in body:
        if isinstance(node, (Function, ast.ClassDef)) and not node.name.startswith("_"):
            yield f"{name_of(path)}:{node.lineno} {node.name}", node
            if isinstance(node, ast.ClassDef):
                yield from _public(path, node.body)


def documented(docstring: str) -> list[str] | None:
    """Arguments in the Parameters section of a docstring, or None where there is no such section."""
    lines = docstring.splitlines()
    starts = [k for k, line in enumerate(lines[:-1]) if line == "Parameters" and set(lines[k + 1]) == {"-"}]
    if not starts:
        return None
    section = lines[starts[0] + 2 :]
    ends = [k for k, line in enumerate(section) if k and line and set(line) == {"-"}]
    entries = [line for line in section[: ends[0] - 1 if ends else None] if re.match(r"\*{0,2}\w", line)]
    return [name.strip(" *") for line in entries for name in line.partition(" : ")[0].split(",")]


def arguments(function: Function) -> list[str]:
    """Names of all arguments but `self` and `cls`."""
    a = function.args
    every = [*a.posonlyargs, *a.args, *([a.vararg] if a.vararg else []), *a.kwonlyargs, *([a.kwarg] if a.kwarg else [])]
    return [arg.arg for arg in every if arg.arg not in ("self", "cls")]


def part_of(path: Path) -> str:
    """The part that a file belongs to: a folder, a module at the top, the commands of studies, or build_fmus.py."""
    if path == BUILD:
        return path.stem
    if path.name == "study.py" and path.is_relative_to(SCENARIOS):
        return "command"
    return _part(name_parts(path)[1:])


def name_parts(path: Path) -> tuple[str, ...]:
    """Parts of the full name of a module of the package; those of scenarios/ are in `gapsense.scenarios`."""
    return ("gapsense", *path.relative_to(ROOT if path.is_relative_to(SCENARIOS) else SRC).with_suffix("").parts)


def _part(names: Sequence[str]) -> str:
    """A module of the foundations, `kernels`, `_os` and `fmi.ports`, is a part by itself: their order is held too."""
    is_foundation = names[0] in ("kernels", "_os") or tuple(names[:2]) == ("fmi", "ports")
    return names[1] if is_foundation and len(names) > 1 else names[0]


@cache
def imports(path: Path) -> list[tuple[str, int]]:
    """Full names that a file imports, wherever in it, with their lines."""
    package = name_parts(path)[:-1] if path != BUILD else ()
    found = []
    for node in nodes(path):
        if isinstance(node, ast.Import):
            found += [(alias.name, node.lineno) for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) + 1 - node.level] if node.level else ()
            module = ".".join((*base, *([node.module] if node.module else [])))
            found += [(f"{module}.{alias.name}", node.lineno) for alias in node.names]
    return found


@cache
def lists(path: Path) -> list[tuple[int, set[str]]]:
    """Texts of every list, tuple, set and dict (its keys) in a file, and the parts of the names that it imports."""
    found = []
    for node in nodes(path):
        if isinstance(node, (ast.List, ast.Tuple, ast.Set, ast.Dict)):
            entries = node.keys if isinstance(node, ast.Dict) else node.elts
            found.append((node.lineno, {str(e.value) for e in entries if isinstance(e, ast.Constant)}))
    return [*found, (1, {part for name, _ in imports(path) for part in name.split(".")})]


def circles() -> list[list[str]]:
    """Modules that import each other, in functions and under TYPE_CHECKING too.

    Whoever imports a module from a package needs the package as well.
    """
    names = {".".join(name_parts(path)).removesuffix(".__init__"): path for path in PYTHON}
    place = {name: k for k, name in enumerate(names)}
    graph = np.zeros((len(names), len(names)), dtype=bool)
    for name, path in names.items():
        for imported, _ in imports(path):
            for other in (imported, imported.rpartition(".")[0]):
                if other in place and other != name:
                    graph[place[name], place[other]] = True
    _, group = connected_components(graph, connection="strong")
    return [sorted(n for n in names if group[place[n]] == k) for k in set(group) if sum(group == k) > 1]


def ours(path: Path) -> Iterator[tuple[str, int]]:
    """Parts of the package that a file imports; the package itself, for its version, is free to all."""
    for name, line in imports(path):
        top, _, rest = name.partition(".")
        if top == "gapsense" and rest:
            yield _part(rest.split(".")), line


def others(path: Path) -> Iterator[tuple[str, int]]:
    """Packages of others that a file imports."""
    for name, line in imports(path):
        top = name.partition(".")[0]
        if top not in {"gapsense", "tomllib", *sys.stdlib_module_names}:  # tomllib: since Python 3.11
            yield top, line
