"""Inputs that follow a signal of the scenario: from a CSV file, or from a table."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gapsense.cosim import check, run
from gapsense.cosim.run.part import BLOCK
from gapsense.cosim.scenario.records import Played

LAG = """
title = "Signal"
[experiment]
stop = 1.0
base_step = 0.1
[components.lag]
fmu = "Lag"
[components.gain]
fmu = "Gain"
[connect]
"gain.u" = "lag.y"
[inputs]
"lag.u" = SIGNAL
"""
RAMP = '{ file = "x.csv", column = "u [V]" }'
FILE = "time [s],u [V],other\n0,0,9\n0.5,1,9\n1.0,3,9\n"


@pytest.fixture
def signal(write):
    """Writes a scenario with a signal, and the file that this may name."""

    def signal(signal, file=FILE, text=LAG):
        path = write(text.replace("SIGNAL", signal))
        (path.parent / "x.csv").write_bytes(file.encode() if isinstance(file, str) else file)
        return path

    return signal


def by_hand(values, constant=0.5):
    """Lag by explicit Euler, which gets the value at the end of each step, or (Jacobi) at its start."""
    y = [0.0]
    for value in values:
        y.append(y[-1] + 0.1 / constant * (value - y[-1]))
    return y


@pytest.mark.parametrize("how", ["file", "table", "nested"])
def test_component_gets_what_the_signal_has_at_the_time_of_the_step(signal, fmus, how):
    table = "{ times = [0, 0.5, 1.0], values = [0.0, 1, 3.0] }"
    text = LAG if how != "nested" else LAG.replace('"lag.u" = SIGNAL', '[inputs.lag.u]\nfile = "x.csv"\ncolumn = "u"')
    path = signal(table if how == "table" else RAMP, text=text)
    assert check(path, fmus=fmus) == []
    result = run(path, fmus=fmus)
    expected = np.interp(result.times, [0.0, 0.5, 1.0], [0.0, 1.0, 3.0])
    assert np.array_equal(result["lag.u"], expected)
    assert result["lag.y"].tolist() == by_hand(expected[1:])
    path.write_text(path.read_text().replace("stop =", 'method = "jacobi"\nstop ='))
    assert run(path, fmus=fmus)["lag.y"].tolist() == by_hand(expected[:-1])
    assert (how == "table") or "x.csv" in result.run.files


def test_values_hold_until_the_next_one_however_its_time_is_rounded(signal, fmus):
    step = '{ times = [0.0, 0.3, 0.7, 1.0], values = [1, 2, 3, 4], interpolation = "hold" }'
    assert run(signal(step), fmus=fmus)["lag.u"].tolist() == [1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 4]


def test_component_with_a_longer_step_and_an_offset_gets_it_too(signal, fmus):
    text = LAG.replace('fmu = "Lag"', 'fmu = "Lag"\nstep = 3\noffset = 1')
    result = run(signal(RAMP, text=text), fmus=fmus)
    expected = np.interp(result.times, [0.0, 0.5, 1.0], [0.0, 1.0, 3.0])
    y, rows = 0.0, [0.0]
    for k in range(1, 11):
        if k > 1 and (k - 1) % 3 == 0:
            y += (3 * 0.1) / 0.5 * (expected[k] - y)
        rows.append(y)
    assert result["lag.y"].tolist() == rows


@given(st.integers(1, 5), st.sampled_from(["linear", "hold"]))
def test_blocks_do_not_show(samples, interpolation):
    times, values = np.arange(samples + 1.0), np.arange(samples + 1.0) ** 2
    played, at = Played(times, values, interpolation), np.linspace(0.0, samples, 3 * BLOCK // 100)
    assert np.array_equal(played.at(at), np.concatenate([played.at(piece) for piece in np.array_split(at, 7)]))


def test_long_run_is_played_to_its_end(signal, fmus):
    text = LAG.replace("stop = 1.0", f"stop = {0.1 * (2 * BLOCK + 3)!r}")
    result = run(signal("{ times = [0, 1000], values = [0, 1000] }", text=text), fmus=fmus)
    assert np.allclose(result["lag.u"], result.times, rtol=1e-12)


@pytest.mark.parametrize(
    ("given", "file", "words"),
    [
        ('{ file = "none.csv", column = "u" }', FILE, "none.csv` cannot be read: No such file"),
        ('{ file = "x.csv", column = "v" }', FILE, "column `v` is missing. Known: `other`, `time`, `u`."),
        ('{ file = "x.csv", column = "oter" }', FILE, "column `oter` is missing. Did you mean `other`?"),
        ('{ file = "x.csv", column = "u [mV]" }', FILE, "`u` is in `V`, `mV` is expected, and nothing is converted"),
        (RAMP, FILE.replace("[V]", "[mV]"), "`u` is in `mV`, `V` is expected"),
        ('{ file = "x.csv", column = "u" }', FILE.replace("[V]", "[mV]"), "is in `mV`, the input in `V`"),
        (RAMP, FILE.replace("time [s]", "time [ms]"), "`time` is in `ms`, `s` is expected"),
        (RAMP, FILE.replace("time [s]", "t"), "column `time` is missing"),
        (RAMP, FILE.replace("other", "u"), "columns 2 and 3 are both called `u`"),
        (RAMP, FILE.replace("0.5,1", "0.5,one"), "line 3, column 2 (`u`): `one` found, a finite number expected"),
        (RAMP, FILE.replace("0.5,1", "0.5,nan"), "line 3, column 2 (`u`): `nan` found"),
        (RAMP, FILE.replace("0.5,1,9", "0.5"), "line 3: 1 values found, 3 expected"),
        (RAMP, FILE.replace("0.5", "0"), "line 3 is 0 s after 0 s; times must rise"),
        (RAMP, FILE.replace("1.0,3", "0.9,3"), "values from 0 s to 0.9 s, the run is from 0 s to 1 s"),
        (RAMP, FILE.replace("\n0,0", "\n0.1,0"), "values from 0.1 s to 1 s"),
        (RAMP, "", "column `time` is missing. There is none."),
        (RAMP, "time [s],u [V]\n0,0\n", "1 times and 1 values found, at least 2"),
        (RAMP, b"\xff\xfe", "not a CSV file in UTF-8"),
        ('{ file = "x.csv" }', FILE, "inputs.lag.u.column: missing; a signal with `file` needs it"),
        ("{ times = [0, 1] }", FILE, "inputs.lag.u.values: missing; a signal with `times` needs it"),
        ('{ column = "u" }', FILE, "either `file` and `column` or `times` and `values`"),
        ('{ file = "x.csv", times = [0, 1], column = "u" }', FILE, "either `file` and `column` or"),
        ('{ file = "x.csv", values = [0, 1], column = "u" }', FILE, "a signal with `file` has no `values`"),
        ("{ times = [0, 1, 2], values = [0, 1] }", FILE, "3 times and 2 values found"),
        ("{ times = [0, 1, 1], values = [0, 1, 2] }", FILE, "time 3 is 1 s after 1 s; times must rise"),
        ("{ times = [0, inf], values = [0, 1] }", FILE, "`inf` found in the list, a finite number expected"),
        ('{ times = [0, 1], values = [0, "x"] }', FILE, '`"x"` found in the list, a finite number expected'),
        (RAMP.replace(" }", ', interpolation = "cubic" }'), FILE, "`cubic` found. Known: `hold`, `linear`."),
        (RAMP.replace(" }", ', interpolatin = "hold" }'), FILE, "unknown key. Did you mean `interpolation`?"),
        (RAMP + '\n"gain.u" = 1.0', FILE, "`gain.u` is driven 2 times, by connect.gain.u, inputs.gain.u"),
        (RAMP + '\n"lag.v" = { times = [0, 1], values = [0, 1] }', FILE, "unknown variable `v` in `lag`"),
        (RAMP + '\n"leg.u" = { times = [0, 1], values = [0, 1] }', FILE, "there is no component `leg`"),
        (RAMP + '\n"lag.y" = { times = [0, 1], values = [0, 1] }', FILE, "`lag.y` is an output, an input is expected"),
    ],
)
def test_what_is_wrong_with_a_signal_is_told_before_the_run(signal, fmus, given, file, words):
    found = check(signal(given, file), fmus=fmus)
    told = [problem for problem in found if words in problem]
    assert len(told) == 1, found
    assert told[0].startswith("scenario.toml, inputs.") or "driven" in told[0]


def test_limits_hold_for_signals_too(signal, fmus):
    text = LAG.replace('[connect]\n"gain.u" = "lag.y"\n', "")
    given = '0.0\n"gain.u" = { times = [0, 1], values = [-2000, 1] }'
    assert "-2000 found, -1000 to 1000 V expected" in check(signal(given, text=text), fmus=fmus)[0]


TYPES = """
title = "Signal"
[experiment]
stop = 0.3
base_step = 0.1
[components.a]
fmu = "Types2"
set = { u = 0, text = "", flag = false, n = 0, mode = 1 }
[inputs]
SIGNAL
"""


def test_whole_numbers_follow_signals_that_hold(write, foreign):
    text = TYPES.replace(", flag = false, n = 0, mode = 1", "")
    times = 'times = [0, 0.2, 0.3], interpolation = "hold"'
    lines = [
        f'"a.{n}" = {{ {times}, values = {v} }}'
        for n, v in (("n", [3, -4, 5]), ("flag", [0, 1, 0]), ("mode", [1, 3, 2]))
    ]
    path = write(text.replace("SIGNAL", "\n".join(lines)))
    assert check(path, fmus=foreign) == []
    result = run(path, fmus=foreign)
    assert result["a.n_out"].tolist() == [3, 3, -4, 5]
    assert result["a.flag_out"].tolist() == [1, 1, 0, 1]
    assert result["a.mode_out"].tolist() == [2, 2, 1, 3]


@pytest.mark.parametrize("end", [-(2**31), 2**31 - 1])
def test_least_and_greatest_whole_numbers_arrive(write, foreign, end):
    line = f'"a.n" = {{ times = [0, 1], values = [{end}, 0], interpolation = "hold" }}'
    path = write(TYPES.replace(", n = 0", "").replace("SIGNAL", line))
    assert check(path, fmus=foreign) == []
    assert run(path, fmus=foreign)["a.n_out"][0] == end


@pytest.mark.parametrize(
    ("name", "values", "how", "words"),
    [
        ("n", [0, 1], "linear", 'an input of type Integer cannot be interpolated. Write `interpolation = "hold"`'),
        ("n", [0, 1.5], "hold", "1.5 found, a value of type Integer is expected"),
        ("n", [0, 3e9], "hold", "3e+09 found, -2147483648 to 2147483647 expected"),
        ("flag", [0, 2], "hold", "2 found, a value of type Boolean is expected"),
        ("mode", [1, 4], "hold", "4 found, a value of type Enumeration is expected"),
        ("text", [1, 4], "hold", "a text cannot follow a signal"),
    ],
)
def test_whole_numbers_take_no_others(write, foreign, name, values, how, words):
    text = TYPES.replace(f", {name} = ", f", x{name} = ").replace("set = {", "set = { ")
    line = f'"a.{name}" = {{ times = [0, 1], values = {values}, interpolation = "{how}" }}'
    found = check(write(text.replace("SIGNAL", line)), fmus=foreign)
    assert sum(words in problem for problem in found) == 1, found
