"""Packages of other tools become scenarios that run, or are refused with everything that is wrong."""

from __future__ import annotations

import stat
import zipfile
from pathlib import Path

import numpy as np
import packages
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from packages import (
    CHAIN,
    FMUS,
    binding,
    bindings,
    component,
    connectors,
    linear,
    link,
    packed,
    structure,
    system,
    values,
)

from gapsense.cosim import run
from gapsense.problems import InputError
from gapsense.ssp.bring import bring
from gapsense.ssp.units import BaseUnit, Line, conversion


@pytest.fixture
def brought(tmp_path, stock):
    """Imports a package of some system and runs it."""

    def brought(content: str, *names: str, folder: str = "mine", **more: str):
        ssd = content if content.startswith("<?xml") else structure(content)
        path = packed(tmp_path / f"{folder}.ssp", ssd, stock, *(names or FMUS), **more)
        return bring(path, tmp_path / folder), run(tmp_path / folder)

    return brought


def refused(tmp_path, stock, content: str, *names: str, **more: str) -> list[str]:
    """What is wrong with a package of which nothing is written."""
    ssd = content if content.startswith("<?xml") else structure(content)
    path = packed(tmp_path / "other.ssp", ssd, stock, *(names or FMUS), **more)
    with pytest.raises(InputError) as caught:
        bring(path, tmp_path / "mine")
    assert sorted(file.name for file in tmp_path.iterdir()) == ["other.ssp"]
    return caught.value.problems


@pytest.fixture
def expected(tmp_path, stock):
    """Signals of the same system as a scenario, changed by replacing pieces of its text."""

    def expected(*changes: tuple[str, str]):
        text = packages.SCENARIO
        for old, new in changes:
            assert old in text
            text = text.replace(old, new)
        (tmp_path / "own").mkdir(exist_ok=True)
        (tmp_path / "own" / "scenario.toml").write_text(text)
        return run(tmp_path / "own", fmus=stock)

    return expected


def same(result, reference, **names: str) -> bool:
    """Whether signals of two results are equal; names of components by those in the reference."""
    named = {name: names.get(name.partition(".")[0], name.partition(".")[0]) for name in reference.signals}
    mine = {name: f"{other}.{name.partition('.')[2]}" for name, other in named.items()}
    assert {*mine.values()} <= {*result.signals}
    return all(np.array_equal(result.signals[mine[name]], values) for name, values in reference.signals.items())


def test_a_package_runs_as_the_scenario_that_says_the_same(brought, expected):
    notes, result = brought(CHAIN)
    assert same(result, expected())
    assert result.run.method == "jacobi" and result.run.base_step == 0.1
    assert any("the coupling; `jacobi` is used" in note for note in notes)
    assert any("annotations of `org.openmodelica`" in note for note in notes)


def test_connections_have_no_direction_but_that_of_their_connectors(brought, expected):
    turned = CHAIN.replace(link("source.y", "lag.u"), link("lag.u", "source.y"))
    assert turned != CHAIN and same(brought(turned)[1], expected())


def nested(outer: str = "", inner: str = "", inside: str = "", more: str = "") -> str:
    """The lag in a system in a system; the gain of the last component is a parameter of the outermost."""
    deep = system(
        "deep",
        connectors(into="input", out="output", k="parameter"),
        inner,
        elements=component("lag", "Lag", connectors(u="input V", y="output V", time__constant="parameter s")),
        links=link(".into", "lag.u", more=more) + link("lag.y", ".out") + link(".k", "lag.time.constant"),
    )
    middle = system(
        "middle",
        connectors(into="input", out="output", k="parameter"),
        elements=deep,
        links=link(".into", "deep.into", inside) + link("deep.out", ".out") + link(".k", "deep.k"),
    )
    return system(
        "root",
        connectors(k="parameter", gain="parameter", level="input V"),
        outer,
        elements=component("source", "Source", connectors(y="output V"), bindings(binding(values(slope=2.0))))
        + middle
        + component("gain", "Gain", connectors(u="input V", gain="parameter")),
        links=link("source.y", "middle.into")
        + link("middle.out", "gain.u")
        + link(".k", "middle.k")
        + link(".gain", "gain.gain"),
        tail=packages.MASTER,
    )


def test_nested_systems_are_one_level(brought, expected):
    outer = bindings(binding(values(k=0.25, gain=3.0)))
    notes, result = brought(nested(outer))
    reference = expected(('fmu = "Lag"', 'fmu = "Lag"\nset = { "time.constant" = 0.25 }'))
    assert same(result, reference, lag="middle_deep_lag")
    assert "`middle.deep.lag` is called `middle_deep_lag`." in notes


def test_empty_names_of_elements_mean_the_system(brought, expected):
    text = nested(bindings(binding(values(k=0.5, gain=3.0)))).replace(
        ' startConnector="into"', ' startElement="" startConnector="into"'
    )
    assert same(brought(text)[1], expected(), lag="middle_deep_lag")


@pytest.mark.slow
def test_inner_values_hold_until_an_outer_one_is_given(brought, expected):
    half = expected(('fmu = "Lag"', 'fmu = "Lag"\nset = { "time.constant" = 0.5 }'), ("gain = 3.0", "gain = 2.0"))
    quarter = expected(('fmu = "Lag"', 'fmu = "Lag"\nset = { "time.constant" = 0.25 }'), ("gain = 3.0", "gain = 2.0"))
    inner = bindings(binding(values(k=0.5)))
    assert same(brought(nested("", inner), folder="a")[1], half, lag="middle_deep_lag")
    by_connector = bindings(binding(values(**{"middle__deep__k": 0.25})))
    assert same(brought(nested(by_connector, inner), folder="b")[1], quarter, lag="middle_deep_lag")
    by_prefix = bindings(binding(values(k=0.25), prefix="middle.deep."), binding(values(level=1.0)))
    notes, result = brought(nested(by_prefix, inner), folder="c")
    assert same(result, quarter, lag="middle_deep_lag")
    assert any("`level` is connected to no component" in note for note in notes)
    later = bindings(binding(values(k=0.75), prefix="middle.deep."), binding(values(**{"middle__deep__k": 0.25})))
    assert same(brought(nested(later), folder="d")[1], quarter, lag="middle_deep_lag")


def test_values_in_files_go_through_their_mapping(brought, expected):
    text = CHAIN.replace(bindings(binding(values(gain=3.0))), "").replace(
        "<ssd:Elements>",
        '<ssd:ParameterBindings><ssd:ParameterBinding source="resources/set.ssv"><ssd:ParameterMapping '
        'source="resources/set.ssm"/></ssd:ParameterBinding></ssd:ParameterBindings><ssd:Elements>',
        1,
    )
    mapping = (
        '<ssm:ParameterMapping version="1.0"><ssm:MappingEntry source="a" target="gain.gain">'
        + linear(2.0, -1.0)
        + '</ssm:MappingEntry><ssm:MappingEntry source="b" target="lag.time.constant"/></ssm:ParameterMapping>'
    )
    notes, result = brought(text, set__ssv=values(a=2.0, b=0.25, c=9.0), set__ssm=mapping)
    assert same(result, expected(('fmu = "Lag"', 'fmu = "Lag"\nset = { "time.constant" = 0.25 }')))
    assert any("parameter `c` is in no entry of its mapping" in note for note in notes)


def test_a_file_of_values_may_be_that_of_several_components(brought, expected):
    shared = '<ssd:ParameterBindings><ssd:ParameterBinding source="resources/set.ssv"/></ssd:ParameterBindings>'
    text = CHAIN.replace(bindings(binding(values(gain=3.0))), shared)
    text = text.replace(bindings(binding(values(slope=2.0))), shared)
    notes, result = brought(text, set__ssv=values(gain=3.0, slope=2.0))
    assert same(result, expected()) and not any("schema" in note for note in notes)


@pytest.mark.parametrize(
    ("inside", "more", "factor", "bias"),
    [(linear(2.0, 1.0), "", 2.0, 1.0), (linear(-0.5), "", -0.5, 0.0), ("", 'suppressUnitConversion="true"', 1.0, 0.0)],
)
def test_transformations_of_connections(brought, expected, inside, more, factor, bias):
    text = CHAIN.replace(link("source.y", "lag.u"), link("source.y", "lag.u", inside, more))
    converts = f'[[connections]]\nfrom = "source.y"\nto = "lag.u"\nfactor = {factor}\nbias = {bias}\n'
    own = packages.SCENARIO.replace('"lag.u" = "source.y"\n', "") + converts
    assert same(brought(text)[1], expected((packages.SCENARIO, own)))


def through(unit: str, inside: str = "", more: str = "") -> str:
    """The source's volts go through a system's connector in another unit."""
    inner = system(
        "inner",
        connectors(into=f"input {unit}"),
        elements=component("lag", "Lag", connectors(u="input V", y="output V")),
        links=link(".into", "lag.u", inside, more),
    )
    return system(
        "root",
        elements=component("source", "Source", connectors(y="output V"), bindings(binding(values(slope=2.0)))) + inner,
        links=link("source.y", "inner.into"),
        tail=packages.MASTER,
    )


@pytest.mark.parametrize(
    ("unit", "inside", "more", "line"),
    [
        ("mV", "", "", lambda v: v),
        ("mV", "", 'suppressUnitConversion="true"', lambda v: 1000.0 * v),
        ("mV", linear(3.0, 1.0), "", lambda v: 3.0 * v + 1.0),  # after the conversion of the unit
        ("odd", "", "", lambda v: v),
        ("odd", "", 'suppressUnitConversion="1"', lambda v: (v - 10.0) / 2.0),
        ("odd", linear(2.0), 'suppressUnitConversion="true"', lambda v: v - 10.0),
    ],
)
def test_units_are_converted_on_the_way_before_transformations(brought, unit, inside, more, line):
    result = brought(through(unit, inside, more), "Source", "Lag")[1]
    # with jacobi a row shows the input of the step that begins there
    assert np.allclose(result["inner_lag.u"], line(result["source.y"]), rtol=1e-14, atol=1e-14)


def test_values_are_converted_to_the_unit_of_the_variable(brought):
    millivolts = '<ssv:Real value="1500.0" unit="mV"/>'
    text = CHAIN.replace(binding(values(slope=2.0)), binding(values(level=millivolts)))
    assert brought(text)[1].parameters["source.level"] == 1.5
    shifted = CHAIN.replace(binding(values(slope=2.0)), binding(values(level='<ssv:Real value="3.0" unit="odd"/>')))
    assert brought(shifted, folder="b")[1].parameters["source.level"] == 16.0


@given(st.floats(0.01, 100.0), st.floats(-10, 10), st.floats(0.01, 100.0), st.floats(-10, 10), st.floats(-1e3, 1e3))
def test_conversion_is_that_through_base_units(factor, offset, other_factor, other_offset, value):
    units = {"a": BaseUnit((1,), factor, offset), "b": BaseUnit((1,), other_factor, other_offset), "c": BaseUnit((2,))}
    found = conversion("a", "b", units)
    assert found.of(value) * other_factor + other_offset == pytest.approx(factor * value + offset, rel=1e-9, abs=1e-9)
    back = found.then(conversion("b", "a", units))
    assert back.of(value) == pytest.approx(value, rel=1e-9, abs=1e-6)
    assert conversion("a", "c", units) is None and conversion("a", "x", units) is None
    assert conversion("x", "x", units) == Line()


def test_osp_annotations_tell_steps(brought):
    osp = '<ssd:Annotations><ssc:Annotation type="com.opensimulationplatform">{}</ssc:Annotation></ssd:Annotations>'
    hint = osp.format('<osp:StepSizeHint value="{}"/>')
    text = CHAIN.replace(packages.MASTER, "")
    text = text.replace(
        connectors(u="input V", y="output V"), connectors(u="input V", y="output V") + hint.format("0.1")
    )
    text = structure(text).replace(
        '<ssd:DefaultExperiment stopTime="1.0"/>',
        '<ssd:DefaultExperiment stopTime="1.0">'
        + osp.format('<osp:Algorithm><osp:FixedStepAlgorithm baseStepSize="0.05"/></osp:Algorithm>')
        + "</ssd:DefaultExperiment>",
    )
    result = brought(text)[1]
    assert result.run.base_step == 0.05
    assert {name: c["step"] for name, c in result.run.components.items()} == {"source": 1, "lag": 2, "gain": 1}
    notes, result = brought(text.replace('value="0.1"', 'value="0.07"'), folder="b")
    assert any("its step of 0.07 s is not a multiple" in note for note in notes)


def test_options_tell_what_the_package_does_not(tmp_path, stock):
    path = packed(tmp_path / "a.ssp", structure(CHAIN.replace(packages.MASTER, ""), ""), stock, *FMUS)
    with pytest.raises(InputError) as caught:
        bring(path, tmp_path / "mine")
    assert [problem.rpartition(" ")[2] for problem in caught.value.problems] == ["`--stop`.", "`--step`."]
    bring(path, tmp_path / "mine", base_step=0.25, stop=2.0, method="gauss-seidel")
    result = run(tmp_path / "mine")
    assert (result.run.base_step, result.run.stop, result.run.method) == (0.25, 2.0, "gauss-seidel")


def test_names_that_a_scenario_may_not_have_are_changed(brought):
    text = CHAIN.replace('"source"', '"the source"').replace('"lag"', '"2.lag"').replace('"gain"', '"the_source"')
    text = text.replace('<ssv:Parameter name="the_source">', '<ssv:Parameter name="gain">')
    notes, result = brought(text)
    assert list(result.run.components) == ["the_source", "c_2_lag", "the_source_1"]
    assert "`the source` is called `the_source`." in notes


def test_inputs_that_nothing_drives_keep_their_start_values(brought):
    notes, result = brought(CHAIN.replace(link("source.y", "lag.u"), ""))
    assert (result["lag.u"] == 0.0).all()
    assert any(note.startswith("nothing drives `lag.u`") for note in notes)


def test_what_is_not_as_the_schema_says_is_told_and_read_all_the_same(brought, expected):
    notes, result = brought(CHAIN.replace('<ssd:System name="chain">', '<ssd:System name="chain"><ssd:Connectors/>'))
    assert same(result, expected())
    assert any("SystemStructure.ssd is not as the schema says: line " in note for note in notes)


GEOMETRY = '<ssd:{}Geometry x="0.0" y="0.5"/>'
OLD = """<ssd:Annotations><ssc:Annotation type="org.openmodelica"><oms:SimulationInformation>
<oms:FixedStepMaster description="oms-ma" stepSize="0.100000"/></oms:SimulationInformation></ssc:Annotation>
<ssc:Annotation type="org.openmodelica"><oms:Bus name="bus"><oms:Signal name="y"/></oms:Bus></ssc:Annotation>
</ssd:Annotations><ssd:Connectors />"""


def test_the_dialect_of_omsimulator(brought, expected):
    """Annotations first, empty connectors, geometry, empty names of elements, values of a system in a file."""
    text = CHAIN.replace(packages.MASTER, "").replace('<ssd:System name="chain">', '<ssd:System name="chain">' + OLD)
    text = text.replace("</ssd:Connector>", GEOMETRY.format("Connector") + "</ssd:Connector>")
    text = text.replace("</ssd:Connection>", '<ssd:ConnectionGeometry pointsX="0.1" pointsY="0.2"/></ssd:Connection>')
    text = text.replace(bindings(binding(values(gain=3.0))), "").replace(bindings(binding(values(slope=2.0))), "")
    of_system = '<ssd:ParameterBindings><ssd:ParameterBinding source="resources/chain.ssv"/></ssd:ParameterBindings>'
    text = text.replace("<ssd:Elements>", of_system + "<ssd:Elements>", 1)
    ssd = structure(text, 'startTime="0.000000" stopTime="1.000000"', "")
    notes, result = brought(ssd, chain__ssv=values(gain__gain=3.0, source__slope=2.0))
    assert same(result, expected())
    assert any("not as the schema says" in note for note in notes)


REFUSALS = {
    "dictionary": (
        "<ssd:Elements>",
        '<ssd:Elements><ssd:SignalDictionaryReference name="bus" dictionary="d"/>',
        "`bus` is a signal dictionary, which is not supported",
    ),
    "nested package": ('resources/Lag.fmu" ', 'resources/Lag.fmu" type="application/x-ssp-package"', "x-ssp-package"),
    "model exchange": ('resources/Lag.fmu" ', 'resources/Lag.fmu" implementation="ModelExchange"', "ModelExchange"),
    "no file": ("resources/Lag.fmu", "resources/Lagg.fmu", "there is no `resources/Lagg.fmu` in the package"),
    "elsewhere": ("resources/Lag.fmu", "../Lag.fmu", "there is no `../Lag.fmu` in the package"),
    "absolute": ("resources/Lag.fmu", "/etc/passwd", "outside the package"),
    "web": ("resources/Lag.fmu", "https://example.org/Lag.fmu", "outside the package"),
    "no FMU": ("resources/Lag.fmu", "SystemStructure.ssd", "cannot be used"),
    "kind": ('name="u" kind="input"', 'name="u" kind="inout"', "is of kind inout"),
    "unknown connector": (
        'startConnector="y" endElement="lag"',
        'startConnector="z" endElement="lag"',
        "no such connector",
    ),
    "two outputs": (
        'endElement="gain" endConnector="u"',
        'endElement="gain" endConnector="y"',
        "both ends give a value",
    ),
    "twice": (link("lag.y", "gain.u"), link("lag.y", "gain.u") + link("source.y", "gain.u"), "connected twice"),
    "mapping": (
        link("lag.y", "gain.u"),
        link(
            "lag.y",
            "gain.u",
            '<ssc:BooleanMappingTransformation><ssc:MapEntry source="true" target="false"/>'
            "</ssc:BooleanMappingTransformation>",
        ),
        "BooleanMappingTransformation` is not supported",
    ),
    "parameter": ('<ssv:Parameter name="slope">', '<ssv:Parameter name="slop">', "Did you mean `slope`?"),
    "no number": ('<ssv:Real value="2.0"/>', '<ssv:Real value="two"/>', "ssv:Real `two` found"),
    "infinite": ('<ssv:Real value="2.0"/>', '<ssv:Real value="INF"/>', "ssv:Real `INF` found"),
    "binary": ('<ssv:Real value="2.0"/>', '<ssv:Binary value="00"/>', "ssv:Binary `00` found"),
    "type": ('<ssv:Real value="2.0"/>', '<ssv:String value="x"/>', "a value of type Real is expected"),
    "file": (
        "<ssd:ParameterBinding>",
        '<ssd:ParameterBinding source="resources/x.ssv">',
        "there is no `resources/x.ssv`",
    ),
    "format": ("<ssd:ParameterBinding>", '<ssd:ParameterBinding type="text/csv">', "it is of type `text/csv`"),
    "base": (
        "<ssd:ParameterBinding>",
        '<ssd:ParameterBinding source="x.ssv" sourceBase="component">',
        "is in the component",
    ),
    "unit": ('<ssv:Real value="2.0"/>', '<ssv:Real value="2.0" unit="A"/>', "there is no conversion"),
    "variable": ('name="u" kind="input"', 'name="w" kind="input"', "no such connector"),
    "version": ('name="other" version="1.0">', 'name="other" version="2.0">', "it is of SSP `2.0`"),
    "whole": ('stepSize="0.100000"', 'stepSize="0.3"', "a whole number of at least 1 expected"),
    "algebraic": (
        link("lag.y", "gain.u"),
        link("gain.y", "gain.u", linear(1.0), 'suppressUnitConversion="true"'),
        "algebraic loop",
    ),
}


@pytest.mark.parametrize("name", REFUSALS)
def test_what_is_not_supported_is_refused_by_name_and_nothing_written(tmp_path, stock, name):
    old, new, words = REFUSALS[name]
    text = structure(CHAIN)
    assert old in text
    found = refused(tmp_path, stock, text.replace(old, new))
    assert any(words in problem for problem in found), found


def test_everything_that_is_wrong_is_told_at_once(tmp_path, stock):
    text = structure(CHAIN, "", "")
    for name in ("dictionary", "no file", "kind", "parameter", "no number"):
        text = text.replace(*REFUSALS[name][:2])
    found = refused(tmp_path, stock, text.replace('stepSize="0.100000"', ""))
    for words in ("signal dictionary", "Lagg", "inout", "`two`", "--stop", "--step"):
        assert any(words in problem for problem in found), words


def test_a_folder_that_is_there_is_kept(tmp_path, stock):
    path = packed(tmp_path / "a.ssp", structure(CHAIN), stock, *FMUS)
    (tmp_path / "mine").mkdir()
    with pytest.raises(InputError, match="exists already"):
        bring(path, tmp_path / "mine")


def archive(path: Path, *members: tuple[str, bytes] | zipfile.ZipInfo, **options) -> Path:
    with zipfile.ZipFile(path, "w", **options) as file:
        for name, content in members:
            file.writestr(name, content)
    return path


LINK = zipfile.ZipInfo("resources/link")
LINK.external_attr = (stat.S_IFLNK | 0o777) << 16
SSD = ("SystemStructure.ssd", structure(CHAIN).encode())
BOMB = '<!DOCTYPE x [<!ENTITY a "aaaaaaaaaa">]><x>&a;</x>'
MALICIOUS = {
    "outside": ((SSD, ("../evil.txt", b"x")), "outside its folder"),
    "absolute": ((SSD, ("/evil.txt", b"x")), "outside its folder"),
    "backslash": ((SSD, ("resources\\..\\evil", b"x")), "backslash"),
    "twice": ((SSD, (SSD[0], SSD[1] + b" ")), "is there twice"),
    "link": ((SSD, (LINK, b"/etc/passwd")), "is a link"),
    "file and folder": ((SSD, ("resources", b"x"), ("resources/a.fmu", b"x")), "a file and a folder"),
    "empty": ((("readme.txt", b"x"),), "has no SystemStructure.ssd"),
    "document type": ((("SystemStructure.ssd", BOMB.encode()),), "document type"),
    "no XML": ((("SystemStructure.ssd", b"<ssd:"),), "is not XML"),
    "encoding": ((("SystemStructure.ssd", b'<?xml version="1.0" encoding="utf-7"?><a/>'),), "UTF-8 is expected"),
    "other XML": ((("SystemStructure.ssd", b"<a/>"),), "a system of SSP 1.0 is expected"),
}


@pytest.mark.filterwarnings("ignore:Duplicate name")
@pytest.mark.parametrize("name", MALICIOUS)
def test_archives_of_strangers_are_not_trusted(tmp_path, name):
    members, words = MALICIOUS[name]
    path = archive(tmp_path / "a.ssp", *members)
    with pytest.raises(InputError, match=words):
        bring(path, tmp_path / "mine")
    assert [file.name for file in tmp_path.iterdir()] == ["a.ssp"]


def test_a_zip_bomb_is_refused_before_it_is_unpacked(tmp_path, monkeypatch):
    monkeypatch.setattr("gapsense.cosim.fmu.archive.SMALL_CONTENT", 10**6)
    path = archive(tmp_path / "a.ssp", SSD, ("resources/a.fmu", bytes(2 * 10**6)), compression=zipfile.ZIP_DEFLATED)
    with pytest.raises(InputError, match="times its size"):
        bring(path, tmp_path / "mine")


@pytest.mark.parametrize("content", [b"", b"PK\x05\x06", b"no archive"])
def test_what_is_no_archive_is_refused(tmp_path, content):
    path = tmp_path / "a.ssp"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"not a readable package|no SystemStructure"):
        bring(path, tmp_path / "mine")


def test_systems_are_not_nested_without_end(tmp_path, stock):
    content = ""
    for _ in range(200):
        content = system("s", elements=content or component("lag", "Lag"))
    assert "nested more than 50 deep" in refused(tmp_path, stock, content)[0]


def test_what_a_kill_left_is_no_obstacle(tmp_path, stock):
    (tmp_path / ".mine.part" / "fmus").mkdir(parents=True)
    bring(packed(tmp_path / "a.ssp", structure(CHAIN), stock, *FMUS), tmp_path / "mine")
    assert sorted(file.name for file in tmp_path.iterdir()) == ["a.ssp", "mine"]


def test_a_damaged_archive_is_refused(tmp_path, stock):
    path = packed(tmp_path / "a.ssp", structure(CHAIN), stock, *FMUS)
    content = bytearray(path.read_bytes())
    content[200:400] = bytes(200)
    path.write_bytes(content)
    with pytest.raises(InputError):
        bring(path, tmp_path / "mine")
    assert [file.name for file in tmp_path.iterdir()] == ["a.ssp"]


def test_a_member_that_nobody_reads_may_not_be_damaged_either(tmp_path, stock):
    path = packed(tmp_path / "a.ssp", structure(CHAIN), stock, *FMUS)
    with zipfile.ZipFile(path, "a", zipfile.ZIP_STORED) as archive:
        archive.writestr("documentation/readme.txt", "what it is")
    path.write_bytes(path.read_bytes().replace(b"what it is", b"what it if"))
    with pytest.raises(InputError, match=r"its member `documentation/readme\.txt` is damaged"):
        bring(path, tmp_path / "mine")


@pytest.mark.slow
@settings(max_examples=100)
@given(st.data())
def test_damaged_descriptions_are_refused_or_read_but_never_half_written(tmp_path_factory, stock, data):
    """Pieces of the description are cut out or doubled: whatever comes of it, it is told in sentences."""
    folder, text = tmp_path_factory.mktemp("fuzz"), structure(CHAIN)
    for _ in range(data.draw(st.integers(1, 3))):
        begin = data.draw(st.integers(0, len(text)))
        end = data.draw(st.integers(begin, min(len(text), begin + 80)))
        text = text[:begin] + text[begin:end] * data.draw(st.sampled_from([0, 2])) + text[end:]
    try:
        bring(packed(folder / "a.ssp", text, stock, *FMUS), folder / "mine")
    except InputError as error:
        assert all(len(problem) > 10 for problem in error.problems)
        assert [file.name for file in folder.iterdir()] == ["a.ssp"]
    else:
        assert (folder / "mine" / "scenario.toml").is_file()
