"""A scenario file that is wrong in any way gets a sentence for each thing that is wrong, all at once."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gapsense.cosim import ScenarioError, load
from gapsense.cosim.scenario.read import grid
from gapsense.cosim.scenario.records import Port, Tolerance
from gapsense.tables import Table

SECOND = '[[connections]]\nfrom = "lag.y"\nto = "gain.u"\n'


def problems(path: Path, variant: str | None = None) -> list[str]:
    with pytest.raises(ScenarioError) as caught:
        load(path, variant)
    return caught.value.problems


def only(path: Path, variant: str | None = None) -> str:
    found = problems(path, variant)
    assert len(found) == 1, found
    return found[0]


def test_complete_scenario_is_read(write, chain):
    path = write(
        chain
        + """
[seeds]
source = 3
[record]
signals = ["lag.*"]
decimation = 2
[metrics.error]
kind = "rmse"
signal = "lag.y"
reference = "lag.u"
after = 0.5
bounds = [0.0, inf]
[baseline]
rtol = 1e-6
tolerances = { "lag.y" = { atol = 0.1 } }
[variants.fast]
description = "faster"
components.source.set.slope = 4.0
"""
    )
    scenario = load(path.parent)
    assert scenario.experiment.count == 10
    assert scenario.components["source"].values == {"slope": 2.0}
    assert [str(c) for c in scenario.connections] == ["source.y -> lag.u", "lag.y -> gain.u"]
    assert scenario.metrics[0].bounds == (0.0, float("inf"))
    assert scenario.baseline.tolerances == {"lag.y": Tolerance(1e-6, 0.1)}
    assert scenario.variants == {"fast": "faster"}
    assert load(path, "fast").components["source"].values == {"slope": 4.0}
    assert load(path, "fast").baseline.file.name == "baseline.fast.csv"


def test_what_is_no_table_is_named_once(write, chain):
    text = chain.replace('[components.lag]\nfmu = "Lag"', "[components]\nlag = 3")
    found = problems(write(text + "[metrics]\nm = 1\n"))
    assert [problem.split(":")[0] for problem in found] == ["scenario.toml, components.lag", "scenario.toml, metrics.m"]


def test_all_problems_come_at_once(write, chain):
    text = chain.replace("stop = 1.0", "stop = 1.05").replace('fmu = "Gain"', 'fmu = 3\nstep = 0\nspeed = "high"')
    found = problems(write(text + '[metrics.a]\nkind = "rms"\nsignal = "lag.y"\n'))
    assert len(found) == 5
    assert all(problem.startswith("scenario.toml, ") for problem in found)


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("base_step = 0.1", "base_step = 0.3", ["experiment", "3.33333333 steps", "Change `stop` or `base_step`"]),
        ("stop = 1.0", "stop = -1.0", ["whole number of at least 1"]),
        ("stop = 1.0", "stop = inf", ["experiment.stop", "`inf` found", "finite number"]),
        ("stop = 1.0", "stop = nan", ["experiment.stop", "`nan` found"]),
        ("stop = 1.0", 'stop = "1"', ["experiment.stop", '`"1"` found', "finite number expected"]),
        ("stop = 1.0", "", ["experiment.stop", "missing"]),
        ("base_step = 0.1", "base_step = 0", ["experiment.base_step", "positive number"]),
        ("stop = 1.0", "stop = 1.0\nmetod = 'jacobi'", ["experiment.metod", "unknown key", "`method`"]),
        ("stop = 1.0", "stop = 1.0\nmethod = 'jakobi'", ["experiment.method", "Did you mean `jacobi`"]),
        ("stop = 1.0", "stop = 1.0\npace = true", ["experiment.pace", "`true` found"]),
        ('fmu = "Lag"', 'fmu = "Lag"\noffset = -1', ["components.lag.offset", "at least 0"]),
        ('fmu = "Lag"', 'fmu = "Lag"\nstep = 1.5', ["components.lag.step", "`1.5` found", "whole number"]),
        ('fmu = "Lag"', 'fmu = "Lag"\nparameters = ["a.toml", 3]', ["lag.parameters: `3` found in the list, a text"]),
        ('fmu = "Lag"', 'fmu = "Lag"\nset = { a = [1] }', ["components.lag.set.a", "`[1]` found"]),
        ('fmu = "Lag"', 'fmu = "Lag"\nset = { a = nan }', ["components.lag.set.a", "`nan` found"]),
        ('fmu = "Lag"', 'fmu = "Lag"\nparameters = ["none.toml"]', ["none.toml", "no such file"]),
        ('fmu = "Lag"', 'fmu = "Lag"\nset = { "table.file" = "no.csv" }', ["table.file", "there is no file"]),
        ('fmu = "Lag"', 'fmu = "Lag"\nset = { "a.b" = 1, a.b = 2 }', ["set.a.b", "given twice"]),
        ("[components.lag]", '[components."lag.x"]', ["components.lag.x", "letters, digits"]),
        ('from = "lag.y"', 'from = "lag"', ["connections[1].from", "`component.variable` expected"]),
        ('from = "lag.y"', 'form = "lag.y"', ["connections[1].f", "missing", "unknown key"]),
        (SECOND, '[connect]\n"gain.u" = 3\n', ["connect.gain.u", "`3` found, a text expected"]),
        (SECOND, '[connect.gain.u]\nfrom = ["lag.y"]\n', ["connect.gain.u.from", '`["lag.y"]` found, a text expected']),
        (SECOND, '[connect]\n"gain.u" = "lag"\n', ["connect.gain.u: `lag` found, `component.variable` expected"]),
        (SECOND, '[connect]\ngain = "lag.y"\n', ["connect.gain: `gain` found, `component.variable` expected"]),
        (SECOND, '[connect]\n"gain.u" = "lag.y"\ngain.u = "lag.y"\n', ["connect.gain.u", "given twice"]),
        (SECOND, '[connect]\n"gain.u" = "lag.y"\n"gain.u" = "source.y"\n', ["line 24", "only once"]),
        ("[experiment]", "connect = 3\n[experiment]", ["connect: `3` found, a table expected"]),
        ('title = "Ramp through a lag and a gain"', "", ["title", "missing"]),
        ("[experiment]", "colour = 1\n[experiment]", ["colour", "unknown key"]),
        ("[experiment]", '[inputs]\n"a.b" = [1]\n[experiment]', ["inputs.a.b", "finite number"]),
        ("[experiment]", "[seeds]\nlag = 1.5\n[experiment]", ["seeds.lag", "`1.5` found"]),
        ("[experiment]", "[record]\ndecimation = 0\n[experiment]", ["record.decimation", "at least 1"]),
        ("[experiment]", "[baseline]\nrtol = -1\n[experiment]", ["baseline.rtol", "at least 0"]),
        ("[experiment]", "[variants]\na = 1\n[experiment]", ["variants.a", "a table expected"]),
    ],
)
def test_wrong_value_is_named_with_its_place(write, chain, old, new, expected):
    assert old in chain
    text = "\n".join(problems(write(chain.replace(old, new, 1))))
    for part in expected:
        assert part in text


METRIC = '[metrics.m]\nsignal = "lag.y"\n'


@pytest.mark.parametrize(
    ("lines", "expected"),
    [
        ('kind = "rmse"', "`rmse` compares with a signal"),
        ('kind = "fraction"\nreference = 1.0', "`fraction` uses no reference"),
        ('kind = "loop_area"', "`loop_area` needs the other signal of the curve"),
        ('kind = "intercept"\nreference = 1.0', "`intercept` needs the other signal of the curve"),
        ('kind = "mean"\nbounds = [2, 1]', "rising order"),
        ('kind = "mean"\nbounds = [nan, 1]', "pair"),
        ('kind = "mean"\nafter = 2.0\nbefore = 1.0', "`after` must be the smaller"),
        ('kind = "mean"\nreference = true', "a name or a finite number expected"),
    ],
)
def test_wrong_metric_is_named(write, chain, lines, expected):
    message = only(write(chain + METRIC + lines))
    assert expected in message
    assert "metrics.m" in message


def test_duplicate_key_is_refused_with_its_line(write, chain):
    message = only(write(chain.replace("stop = 1.0", "stop = 1.0\nstop = 2.0")))
    assert "line 6" in message
    assert "only once" in message


def test_other_slip_in_toml_is_not_told_of_keys_given_twice(write, chain):
    assert only(write(chain.replace("stop = 1.0", "stop 1.0"))).endswith("(at line 5, column 6). Correct that line.")


def test_byte_order_mark_of_windows_is_taken(write, chain):
    assert load(write("\ufeff" + chain)).title == load(write(chain)).title


def test_file_that_is_no_utf8_or_missing_is_named(tmp_path):
    (tmp_path / "scenario.toml").write_bytes(b'title = "\xff"')
    assert "not UTF-8" in only(tmp_path)
    assert "no such file" in only(tmp_path / "other.toml")


def test_unknown_variant_lists_the_others(write, chain):
    assert "Did you mean `warm`?" in only(write(chain + "[variants.warm]\n"), "warn")


def test_parameter_sets_are_merged_in_order_and_files_found_beside_them(write, chain):
    text = chain.replace('fmu = "Lag"', 'fmu = "Lag"\nparameters = ["one.toml", "two.toml"]\nset = { c = 3 }')
    one = 'description = "d"\n[values]\na = 1\n"b.x" = 1\nc = 1\n"t.file" = "one.toml"\n'
    path = write(text, one=one, two='source = "s"\n[values.b]\nx = 2\n')
    scenario = load(path)
    lag = scenario.components["lag"]
    assert lag.values == {"a": 1, "b.x": 2, "c": 3, "t.file": str(path.parent / "one.toml")}
    assert lag.origin["b.x"] == "two.toml"
    assert [file.name for file in scenario.files] == ["scenario.toml", "one.toml", "two.toml"]


def test_problems_of_parameter_sets_come_with_those_of_the_scenario(write, chain):
    text = chain.replace('fmu = "Lag"', 'fmu = "Lag"\nparameters = ["one.toml"]').replace("stop = 1.0", "stop = 1.05")
    found = problems(write(text, one="sorce = 1\nvalue = 2\n"))
    assert len(found) == 4
    assert any("one.toml, sorce: unknown key. Did you mean `source`?" in problem for problem in found)


def test_inputs_may_be_written_as_tables(write, chain):
    assert load(write(chain + "[inputs.lag]\nu = 2\n")).inputs == {Port("lag", "u"): 2.0}


@pytest.mark.parametrize(
    "table", ['"gain.u" = "lag.y"\n"lag.u" = "source.y"\n', 'gain.u = "lag.y"\nlag.u = "source.y"\n']
)
def test_connections_may_be_written_as_one_table_beside_the_long_form(write, chain, table):
    head, _, second = chain.split("[[connections]]")
    written = load(write(f"{head}[connect]\n{table}")).connections
    assert [str(c) for c in written] == ["lag.y -> gain.u", "source.y -> lag.u"]
    assert [c.place for c in written] == ["connect.gain.u", "connect.lag.u"]
    assert not any(c.converts for c in written)
    both = f'{head}[connect]\nlag.u = "source.y"\n[[connections]]{second}factor = 2.0\n'
    places = {c.place: c.factor for c in load(write(both)).connections}
    assert places == {"connect.lag.u": None, "connections[0]": 2.0}


def test_variant_rewires_one_input(write, chain):
    table = '[connect]\n"gain.u" = "lag.y"\n"lag.u" = "source.y"\n[variants.direct.connect]\n"gain.u" = "source.y"\n'
    path = write(chain[: chain.index("[[connections]]")] + table)
    assert [str(c) for c in load(path).connections] == ["lag.y -> gain.u", "source.y -> lag.u"]
    assert [str(c) for c in load(path, "direct").connections] == ["source.y -> gain.u", "source.y -> lag.u"]


@given(st.floats(-10, 10), st.sampled_from([1e-4 / 3, 1 / 60, 25e-6, 1 / 7, 0.1]), st.integers(1, 10**6), st.booleans())
def test_grid_takes_whole_numbers_of_steps_however_awkward(start, base, count, whole):
    found: list[str] = []
    read = grid(Table({}, "f", "", found), start, start + (count + (0 if whole else 0.4)) * base, base, "jacobi", None)
    assert (read is not None) == whole == (not found)
    assert read is None or (read.count, read.base_step) == (count, base)
