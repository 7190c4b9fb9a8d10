"""Scenarios become packages that are valid, say everything, and come back with the same bits."""

from __future__ import annotations

import math
import zipfile
from pathlib import Path
from xml.etree.ElementTree import fromstring, tostring

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from packages import SCENARIO

from gapsense.cosim import check, run
from gapsense.cosim.fmu.descriptions import Variable
from gapsense.problems import InputError, ScenarioError
from gapsense.ssp.bring import bring
from gapsense.ssp.export import export, parameter_set, serialise, text_of
from gapsense.ssp.package import violations
from gapsense.ssp.values import parse_value
from gapsense.ssp.words import tag

EVERYTHING = """
title = "All that a scenario may say: <&>"
description = "two\\nlines"
[experiment]
start = -0.3
stop = 1.2
base_step = 0.1
[components.source]
fmu = "Source"
set = { slope = 0.1, inverted = true, shape = "<\\"&'\\n>", "table.file" = "table.csv" }
[components.lag]
fmu = "Lag"
step = 2
offset = 1
parameters = ["lag.toml"]
[components.gain]
fmu = "Gain"
[components.noise]
fmu = "Noise"
[components.other]
fmu = "Lag"
[components.types]
fmu = "Types"
[components.third]
fmu = "Lag"
[connect]
"lag.u" = "source.y"
"third.u" = "types.half"
[[connections]]
from = "lag.y"
to = "gain.u"
factor = 0.1
bias = -3.0
[[connections]]
from = "gain.y"
to = "other.u"
factor = 1.5
unit = "V"
delayed = true
mean = true
[inputs]
"types.label" = "n = "
"types.step" = { times = [-0.3, 0.35, 1.2], values = [1, 2, 5], interpolation = "hold" }
"types.is_on" = true
[events.kick]
target = "gain.u"
action = "bias"
value = 0.25
at = 0.2
[seeds]
noise = 7
[record]
signals = ["*.y", "types.*", "gain.u"]
decimation = 3
[metrics.end]
kind = "final"
signal = "gain.y"
bounds = [-100.0, 100.0]
[variants.steep]
components.source.set.slope = 0.7
"""


@pytest.fixture
def scenario(tmp_path) -> Path:
    """A scenario with all that there is."""
    folder = tmp_path / "all"
    folder.mkdir()
    (folder / "scenario.toml").write_text(EVERYTHING, encoding="utf-8")
    (folder / "table.csv").write_text("1,2\n")
    (folder / "lag.toml").write_text('[values]\n"time.constant" = 0.3\n')
    return folder


def members(path: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


@pytest.mark.parametrize("variant", [None, pytest.param("steep", marks=pytest.mark.slow)])
def test_all_comes_back_with_the_same_bits(scenario, stock, tmp_path, variant):
    assert check(scenario, fmus=stock) == []
    export(scenario, tmp_path / "a.ssp", variant, stock)
    bring(tmp_path / "a.ssp", tmp_path / "back")
    text = (tmp_path / "back" / "scenario.toml").read_text()
    assert '"third.u" = "types.half"' in text and "mean = true" in text  # units that are not told
    result, again = run(scenario, variant, stock), run(tmp_path / "back")
    assert result.signals.keys() == again.signals.keys()
    assert all(np.array_equal(result[name], again[name]) for name in result.signals)
    assert np.array_equal(result.times, again.times)
    assert {k: str(m) for k, m in result.metrics.items()} == {k: str(m) for k, m in again.metrics.items()}
    files = {"source.table.file"}
    assert {k: v for k, v in result.parameters.items() if k not in files} == {
        k: v for k, v in again.parameters.items() if k not in files
    }
    assert Path(again.parameters["source.table.file"]).read_text() == "1,2\n"
    assert result.events and result.events == again.events
    assert result.run.seeds == again.run.seeds and result.run.method == again.run.method
    assert again.run.title == "All that a scenario may say: <&>"


@pytest.mark.slow
def test_what_comes_back_goes_out_again_the_same(scenario, stock, tmp_path):
    export(scenario, tmp_path / "a.ssp", None, stock)
    bring(tmp_path / "a.ssp", tmp_path / "all_again" / "all")
    export(tmp_path / "all_again" / "all", tmp_path / "b.ssp")
    old, new = members(tmp_path / "a.ssp"), members(tmp_path / "b.ssp")
    assert old["resources/Lag.fmu"] == new["resources/Lag.fmu"]
    first, second = (fromstring(m["SystemStructure.ssd"]) for m in (old, new))
    for path in (f".//{tag('ssd:Connections')}", f".//{tag('ssd:Connectors')}"):
        assert [*map(sorted_text, first.iterfind(path))] == [*map(sorted_text, second.iterfind(path))]


def sorted_text(element) -> list[str]:
    return sorted(tostring(child, "unicode").strip() for child in element)


def test_a_scenario_gives_the_same_bytes_each_time(scenario, stock, tmp_path):
    for name in ("a.ssp", "b.ssp"):
        export(scenario, tmp_path / name, None, stock)
    assert (tmp_path / "a.ssp").read_bytes() == (tmp_path / "b.ssp").read_bytes()


def test_documents_are_valid_and_what_is_inline_too(scenario, stock, tmp_path):
    export(scenario, tmp_path / "a.ssp", None, stock)
    found = members(tmp_path / "a.ssp")
    assert violations(found["SystemStructure.ssd"], "ssd") == []
    assert violations(found["resources/parameters.ssv"], "ssv") == []
    sets = [*fromstring(found["SystemStructure.ssd"]).iter(tag("ssv:ParameterSet"))]
    assert len(sets) == 4
    assert [violations(tostring(one), "ssv") for one in sets] == [[]] * len(sets)


def test_the_schemas_see_what_is_wrong():
    assert "Element 'a': No matching global declaration" in violations(b"<a/>", "ssd")[0]
    assert violations(b"<a", "ssd")
    made = serialise(parameter_set("x", [])).replace(b'version="1.0" name', b'version="3.0" name')
    assert violations(made, "ssv")


def test_units_and_types_are_told(scenario, stock, tmp_path):
    export(scenario, tmp_path / "a.ssp", None, stock)
    root = fromstring(members(tmp_path / "a.ssp")["SystemStructure.ssd"])
    kinds = {
        (component.get("name"), connector.get("name")): (connector.get("kind"), connector[0].tag.rpartition("}")[2])
        for component in root.iter(tag("ssd:Component"))
        for connector in component.iter(tag("ssd:Connector"))
    }
    assert kinds["lag", "u"] == ("input", "Real") and kinds["types", "is_odd"] == ("output", "Boolean")
    assert ("types", "said") not in kinds and ("types", "label") not in kinds  # texts that are not connected
    units = {unit.get("name"): dict(unit[0].attrib) for unit in root.iter(tag("ssc:Unit"))}
    assert units["V"] == {"kg": "1", "m": "2", "s": "-3", "A": "-1"}


def test_what_others_do_not_see_is_told_in_one_sentence_each(scenario, stock, tmp_path):
    notes = export(scenario, tmp_path / "a.ssp", None, stock)
    for words in (
        "experiment.method",
        "step of `lag`",
        "offset of `lag`",
        "signals of `types.step`",
        "delay of `other.u`",
        "its other variants are left out",
        "conversion to `gain.u`, `other.u`",
        "`simulate_ssp` of fmpy sets no texts",
        "`table.csv` is in the package",
    ):
        assert sum(words in note for note in notes) == 1, words
    plain = tmp_path / "plain"
    plain.mkdir()
    (plain / "scenario.toml").write_text(SCENARIO)
    assert export(plain, tmp_path / "b.ssp", None, stock) == []


def test_enumerations_go_by_the_names_of_their_items(types, tmp_path):
    folder = tmp_path / "own"
    folder.mkdir()
    text = """
title = "Types"
[experiment]
stop = 0.5
base_step = 0.1
[components.a]
fmu = "Types2"
set = { law = "On", shift = -3, on = false, label = "x" }
[components.b]
fmu = "Types2"
[connect]
"b.mode" = "a.mode_out"
"b.flag" = "a.flag_out"
[inputs]
"a.mode" = 2
"a.flag" = true
"a.u" = 1.5
"a.text" = "t"
"a.n" = -2147483648
"b.u" = 0.1
"b.text" = ""
"b.n" = 3
"""
    (folder / "scenario.toml").write_text(text)
    notes = export(folder, tmp_path / "a.ssp", None, types)
    found = members(tmp_path / "a.ssp")
    assert b'<ssv:Enumeration value="Auto" />' in found["SystemStructure.ssd"]
    assert b'<ssc:Item name="Auto" value="2" />' in found["SystemStructure.ssd"]
    assert violations(found["SystemStructure.ssd"], "ssd") == []
    assert any("fmpy sets true in place of false" in note for note in notes)
    bring(tmp_path / "a.ssp", tmp_path / "back")
    result, again = run(folder, None, types), run(tmp_path / "back")
    assert all(np.array_equal(result[name], again[name]) for name in result.signals)
    assert result.parameters == again.parameters


def test_what_ssp_cannot_hold_is_refused_at_once_and_nothing_written(types, tmp_path):
    folder = tmp_path / "own"
    folder.mkdir()
    text = '[experiment]\nstop = 1.0\nbase_step = 0.5\n[components.a]\nfmu = "Types3"\nset = { label = "\\u0001" }\n'
    inputs = {"u": 0.0, "single": 0.0, "flag": "false", "text": '""', "mode": 1}
    inputs |= {f"n{sign}Int{bits}": 0 for sign in ("", "U") for bits in (8, 16, 32, 64)}
    listed = "".join(f'"a.{name}" = {value}\n' for name, value in inputs.items())
    (folder / "scenario.toml").write_text(f'title = "t"\n{text}[inputs]\n{listed}')
    with pytest.raises(ScenarioError) as caught:
        export(folder, tmp_path / "a.ssp", None, types)
    assert len(caught.value.problems) == 2
    assert "FMI 3.0" in caught.value.problems[0] and "XML cannot hold" in caught.value.problems[1]
    assert [file.name for file in tmp_path.iterdir()] == ["own"]
    with pytest.raises(InputError, match=r"ending \.ssp"):
        export(folder, tmp_path / "a.zip", None, types)


def test_two_files_of_one_name_are_both_in_the_package(stock, tmp_path):
    folder = tmp_path / "own"
    for place in ("a", "b"):
        (folder / place).mkdir(parents=True)
    (folder / "a" / "Part.fmu").write_bytes((stock / "Source.fmu").read_bytes())
    (folder / "b" / "Part.fmu").write_bytes((stock / "Lag.fmu").read_bytes())
    text = SCENARIO.replace('"Source"', '"a/Part.fmu"').replace('"Lag"', '"b/Part.fmu"')
    (folder / "scenario.toml").write_text(text)
    export(folder, tmp_path / "a.ssp", None, stock)
    assert {"resources/Part.fmu", "resources/Part_1.fmu"} <= members(tmp_path / "a.ssp").keys()
    bring(tmp_path / "a.ssp", tmp_path / "back")
    result, again = run(folder, None, stock), run(tmp_path / "back")
    assert all(np.array_equal(result[name], again[name]) for name in result.signals)


def variable(kind: str) -> Variable:
    return Variable("x", 0, kind, "parameter", None, None, None, 1.0, None)


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_numbers_come_back_with_the_same_bits(value):
    back = parse_value("Real", text_of(value, variable("Real")))
    assert back == value and math.copysign(1.0, back) == math.copysign(1.0, value)


@given(st.text(st.characters(exclude_categories=["Cs", "Cc"]) | st.sampled_from("\n\t<>&\"'")))
def test_texts_come_back(value):
    made = fromstring(serialise(parameter_set("set", [("x", variable("String"), value)])))
    assert parse_value("String", made.find(f".//{tag('ssv:String')}").get("value")) == value


@given(st.integers(-(2**31), 2**31 - 1), st.booleans())
def test_whole_numbers_and_switches_come_back(number, switch):
    assert parse_value("Integer", text_of(number, variable("Integer"))) == number
    assert parse_value("Boolean", text_of(switch, variable("Boolean"))) is switch
