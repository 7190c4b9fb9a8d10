"""The table of keys is what the loader goes by: it knows no other key, and asks for every one."""

from __future__ import annotations

import sys
from collections.abc import Iterator

import pytest

from gapsense.cosim.scenario import read as load_sections
from gapsense.cosim.scenario.keys import FILE, SECTIONS
from gapsense.cosim.scenario.read import read_draft
from gapsense.cosim.scenario.records import Experiment, Tolerance
from gapsense.parameters import PARAMETER_SET, read_parameters
from gapsense.tables import TABLES, Key, Section, Table

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib


def sections(section: Section) -> Iterator[Section]:
    """A section and all below it."""
    yield section
    for key in (*section.keys, *filter(None, [section.free])):
        if key.section:
            yield from sections(key.section)


EVERY = [*sections(FILE), *sections(PARAMETER_SET)]


def keys() -> list[tuple[Section, Key]]:
    return [(section, key) for section in EVERY for key in (*section.keys, *filter(None, [section.free]))]


def values() -> list[tuple[Section, Key]]:
    return [(section, key) for section, key in keys() if key.section is None]


def example(key: Key) -> object:
    """Value of the example of a key."""
    line = key.example if key.name.startswith("<") else f"{key.name} = {key.example}"
    (value,) = tomllib.loads(line).values()
    return value


def name(item: tuple[Section, Key]) -> str:
    return f"{item[0].header}{item[1].name}"


@pytest.mark.parametrize("item", values(), ids=name)
def test_example_and_default_of_a_key_are_of_its_kind(item):
    _, key = item
    assert key.kind.accepts(example(key))
    assert not key.choices or example(key) in key.choices
    assert key.default is None or key.kind.accepts(key.default)
    assert key.name.startswith("<") or sum((key.default is not None, key.required, bool(key.otherwise))) == 1


@pytest.mark.parametrize(("name", "record"), [("experiment", Experiment(0.0, 1.0, 1.0, 1)), ("baseline", Tolerance())])
def test_defaults_of_the_table_are_those_of_the_record(name, record):
    told = {key.name: key.default for key in SECTIONS[name].keys if key.default is not None}
    made = {key: getattr(record, key) for key in told if hasattr(record, key)}
    assert made == {key: told[key] for key in made} and len(made) >= 3


def text_with(section: Section, lines: str) -> str:
    return f"{section.at or section.header}\n{lines}\n"


@pytest.mark.parametrize("section", [s for s in EVERY if s.keys], ids=lambda s: s.header or "file")
def test_loader_takes_every_key_of_a_section_and_no_other(section, tmp_path):
    """A misspelt key gets a sentence that offers the right one, so the loader has asked for it."""
    for key in section.keys:
        path = tmp_path / "scenario.toml"
        path.write_text(text_with(section, f"{key.name}x = {key.example or 1}\n"), encoding="utf-8")
        problems = read_draft(path).problems if section is not PARAMETER_SET else []
        if section is PARAMETER_SET:
            read_parameters(path, problems)
        if section.free is None and section.header[:9] != "[variants":
            assert any(f"{key.name}x: unknown key. Did you mean" in problem for problem in problems), problems


def test_loader_asks_for_nothing_that_the_table_lacks(write, monkeypatch):
    """Recorded while it reads a file that has every section."""
    asked: dict[str, set[str]] = {}
    finish = Table.finish

    def noting(table: Table) -> None:
        asked.setdefault(table.place, set()).update(table.asked)
        finish(table)

    monkeypatch.setattr(Table, "finish", noting)
    monkeypatch.setattr(load_sections, "read_rows", lambda *_: ())
    seen = {s.at or s.header: {key.name for key in s.keys} for s in sections(FILE)}
    text = "".join(text_with(s, "") for s in sections(FILE) if s.header)
    read_draft(write(text))
    known = {place.strip("[]").replace('"', ""): names for place, names in seen.items()}
    assert len(asked) > 6
    for place, names in asked.items():
        assert names <= known[place.replace("[0]", "")], place


def test_array_of_tables_is_the_only_list_of_sections():
    assert [key.name for _, key in keys() if key.kind is TABLES] == ["connections"]


def test_scenario_in_place_of_a_parameter_set_is_told_in_one_sentence(tmp_path):
    (tmp_path / "scenario.toml").write_text("[experiment]\nstop = 1\n[components.a]\nfmu = 'Ekf'\n", encoding="utf-8")
    found: list[str] = []
    assert read_parameters(tmp_path / "scenario.toml", found) == {}
    assert found == ["scenario.toml: it is a scenario. Name a parameter set, a file with a table `[values]`."]
