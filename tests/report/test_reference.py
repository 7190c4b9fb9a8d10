"""The page and the JSON schema of scenario files are those of the table of keys, and say what the loader says."""

from __future__ import annotations

import json
import runpy
import sys
from pathlib import Path

import pytest
from jsonschema import Draft7Validator

from gapsense.cosim.scenario.read import read_draft
from gapsense.report.schema import schema, study_schema

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
SCENARIOS = sorted((ROOT / "scenarios").glob("*/scenario.toml"))
SCHEMA, STUDY_SCHEMA = schema(), study_schema()
MADE = runpy.run_path(str(DOCS / "reference.py"))
STUDIES = [file for file in (ROOT / "scenarios").glob("*/*.toml") if "scenario =" in file.read_text(encoding="utf-8")]
GOOD = """
title = "t"
experiment = { stop = 1.0, base_step = 0.1 }
components.a.fmu = "A"
"""


def errors(text: str) -> list[str]:
    return [error.message for error in Draft7Validator(SCHEMA).iter_errors(tomllib.loads(text))]


def test_pages_and_schemas_in_docs_are_current():
    """If not: `python docs/reference.py docs`."""
    made = MADE["made"](DOCS)
    assert {*made} == {"scenario-file.md", "campaigns.md", "commands.md", "scenario.schema.json", "study.schema.json"}
    for name, text in made.items():
        assert (DOCS / name).read_text(encoding="utf-8") == text, name
    assert json.loads(made["scenario.schema.json"]) == SCHEMA and json.loads(made["study.schema.json"]) == STUDY_SCHEMA
    studies, page = made["campaigns.md"], made["scenario-file.md"]
    assert "### `[[sample.factors]]`" in studies and "| `trajectories` |" not in studies
    assert "## At the top" in page and "| `loop_area` |" in page


def test_reference_is_written_again(tmp_path):
    names = ("scenario-file.md", "campaigns.md", "commands.md")
    for name in names:
        (tmp_path / name).write_text(f"head\n{MADE['BEGIN']}old\n{MADE['END']}tail\n", encoding="utf-8")
    MADE["write"](tmp_path)
    for name in names:
        page = (tmp_path / name).read_text(encoding="utf-8")
        assert page.startswith("head\n") and page.endswith("tail\n") and "old\n" not in page
    assert json.loads((tmp_path / "scenario.schema.json").read_text(encoding="utf-8")) == SCHEMA


def test_schema_is_one():
    Draft7Validator.check_schema(SCHEMA)
    Draft7Validator.check_schema(STUDY_SCHEMA)


def test_every_study_fits_its_schema_and_a_wrong_one_does_not():
    assert STUDIES
    for file in STUDIES:
        assert not [*Draft7Validator(STUDY_SCHEMA).iter_errors(tomllib.loads(file.read_text(encoding="utf-8")))], file
    for text in ("title = 1", "[sample]\ncount = 0", "[[ranges]]\nto = 1", '[grid]\n"a.b" = []', "[trajectories]"):
        study = {"title": "t", "scenario": "s", **tomllib.loads(text)}
        assert [*Draft7Validator(STUDY_SCHEMA).iter_errors(study)], text


@pytest.mark.parametrize("file", SCENARIOS, ids=lambda file: file.parent.name)
def test_every_scenario_fits_the_schema(file):
    assert errors(file.read_text(encoding="utf-8")) == []


RIGHT = [
    "[inputs]\na.b.c = 1\na.d = 'x'\na.e = true\n",
    "[inputs]\na.b = { times = [0, 1], values = [1, 2], interpolation = 'hold' }\n",
    '[connect]\n"a.b" = "c.d"\n[connect.e]\nf = "c.d"\n',
    '[sweep]\nrows = "r.csv"\n"a.b" = [2, true, "x"]\na.c.d = [1.0]\n',
    "[metrics.m]\nkind = 'mean'\nsignal = 'a.b'\nbounds = [-inf, 1]\nreference = 2\n",
    "[variants.v.components.b]\nstep = 2\n[variants.v.experiment]\nstop = 2\n",
    "[baseline.tolerances.'*']\natol = 1.0\n",
    "[components.b]\nfmu = 'B'\nset = { a = true, 'b.c' = 'x', b.d = 1 }\n",
]
WRONG = [
    "colour = 1",
    "title = 3",
    "experiment = 3",
    "[inputs]\na.b = [1]",
    "[inputs]\na.b = { times = [0, 1], values = ['x', 2] }",
    "[connect]\n'a.b' = 1",
    "[seeds]\na = 1.5",
    "[seeds]\na = -1",
    "[sweep]\n'a.b' = 1",
    "[sweep]\n'a.b' = []",
    "[sweep]\nrows = 1",
    "[record]\nsignals = 'x'",
    "[record]\ndecimation = 0",
    "[metrics.m]\nsignal = 'a.b'",
    "[metrics.m]\nkind = 'rms'\nsignal = 'a.b'",
    "[metrics.m]\nkind = 'mean'\nsignal = 'a.b'\nbounds = [1]",
    "[metrics.m]\nkind = 'mean'\nsignal = 'a.b'\nbound = [1, 2]",
    "[baseline]\nrtol = -1",
    "[baseline.tolerances.'*']\nctol = 1.0",
    "[components.b]\nstep = 1",
    "[components.b]\nfmu = 'B'\nstep = 0",
    "[components.b]\nfmu = 'B'\nset = { a = [1] }",
    "[components.'b.c']\nfmu = 'B'",
    "[variants.v]\nvariants = { w = {} }",
    "[variants.v.experiment]\nmethod = 'x'",
    "[[connections]]\nform = 'a.b'\nto = 'c.d'",
]


@pytest.mark.parametrize("text", RIGHT)
def test_schema_takes_what_the_loader_takes(text, write_good):
    document = write_good(text)
    assert errors(document.read_text(encoding="utf-8")) == []
    assert [problem for problem in read_draft(document).problems if "r.csv" not in problem] == []


@pytest.mark.parametrize("text", WRONG)
def test_schema_refuses_what_the_loader_refuses(text, write_good):
    document = write_good(text)
    assert errors(document.read_text(encoding="utf-8"))
    if not text.startswith("[variants.v.experiment]"):  # whose content is read when it is chosen
        assert read_draft(document).problems


@pytest.fixture
def write_good(tmp_path):
    def write(text: str) -> Path:
        path = tmp_path / "scenario.toml"
        good = GOOD
        for key in ("title = ", "experiment = "):
            if text.startswith(key):
                good = "\n".join(line for line in good.splitlines() if not line.startswith(key)) + "\n"
        head, table, rest = text.partition("[")
        path.write_text(head + good + table + rest + "\n", encoding="utf-8")
        return path

    return write


@pytest.mark.parametrize("text", ["", "title = 't'", "title = 't'\ncomponents = {}\nexperiment = { stop = 1 }"])
def test_schema_tells_what_is_missing(text):
    assert errors(text)
