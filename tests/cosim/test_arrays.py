"""Arrays of FMI 3.0, element by element: `y[1]`, `K[2,1]`; their sizes follow from structural parameters."""

import re

import numpy as np
import pytest

from gapsense.cosim import ScenarioError, check, run, sweep
from gapsense.cosim.fmu.archive import UnusableError
from gapsense.cosim.fmu.descriptions import describe

HEAD = 'title = "Arrays"\n[experiment]\nstop = 0.5\nbase_step = 0.1\n'
REST = """
"a.count[1]" = 10
"a.count[2]" = 20
"a.count[3]" = 30
"a.flag[1]" = true
"a.flag[2]" = false
"a.single[1]" = 0.5
"a.single[2]" = 1.5
"""
ONE = (
    HEAD
    + '[components.a]\nfmu = "Arrays"\nSET\n[components.source]\nfmu = "Types3"\nset = { gain = 2.0 }\n'
    + '[connect]\n"a.u[2]" = "source.y"\n[inputs]\n"source.u" = 3.0\n"source.flag" = false\n"source.text" = ""\n'
    + '"source.mode" = 1\n"source.single" = 0\n'
    + "".join(f'"source.n{s}Int{bits}" = 0\n' for s in ("", "U") for bits in (8, 16, 32, 64))
    + '"a.u[1]" = 1.0\n'
    + REST
)


def expected(K, bias, u=(1.0, 6.0)):
    return np.asarray(K) @ u + bias


@pytest.mark.parametrize("method", ["gauss-seidel", "jacobi"])
@pytest.mark.parametrize("own", ["", 'isolation = "process"'])
def test_elements_are_set_wired_and_recorded(write, foreign, method, own):
    path = write(ONE.replace("SET", own).replace("stop", f'method = "{method}"\nstop'))
    assert check(path, fmus=foreign) == []
    found = run(path, fmus=foreign)
    last = {name: float(values[-1]) for name, values in found.signals.items() if name.startswith("a.")}
    assert [last["a.y[1]"], last["a.y[2]"]] == expected([[1, 2], [3, 4]], 0.5).tolist()
    assert last["a.total"] == last["a.y[1]"] + last["a.y[2]"]
    assert [last[f"a.count_out[{k}]"] for k in (1, 2, 3)] == [10.0, 21.0, 32.0]
    assert [last["a.flag_out[1]"], last["a.flag_out[2]"]] == [0.0, 1.0]
    assert [last["a.single_out[1]"], last["a.single_out[2]"]] == [1.0, 3.0]
    assert found.about["a.y[2]"].unit == "V" and "a.words[1]" not in found.signals
    parameters = {name: value for name, value in found.parameters.items() if name.startswith("a.")}
    assert parameters == {
        **{"a.n": 2, "a.K[1,1]": 1.0, "a.K[1,2]": 2.0, "a.K[2,1]": 3.0, "a.K[2,2]": 4.0, "a.bias[1]": 0.5},
        "a.bias[2]": 0.5,
    }


def test_an_element_that_is_set_leaves_the_others_at_their_start_values(write, foreign):
    found = run(write(ONE.replace("SET", 'set = { "K[2,1]" = 7.0, "bias[1]" = -1.0 }')), fmus=foreign)
    y = [found[f"a.y[{k}]"][-1] for k in (1, 2)]
    assert y == expected([[1, 2], [7, 4]], [-1.0, 0.5]).tolist()


GROWN = 'set = { n = 3, "K[1,1]" = 1, "K[1,2]" = 2, "K[2,1]" = 3, "K[2,2]" = 4, "K[3,1]" = 5, "K[3,2]" = 6 }'


def test_sizes_follow_from_structural_parameters(write, foreign):
    text = ONE.replace("SET", GROWN) + '[components.b]\nfmu = "Arrays"\nset = { n = 1, "K[1,1]" = 1, "K[1,2]" = 1 }\n'
    text += REST.replace('"a.', '"b.').replace("\n", "\n", 1)
    text = text.replace("[components.b]", "[components.b]", 1)
    body, second = text.split("[components.b]")
    own, inputs = second.split("}\n", 1)
    whole = body.replace("[connect]", f'[components.b]{own}}}\n[connect]\n"b.u[1]" = "a.y[3]"\n"b.u[2]" = "a.y[1]"')
    found = run(write(whole + inputs), fmus=foreign)
    y = expected([[1, 2], [3, 4], [5, 6]], 0.5)
    assert [found[f"a.y[{k}]"][-1] for k in (1, 2, 3)] == y.tolist()
    assert found["b.y[1]"][-1] == y[2] + y[0] + 0.5 and "b.y[2]" not in found.signals
    assert found.parameters["a.n"] == 3 and found.parameters["a.bias[3]"] == 0.5


def test_no_elements_are_no_signals(write, foreign):
    found = run(write(ONE.replace("SET", "set = { n = 0 }")), fmus=foreign)
    assert found["a.total"][-1] == 0.0 and not [name for name in found.signals if name.startswith("a.y")]


def test_an_event_changes_one_element_of_a_tunable_array(write, foreign):
    event = '[events.more]\ntarget = "a.K[1,2]"\naction = "set"\nvalue = 10.0\nat = 0.3\n'
    found = run(write(ONE.replace("SET", 'set = { "K[1,1]" = 5.0 }') + event), fmus=foreign)
    y = found["a.y[1]"]
    assert (y[2], y[-1]) == (5.0 + 12.0 + 0.5, 5.0 + 60.0 + 0.5) and found["a.y[2]"][-1] == 3.0 + 24.0 + 0.5


def test_elements_are_swept_and_measured(write, foreign):
    text = ONE.replace("SET", "") + '[sweep]\n"a.K[1,1]" = [1.0, 2.0]\n'
    found = sweep(write(text + '[metrics.last]\nkind = "final"\nsignal = "a.y[1]"\n'), fmus=foreign, workers=1)
    assert found.metrics["last"].tolist() == [13.5, 14.5]


def test_records_by_pattern_and_name(write, foreign):
    text = ONE.replace("SET", "") + '[record]\nsignals = ["a.y[[]*", "a.count_out[2]"]\n'
    assert sorted(run(write(text), fmus=foreign).signals) == ["a.count_out[2]", "a.y[1]", "a.y[2]"]


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (("SET", 'set = { n = 3, "K[1,1]" = 1.0 }'), "`K[1,2]` is missing. Give all elements of `K`, or none."),
        (("SET", "set = { n = 5 }"), "`n` is 5, 0 to 4 expected"),
        (("SET", "set = { n = -1 }"), "`n` is -1, 0 to 4 expected"),
        (("SET", 'set = { "K[3,1]" = 1.0 }'), "unknown parameter `K[3,1]`. Did you mean `K["),
        (("SET", "set = { K = 1.0 }"), "unknown parameter `K`"),
        (('"a.u[2]" = "source', '"a.u[3]" = "source'), "`u[3]`"),
        (('"a.flag[2]" = false', ""), "nothing drives `a.flag[2]`"),
        (('"a.u[1]" = 1.0', '"a.u[1]" = 1.0\n"a.u[2]" = 2.0'), "a.u[2]"),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_told(write, foreign, change, sentence):
    problems = check(write(ONE.replace(*change).replace("SET", "")), fmus=foreign)
    assert any(sentence in problem for problem in problems), problems


def test_sizes_are_not_swept(write, foreign):
    with pytest.raises(ScenarioError, match="it decides the sizes of arrays"):
        sweep(write(ONE.replace("SET", "") + '[sweep]\n"a.n" = [1, 2]\n'), fmus=foreign)


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ('start="1 2 3 4"', 'start="1 2 3"', "its array `K` has 3 start values, 4 or one expected"),
        (
            '<Dimension start="3"/></Int32>',
            '<Dimension start="300000"/></Int32>',
            "its input `count` is an array of 300000, at most 100",
        ),
        ('<Dimension valueReference="0"/>', '<Dimension valueReference="77"/>', "not a readable FMU"),
    ],
)
def test_a_wrong_array_is_refused(foreign, tmp_path, old, new, sentence):
    with pytest.raises(UnusableError, match=re.escape(sentence)):
        describe(changed(foreign, tmp_path, old, new))


@pytest.mark.parametrize("name", ["K", "y"])
def test_large_arrays_are_left_alone(foreign, tmp_path, name):
    """They keep their start values, and are not seen: a run would be slow with them."""
    dimension = (
        '<Dimension valueReference="0"/><Dimension start="2"/>' if name == "K" else '<Dimension valueReference="0"/>'
    )
    causality = (
        'causality="parameter" variability="tunable" start="1 2 3 4">'
        if name == "K"
        else 'causality="output" unit="V">'
    )
    larger = causality.replace("1 2 3 4", "1") + "\n" * (name == "K") + '<Dimension start="101"/>'
    variables = describe(changed(foreign, tmp_path, causality + "\n" * (name == "K") + dimension, larger)).variables
    assert not [other for other in variables if other.startswith(f"{name}[")] and "u[1]" in variables


def changed(foreign, folder, old, new):
    """The FMU with another model description."""
    import zipfile

    path = folder / "Arrays.fmu"
    with zipfile.ZipFile(foreign / "Arrays.fmu") as source, zipfile.ZipFile(path, "w") as target:
        for name in source.namelist():
            data = source.read(name)
            target.writestr(name, data.replace(old.encode(), new.encode()) if name.endswith(".xml") else data)
    assert path.read_bytes() != (foreign / "Arrays.fmu").read_bytes()
    return path
