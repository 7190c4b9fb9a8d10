"""FMUs of others: variables of all types, FMI 2.0 and 3.0, written in C; and as pythonfmu makes them."""

import zipfile

import numpy as np
import pytest

from gapsense.cosim import FmuError, Master, check, prepare, run, run_once
from gapsense.cosim.fmu.archive import UnusableError
from gapsense.cosim.fmu.descriptions import describe
from gapsense.cosim.scenario.records import Port

WHOLES = {2: ["n"], 3: [f"n{sign}Int{bits}" for bits in (8, 16, 32, 64) for sign in ("", "U")]}
HEAD = 'title = "Types"\n[experiment]\nstop = 0.5\nbase_step = 0.1\n'
WIRED = """
[components.a]
fmu = "{a}"
set = {{ gain = 3.0, label = "a", shift = 2, law = "On", level = 4.0{more} }}
[components.b]
fmu = "{b}"
set = {{ label = "b", law = 3, on = true }}
[connect]
"b.u" = "a.flag_out"
"b.flag" = "a.flag_out"
"b.text" = "a.text_out"
"b.mode" = "a.mode_out"
{connect}
[inputs]
"a.u" = 2.0
"a.flag" = false
"a.text" = "é"
"a.mode" = "Auto"
{inputs}
"""


def wired(a, b, more=""):
    """Text of a scenario: everything that `a` has drives `b`."""
    integers = [*WHOLES[a], *(["single"] if a == 3 else [])]
    takers = [*WHOLES[b], *(["single"] if b == 3 else [])]
    connect = "".join(f'"b.{taker}" = "a.{taker if a == b else WHOLES[a][0]}_out"\n' for taker in takers)
    if a != b:
        connect = connect.replace('"b.single" = "a.n_out"', '"b.single" = "a.y"').replace('"a.single_out"', '"a.y"')
    inputs = "".join(f'"a.{name}" = {k}\n' for k, name in enumerate(integers, 5))
    return HEAD + WIRED.format(a=f"Types{a}", b=f"Types{b}", connect=connect, inputs=inputs, more=more)


@pytest.mark.parametrize(("a", "b"), [(2, 2), (3, 3), (2, 3), (3, 2)])
@pytest.mark.parametrize("method", ["gauss-seidel", "jacobi"])
def test_variables_of_all_types_are_set_wired_and_recorded(write, foreign, a, b, method):
    path = write(wired(a, b).replace("stop", f'method = "{method}"\nstop'))
    assert check(path, fmus=foreign) == []
    with Master(*prepare(path, None, foreign)) as master:
        result = run_once(master)
        again = run_once(master)
        texts = dict(master.texts)
    assert all(np.array_equal(result[name], again[name]) for name in result.signals)
    assert result.parameters == again.parameters
    assert result.parameters["a.label"] == "a" and result.parameters["a.law"] == 3
    assert result.parameters["b.on"] is True and result.parameters["a.shift"] == 2
    assert set(result["a.y"]) == {6.0} and set(result["b.y"][2:]) == {2.0}
    assert set(result["a.mode_out"]) == {3.0} and set(result["b.mode_out"][2:]) == {1.0}
    assert set(result["a.flag_out"]) == {1.0} and set(result["b.flag_out"][2:]) == {0.0}
    assert texts[Port("a", "text_out")] == "aé" and texts[Port("b", "text_out")] == "baé"
    for k, name in enumerate(WHOLES[a], 5):
        assert set(result[f"a.{name}_out"]) == {k + 2.0}
        assert a != b or set(result[f"b.{name}_out"][2:]) == {k + 2.0}
    level = 4.0
    for row in result["a.level"][1:]:
        level -= 0.1 * level
        assert row == level


EVENTS = """
[events.on]
target = "a.mode"
action = "set"
value = "On"
at = 0.2
until = 0.4
[events.flag]
target = "b.flag"
action = "set"
value = false
at = 0.3
[events.more]
target = "a.u"
action = "bias"
value = 0.5
at = 0.1
"""


@pytest.mark.parametrize("version", [2, 3])
def test_events_act_on_inputs_of_all_types(write, foreign, version):
    text = wired(version, version).replace('"b.flag" = "a.flag_out"\n', "").replace('"b.u" = "a.flag_out"\n', "")
    text = text.replace("[inputs]", '[inputs]\n"b.flag" = true\n"b.u" = 0.0') + EVENTS
    path = write(text)
    assert check(path, fmus=foreign) == []
    result = run(path, fmus=foreign)
    assert result["a.mode"].tolist() == [2, 2, 3, 3, 2, 2] and result["b.flag"].tolist() == [1, 1, 1, 0, 0, 0]
    assert result["a.u"].tolist() == [2.0, 2.5, 2.5, 2.5, 2.5, 2.5] and result["a.y"][1:].tolist() == [7.5] * 5
    (found,) = check(write(text.replace('"On"\nat', '"Onn"\nat')), fmus=foreign)
    assert "an item of the enumeration is expected. Did you mean `On`?" in found
    (found,) = check(write(text.replace("value = false", "value = 0.5")), fmus=foreign)
    assert "events.flag.value: `0.5` found, a value of type Boolean is expected" in found


def test_start_values_of_inputs_and_outputs_are_swept_and_need_no_driver(write, foreign):
    text = HEAD + '[components.a]\nfmu = "Types2"\nset = { u = 1.5, n = 2, flag = true, text = "x", mode = "On" }\n'
    path = write(text + '[sweep]\n"a.level" = [1.0, 2.0]\n"a.n" = [2, 3]\n')
    assert check(path, fmus=foreign) == []
    assert run(path, fmus=foreign)["a.n_out"][-1] == 2.0
    last = run(path, fmus=foreign, point=3)
    assert (last["a.n_out"][-1], last["a.n"][-1], last["a.y"][-1], last["a.mode_out"][-1]) == (3.0, 3.0, 3.0, 1.0)
    assert last["a.level"][0] == 2.0


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('law = "On"', 'law = "Onn"', '`law` is `"Onn"`, an item of the enumeration is expected. Did you mean `On`?'),
        ('law = "On"', "law = true", "`law` is `true`, a value of type Enumeration is expected"),
        ('"a.mode" = "Auto"', '"a.mode" = "Aut"', "an item of the enumeration is expected. Did you mean `Auto`?"),
        ('"a.flag" = false', '"a.flag" = 0', "inputs.a.flag: `0` found, a value of type Boolean is expected"),
        ('"a.text" = "é"', '"a.text" = 1.0', "inputs.a.text: `1.0` found, a value of type String is expected"),
        ('"a.u" = 2.0', '"a.u" = "x"', 'inputs.a.u: `"x"` found, a value of type Real is expected'),
        ('"a.u" = 2.0', "", "nothing drives `a.u`"),
        ('"a.text" = "é"', "", "nothing drives `a.text`. Connect it or list it in `[inputs]` (its start value is )"),
        ('"b.mode" = "a.mode_out"', '"b.mode" = "a.y"', "a.y (Real) -> b.mode (Enumeration): types differ"),
        ('"b.u" = "a.flag_out"', '"b.u" = "a.mode_out"', "(Enumeration) -> b.u (Real): types differ"),
        ('"b.u" = "a.flag_out"', '"b.u" = "a.text_out"', "(String) -> b.u (Real): types differ"),
        ("level = 4.0", "y = 4.0", "`y` is not a parameter but has the causality `output`"),
        ("level = 4.0", "text_out = 4.0", "`text_out` is not a parameter"),
    ],
)
def test_what_does_not_fit_is_told_before_the_run(write, foreign, version, old, new, words):
    text = wired(version, version)
    assert old in text
    found = check(write(text.replace(old, new)), fmus=foreign)
    assert len(found) == 1 and words in found[0]


def test_only_a_real_input_converts(write, foreign):
    text = wired(2, 2).replace('"b.flag" = "a.flag_out"\n', "")
    text += '[[connections]]\nfrom = "a.flag_out"\nto = "b.flag"\nfactor = 2.0\n'
    assert "only a Real input takes `factor` and `bias`" in check(write(text), fmus=foreign)[0]
    text = text.replace("b.flag", "b.u").replace('"b.u" = "a.flag_out"', '"b.flag" = "a.flag_out"')
    assert set(run(write(text), fmus=foreign)["b.u"][2:]) == {2.0}


@pytest.mark.parametrize(("kind", "value"), [("UInt8", 254), ("Int8", 126)])
def test_number_that_an_input_cannot_hold_ends_the_run(write, foreign, kind, value):
    text = wired(3, 3).replace(f'"b.n{kind}" = "a.n{kind}_out"', f'"b.n{kind}" = "a.nInt32_out"')
    text = text.replace('"a.nInt32" = 9', f'"a.nInt32" = {value}')
    with pytest.raises(FmuError, match=f"b, t = 0 s.*input `n{kind}` gets {value + 2}, .* expected"):
        run(write(text), fmus=foreign)


def test_number_that_cannot_be_kept_exactly_ends_the_run(write, foreign):
    text = wired(3, 3).replace('"a.nUInt64" = 12', '"a.nUInt64" = 9007199254740992')
    with pytest.raises(FmuError, match=r"output `nUInt64_out` is 9007199254740994; integers beyond 2\*\*53"):
        run(write(text), fmus=foreign)
    assert "0 to 1.844674407e+19 expected" in check(write(text.replace("9007199254740992", "-1")), fmus=foreign)[0]


@pytest.mark.parametrize(
    ("version", "words"),
    [
        (2, "fmi2DoStep returned fmi2Discard; the component says: 100 % of the time is over."),
        (3, "fmi3DoStep returned fmi3Discard; the component says: 100 % of the time is over."),
    ],
)
def test_component_that_does_not_go_on_ends_the_run_with_its_words(write, foreign, version, words):
    with pytest.raises(FmuError) as caught:
        run(write(wired(version, version, more=", end = 0.25")), fmus=foreign)
    assert words in str(caught.value) and "a, t = 0.2 s" in str(caught.value)
    assert caught.value.result.times.size == 3


@pytest.mark.parametrize(("a", "b"), [(2, 3), (3, 2)])
def test_components_in_processes_of_their_own_give_the_same_bits(write, foreign, a, b):
    text = wired(a, b)
    near = run(write(text, "near"), fmus=foreign)
    apart = text.replace("[components.a]", '[components.a]\nisolation = "process"')
    apart = apart.replace("[components.b]", '[components.b]\nisolation = "process"')
    with Master(*prepare(write(apart, "apart"), None, foreign)) as master:
        result = run_once(master)
        texts = dict(master.texts)
    assert all(np.array_equal(near[name], result[name]) for name in near.signals)
    assert near.parameters == result.parameters and len(near.signals) == len(result.signals)
    assert texts[Port("b", "text_out")] == "baé"
    with pytest.raises(FmuError, match=rf"a, t = 0.2 s.*fmi{a}DoStep returned"):
        run(write(apart.replace("level = 4.0", "level = 4.0, end = 0.25"), "fails"), fmus=foreign)


def changed(foreign, tmp_path, version, old, new):
    path = tmp_path / f"Changed{version}.fmu"
    with zipfile.ZipFile(foreign / f"Types{version}.fmu") as source, zipfile.ZipFile(path, "w") as target:
        for info in source.infolist():
            content = source.read(info)
            if info.filename == "modelDescription.xml":
                assert old.encode() in content
                content = content.replace(old.encode(), new.encode())
            target.writestr(info, content)
    return path


@pytest.mark.parametrize("version", [2, 3])
def test_wrong_guid_is_told_in_the_words_of_the_component(write, foreign, tmp_path, version):
    key = "guid" if version == 2 else "instantiationToken"
    path = changed(foreign, tmp_path, version, f'{key}="types"', f'{key}="other"')
    inputs = "".join(f'"a.{n}" = 0\n' for n in WHOLES[version] + ["single"] * (version == 3))
    text = f'[components.a]\nfmu = "{path}"\n[inputs]\na.u = 0\na.flag = false\na.text = ""\na.mode = 1\n{inputs}'
    with pytest.raises(FmuError, match=r"cannot be instantiated.*says: the GUID is that of another model"):
        run(write(HEAD + text))


@pytest.mark.parametrize("version", [2, 3])
def test_library_without_a_function_that_runs_need_is_told_before_the_run(write, foreign, tmp_path, version):
    with zipfile.ZipFile(foreign / f"Types{version}.fmu") as source, zipfile.ZipFile(tmp_path / "a.fmu", "w") as target:
        for name in source.namelist():
            target.writestr(name, source.read(name).replace(b"Terminate\0", b"Dominate_\0"))
    inputs = "".join(f'"a.{n}" = 0\n' for n in WHOLES[version] + ["single"] * (version == 3))
    text = f'[components.a]\nfmu = "a"\n[inputs]\na.u = 0\na.flag = false\na.text = ""\na.mode = 1\n{inputs}'
    with pytest.raises(FmuError, match=rf"cannot be instantiated.*undefined symbol: fmi{version}Terminate"):
        run(write(HEAD + text), fmus=tmp_path)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("CoSimulation", "ModelExchange", "FMI 3.0 without co-simulation"),
        ('valueReference="11"', 'valueReference="10"', "has the same value reference"),
        ('<Output valueReference="11"', '<Output valueReference="98"', "refers to variable 98"),
        ('fmiVersion="3.0"', 'fmiVersion="4.0"', "FMI 4.0 found"),
    ],
)  # fmt: skip
def test_what_is_not_supported_of_fmi_3_is_refused(foreign, tmp_path, old, new, words):
    with pytest.raises(UnusableError, match=words):
        describe(changed(foreign, tmp_path, 3, old, new))


NOT_MOVED = """
<Clock name="tick" valueReference="90" causality="{0}" intervalVariability="triggered"/>
<Binary name="raw" valueReference="91" causality="{0}">{1}</Binary>
<Binary name="kept" valueReference="92" causality="local"/>
<Binary name="many" valueReference="93" causality="{0}"><Dimension start="2"/>{1}{1}</Binary>
"""


@pytest.mark.parametrize("causality", ["input", "output", "local"])
def test_variables_of_kinds_that_are_not_moved_are_left_alone(write, foreign, tmp_path, causality):
    more = NOT_MOVED.format(causality, '<Start value="666f6f"/>' * (causality == "input"))
    path = changed(foreign, tmp_path, 3, '<Float64 name="time"', f'{more}<Float64 name="time"')
    text = wired(3, 3).replace('fmu = "Types3"', f'fmu = "{path}"')
    assert check(write(text), fmus=foreign) == []
    found, plain = run(write(text), fmus=foreign), run(write(wired(3, 3), "plain"), fmus=foreign)
    assert all(np.array_equal(found[name], plain[name]) for name in plain.signals) and "a.raw" not in found.signals
    assert check(write(text + '"a.raw" = 1.0\n', "set"), fmus=foreign) != []


STOCK = """
[components.one]
fmu = "Types"
set = { step = 3, is_on = true, label = "n" }
[components.two]
fmu = "Types"
[components.gain]
fmu = "Gain"
[connect]
"two.step" = "one.count"
"two.is_on" = "one.is_odd"
"two.label" = "one.said"
"gain.u" = "two.count"
"""


def test_stock_fmus_of_pythonfmu_need_no_variability(write, fmus):
    path = write(HEAD + STOCK)
    assert check(path, fmus=fmus) == []
    with Master(*prepare(path, None, fmus)) as master:
        result = run_once(master)
        said = master.texts[Port("two", "said")]
    assert result["one.count"].tolist() == [0.0, 3.0, 6.0, 9.0, 12.0, 15.0]
    assert result["one.is_odd"].tolist() == [0.0, 1.0, 0.0, 1.0, 0.0, 1.0]
    assert result["two.count"].tolist() == [0.0, 3.0, 3.0, 12.0, 12.0, 27.0]
    assert result["gain.y"].tolist() == [2.0 * x for x in result["two.count"]]
    assert said == "n1527"
