"""A corpus of wrong scenarios, made of the format itself: each key of another type or value, misspelt, missing.

Each is refused with a sentence that names the key; nothing is raised but that, and nothing takes long.
"""

import copy
import time
from typing import Any, NamedTuple

import pytest
from test_every_number import WHOLE
from typer.testing import CliRunner

from gapsense.cli import app
from gapsense.cosim import check
from gapsense.cosim.scenario import keys
from gapsense.cosim.scenario.read import Document
from gapsense.tables import Section, parse_toml

MORE = """
[components.played]
fmu = "Gain"

[inputs.played.u]
file = "played.csv"
column = "y"

[variants.other]
description = "Another one"
"""
TEXTS = {  # keys that the scenario of numbers leaves out
    (): {"description": "d", "figure": "overview"},
    ("experiment",): {"method": "jacobi", "isolation": "none"},
    ("components", "lag"): {"parameters": [], "isolation": "none"},
    ("connections", 0): {"unit": "V", "delayed": False},
    ("events", "jump"): {"enabled": True, "description": "d"},
    ("events", "late", "when"): {"again": False},
    ("record",): {"signals": ["*"]},
    ("metrics", "error"): {"description": "d", "table": "t", "label": "l"},
    ("baseline",): {"file": "baseline.csv", "signals": ["*"]},
}
OF_TYPES = {  # values that are of another type than any key of these kinds takes
    "number": [True, "x", [1.0], {"a": 1}],
    "integer": [True, "x", 1.5, [1], {"a": 1}],
    "boolean": ["x", 1, [True], {"a": True}],
    "string": [True, 1, ["x"], {"a": "x"}, "a\0b"],
    "array": ["x", 1, True, {"a": 1}],
    "object": ["x", 1, True, [1]],
}


class Wrong(NamedTuple):
    """A scenario with one thing wrong at a place, and the key that must be named."""

    path: tuple[Any, ...]
    what: str
    value: Any = None  # of the key; None where it is removed or misspelt

    @property
    def name(self) -> str:
        return f"{'.'.join(map(str, self.path))}-{self.what}"


def whole() -> dict[str, Any]:
    """A scenario that says nearly everything there is to say."""
    data = parse_toml(WHOLE + MORE)
    assert data
    for path, own in TEXTS.items():
        inner: Any = data
        for key in path:
            inner = inner[key]
        inner.update(copy.deepcopy(own))
    return data


def walk(data: Any, section: Section, path: tuple[Any, ...] = ()) -> list[Wrong]:
    """Everything that can be wrong with one key of a table or of those below."""
    found = []
    for name, item in data.items():
        key = keys.key_of(section, name)
        assert key, (path, name)
        here = (*path, name)
        if key.is_dotted and isinstance(item, dict):  # the rest of a name comes first
            for rest, value in item.items():
                is_signal = isinstance(value, dict) and key.section is not None
                found += walk(value, key.section, (*here, rest)) if is_signal else []
            continue
        if key.section and isinstance(item, dict):
            found += walk(item, key.section, here)
        elif key.section and isinstance(item, list):
            found += [wrong for k, entry in enumerate(item) for wrong in walk(entry, key.section, (*here, k))]
        kind = key.kind.schema.get("type")
        if isinstance(kind, str):
            found += [Wrong(here, f"type {k}", value) for k, value in enumerate(OF_TYPES[kind])]
        if key.choices:
            found.append(Wrong(here, "choice", "nonsense"))
        if key.required:
            found.append(Wrong(here, "missing"))
        if key in section.keys and path[:1] != ("sweep",):
            found.append(Wrong(here, "misspelt"))
    return found


def changed(wrong: Wrong) -> dict[str, Any]:
    """The scenario with that."""
    data = whole()
    inner: Any = data
    for key in wrong.path[:-1]:
        inner = inner[key]
    last = wrong.path[-1]
    if wrong.what == "misspelt":
        inner[f"{last}x"] = inner.pop(last)
    elif wrong.what == "missing":
        del inner[last]
    else:
        inner[last] = wrong.value
    return data


CORPUS = walk(whole(), keys.FILE)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Where the files are that the scenario names."""
    folder = tmp_path_factory.mktemp("wrong")
    (folder / "played.csv").write_text("time,y\n0,1\n2,1\n")
    return folder


def test_corpus_is_large_and_its_scenario_is_good(folder, fmus):
    assert len(CORPUS) >= 235
    assert len({wrong.name for wrong in CORPUS}) == len(CORPUS)
    assert check(Document(folder / "scenario.toml", whole()), fmus=fmus) == []


@pytest.mark.parametrize("wrong", CORPUS, ids=lambda wrong: wrong.name)
def test_wrong_scenario_is_refused_and_the_key_named(folder, fmus, wrong):
    begin = time.monotonic()
    found = check(Document(folder / "scenario.toml", changed(wrong)), fmus=fmus)
    assert found and time.monotonic() - begin < 10.0
    told = [problem for problem in found if str(wrong.path[-1]) in problem]
    assert told, found
    assert all(problem.endswith((".", "?")) and "Traceback" not in problem for problem in found), found


@pytest.mark.parametrize("wrong", CORPUS[::24], ids=lambda wrong: wrong.name)
def test_command_ends_with_the_same_sentences(folder, fmus, wrong, tmp_path, monkeypatch):
    import tomli_w

    monkeypatch.chdir(tmp_path)
    file = folder / "scenario.toml"
    file.write_text(tomli_w.dumps(changed(wrong)), encoding="utf-8")
    found = check(file, fmus=fmus)
    for command in ("check", "run"):
        done = CliRunner().invoke(app, [command, str(file), "--fmus", str(fmus)])
        assert done.exit_code == 2 and isinstance(done.exception, SystemExit), done.output
        assert " ".join(found[0].split()) in " ".join(done.output.split())
    assert not (tmp_path / "results").exists()
