"""The house style, as far as a program can see it."""

from __future__ import annotations

import ast
import re
from functools import cache

from sources import PYTHON, ROOT, SRC, Function, arguments, documented, functions, name_of, nodes, public, texts

CALLBACKS = {"slave.py"}  # its public methods are the callbacks of FMI 2.0
MACHINE = re.compile(r"(?<![\w.:/*-])(/(home|Users|root|work|mnt)/\w|/tmp/\w/|[A-Z]:\\+Users)")
UNFINISHED = re.compile(r"\b(TO" + r"DO|FIX" + r"ME|XX" + r"X)\b")


def test_everything_public_has_a_docstring():
    missing = [
        place
        for path in PYTHON
        for place, node in public(path)
        if not ast.get_docstring(node) and not (path.name in CALLBACKS and isinstance(node, Function))
    ]
    assert not missing


def test_parameters_sections_document_every_argument_and_no_other():
    wrong = []
    for path in PYTHON:
        for node in nodes(path):
            if isinstance(node, (Function, ast.ClassDef)):
                names = documented(ast.get_docstring(node) or "")
                owner = constructor(node) if isinstance(node, ast.ClassDef) else node
                if names is not None and names != (arguments(owner) if owner else []):
                    wrong.append(f"{name_of(path)}:{node.lineno} {node.name}: documented {', '.join(names)}")
    assert not wrong


def constructor(node: ast.ClassDef) -> Function | None:
    return next((n for n in node.body if isinstance(n, Function) and n.name == "__init__"), None)


def test_reader_of_parameters_sections_sees_all_of_them():
    text = "What.\n\nParameters\n----------\na : float\n    A, or b : none.\nb, c : int\n\nReturns\n-------\nd : float"
    assert documented(text) == ["a", "b", "c"]
    assert documented("What.\n\nReturns\n-------\nfloat") is None
    assert sum(documented(ast.get_docstring(f) or "") is not None for p in PYTHON for _, f in functions(p)) > 15


def test_records_of_five_fields_or_more_are_made_with_keywords():
    wrong = [
        f"{name_of(path)}:{node.lineno} {called(node)}"
        for path in PYTHON
        for node in nodes(path)
        if isinstance(node, ast.Call) and re.match("[A-Z][a-z]", called(node))
        if sum(not isinstance(argument, ast.Starred) for argument in node.args) >= 5
    ]
    assert not wrong


def called(node: ast.Call) -> str:
    """The last name of what is called."""
    return getattr(node.func, "attr", getattr(node.func, "id", ""))


def test_kernels_add_in_order():
    """Since Python 3.12 `sum` corrects the rounding of floats, which generated code does not: other bits."""
    kernels = [p for folder in ("actuators", "estimators", "drive", "sensor") for p in (SRC / folder).rglob("*.py")]
    wrong = [
        f"{name_of(path)}:{node.lineno} uses sum(), not linalg.total()"
        for path in (*(SRC / "kernels" / f"{name}.py" for name in ("linalg", "integrate", "elementary")), *kernels)
        for node in nodes(path)
        if isinstance(node, ast.Name) and node.id == "sum"
    ]
    assert len(kernels) > 20 and not wrong


def test_generated_code_is_compiled_in_one_place():
    calls = {
        name_of(path)
        for path in PYTHON
        for node in nodes(path)
        if isinstance(node, ast.Name) and node.id in ("exec", "eval", "compile")
    }
    assert calls == {"src/gapsense/kernels/emit/python.py"}


def test_no_file_knows_a_machine():
    wrong = [f"{name_of(p)}:{k}: {line.strip()[:80]}" for p, k, line in lines() if MACHINE.search(line)]
    assert not wrong


def test_no_binary_knows_a_machine():
    folders = (b"/ho" + b"me/", b"/wo" + b"rk/", b"/tm" + b"p/", b"/ro" + b"ot/")
    for path in SRC.rglob("*.so"):
        assert not [folder for folder in folders if folder in path.read_bytes()], name_of(path)


def test_nothing_is_left_unfinished():
    assert not [f"{name_of(p)}:{k}: {line.strip()[:80]}" for p, k, line in lines() if UNFINISHED.search(line)]


def test_indents_are_blanks_and_no_blanks_trail():
    wrong = [
        f"{name_of(p)}:{k}"
        for p, k, line in lines()
        if (p.name != "Makefile" and "\t" in line)
        or (p.suffix in (".py", ".toml", ".c", ".h") and line != line.rstrip())
    ]
    assert not wrong


def test_texts_end_with_one_line_end():
    kept = [p for p in texts() if p.suffix in (".py", ".md", ".toml", ".c", ".h")]
    assert not [name_of(p) for p in kept if p.stat().st_size and not re.search(r"[^\n]\n\Z", p.read_text("utf-8"))]
    assert len(kept) > 100
    assert ROOT / "README.md" in kept


@cache
def lines():
    """Path, number and content of every line of text."""
    return [
        (path, number, line)
        for path in texts()
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
    ]
