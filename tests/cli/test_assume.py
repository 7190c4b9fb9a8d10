"""What no record tells is asked for by name, or assumed, listed and marked, by every command that reads records."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

from gapsense._os.files import write_columns
from gapsense.identification.parameter_set import read_sets
from gapsense.studies.devices import VALVE

sys.path.append(str(Path(__file__).parents[1] / "identification"))
from valve_records import columns, write

PAR = VALVE._replace(
    stop_upper=1.36e-3, initial_position=1.36e-3, gap_slope=1.6e10, spring_rest=9e-3, spring_stiffness=60
)
KNOWN = {"stop.lower": 0.0, "stop.upper": 1.36e-3, "gap.slope": 1.6e10, "spring.rest": 9e-3}
QUICK = ("--voltage", "trapezoid", "--forms", "plain", "--starts", "1")


def known(file="known.toml", without=(), assumed=(), **more):
    """A parameter set with what a user knows of the valve."""
    values = {name: x for name, x in {**KNOWN, **more}.items() if name not in without}
    marks = [f"assumed = {[*assumed]}".replace("'", '"')] if assumed else []
    Path(file).write_text("\n".join([*marks, "[values]", *(f'"{n}" = {x!r}' for n, x in values.items()), ""]))
    return "--parameters", file


def stated(name):
    """Standard error of a parameter in the written file, in percent."""
    lines = Path("valve.toml").read_text(encoding="utf-8").splitlines()
    line = next(line for line in lines if line.replace('"', "").startswith(f"{name} ="))
    return float(line.split("+- ")[1].split(" %")[0])


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """A record of a valve that is not that of Table I."""
    return write(tmp_path_factory.mktemp("recorded") / "valve.csv", par=PAR, seed=1)


@pytest.fixture(autouse=True)
def valve(recorded, tmp_path):
    """The record, in the working folder."""
    shutil.copy(recorded, tmp_path)


@pytest.mark.parametrize("model", [(), ("--model", "solenoid_valve")])
def test_identify_asks_for_all_that_no_record_tells(gapsense, model):
    done = gapsense("identify", "valve.csv", *model)
    assert done.exit_code == 2 and not done.stdout and not Path("valve.toml").exists()
    assert all(f"`{name}` (" in done.stderr for name in KNOWN), done.stderr
    assert "in m)" in done.stderr and "in 1/(H.m))" in done.stderr and "--assume" in done.stderr
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize("name", KNOWN)
def test_identify_asks_by_name_for_what_a_file_leaves_out(gapsense, name):
    done = gapsense("identify", "valve.csv", *known(without=[name]), "--model", "solenoid_valve")
    assert done.exit_code == 2 and f"known.toml: `{name}` (" in done.stderr
    assert not any(f"`{other}` (" in done.stderr for other in KNOWN if other != name), done.stderr


@pytest.mark.parametrize(
    ("arguments", "asked", "not_asked"),
    [
        (("--hold", "coil.turns"), ["coil.turns"], ["gap.slope"]),
        (("--hold", "mover.mass,damping"), ["mover.mass", "damping", "gap.slope"], ["coil.turns"]),
        (("--inductance", "inductance.csv"), ["coil.turns"], ["gap.slope"]),
    ],
)
def test_what_is_held_or_measured_decides_what_is_asked_for(gapsense, arguments, asked, not_asked):
    without = {"without": ["gap.slope"]}
    done = gapsense("identify", "valve.csv", *known(**without), "--model", "solenoid_valve", *arguments)
    assert done.exit_code == 2 and all(f"`{name}` (" in done.stderr for name in asked), done.stderr
    assert not any(f"`{name}` (" in done.stderr for name in not_asked), done.stderr


def test_position_replaces_the_gap_law_but_not_the_turns(gapsense, tmp_path):
    heads = "time [s],voltage [V],current [A],position [m]"
    write(tmp_path / "moved.csv", columns(par=PAR, seed=1, gap_noise=1e-6), heads)
    done = gapsense("identify", "moved.csv", *known(without=["gap.slope"]), *QUICK)
    assert done.exit_code == 2 and "`coil.turns` (" in done.stderr and "`gap.slope` (" not in done.stderr


def test_fringing_law_has_parameters_of_its_own(gapsense):
    law = known(without=["gap.slope"], **{"gap.law": "fringing"})
    done = gapsense("identify", "valve.csv", *law, "--model", "solenoid_valve")
    assert done.exit_code == 2 and "`gap.area` (" in done.stderr and "`gap.window` (" in done.stderr


def test_assumed_values_are_listed_marked_and_uncertain_and_estimate_repeats_them(gapsense, fmus):
    done = gapsense("identify", "valve.csv", "--assume", *QUICK)
    assert done.exit_code == 0, done.output
    file = Path("valve.toml").read_text(encoding="utf-8")
    values, assumed = read_sets([Path("valve.toml")])
    assert {*KNOWN, "stop.restitution"} == {*assumed}
    said = " ".join(done.stdout.split())
    assert "Assumed, neither given nor found in the records" in said
    assert "stop.upper 900 um a factor of 2" in said and "parts of the stroke" in said
    for line in file.splitlines():
        assert ("# assumed" in line) == any(line.startswith(f'"{name}" =') for name in assumed), line
    wide = {name: np.log(getattr(PAR, name.replace(".", "_")) / values[name]) for name in ("mover.mass", "damping")}
    for name, off in wide.items():
        error = stated(name)
        assert abs(off) < 0.02 * error and error > 50.0, (name, off, error)
    options = ("--parameters", "valve.toml", "--estimator", "mhe", "--fmus", fmus)
    told = gapsense("estimate", "valve.csv", *options)
    assert told.exit_code == 0, told.output
    said = " ".join(told.stdout.split())
    assert "Only assumed in the parameter file:" in said and "parts of the stroke" in said
    assert all(f"`{name}` = " in said for name in assumed), said


def test_marks_stay_marks(gapsense):
    """A file with assumed values is no knowledge for whoever reads it, but a later file that gives them is."""
    marked = known(assumed=["stop.upper"])
    done = gapsense("identify", "valve.csv", *marked, "--model", "solenoid_valve")
    assert done.exit_code == 2 and "known.toml: `stop.upper` (" in done.stderr and "`spring.rest` (" not in done.stderr
    done = gapsense("identify", "valve.csv", *marked, *QUICK, "--assume", "--out", "again.toml")
    assert done.exit_code == 0 and {*read_sets([Path("again.toml")]).assumed} == {"stop.upper", "stop.restitution"}
    assert read_sets([Path("again.toml")]).values["stop.upper"] == 1.36e-3
    known("more.toml", without=[*KNOWN][2:])
    assert read_sets([Path("again.toml"), Path("more.toml")]).assumed == ("stop.restitution",)


def test_mark_without_a_value_is_refused(gapsense):
    done = gapsense("identify", "valve.csv", *known(assumed=["stop.uper"]))
    assert done.exit_code == 2 and "assumed: `stop.uper` has no value" in done.stderr and "`stop.upper`" in done.stderr


@pytest.mark.slow
def test_accuracy_of_what_is_given_goes_into_the_errors_of_what_depends_on_it(gapsense):
    def error(name, *options):
        done = gapsense("identify", "valve.csv", *known(**{"stop.restitution": 0.0}), *QUICK, *options)
        assert done.exit_code == 0 and "Assumed" not in done.output, done.output
        assert not read_sets([Path("valve.toml")]).assumed
        return stated(name)

    exact = {name: error(name) for name in ("coil.turns", "mover.mass")}
    slope = {name: error(name, "--accuracy", "gap.slope=6") for name in exact}
    assert slope["coil.turns"] == pytest.approx(np.hypot(3.0, exact["coil.turns"]), rel=0.02)
    assert slope["mover.mass"] == pytest.approx(exact["mover.mass"], rel=0.02)
    assert error("mover.mass", "--accuracy", "stop.upper=6") > 5.0


def test_accuracy_of_what_does_not_exist_is_refused(gapsense):
    done = gapsense("identify", "valve.csv", *known(), "--accuracy", "stop.uper=2")
    assert done.exit_code == 2 and "--accuracy: `stop.uper=2` found" in done.stderr and "stop.upper=" in done.stderr


def test_start_values_of_an_estimator_that_nobody_gave_are_listed(gapsense, fmus):
    known(without=["stop.upper", "stop.lower"], **{"coil.resistance": 76.0})
    done = gapsense("estimate", "valve.csv", "--parameters", "known.toml", "--estimator", "mhe,semera", "--fmus", fmus)
    said = " ".join(done.stdout.split())
    (mhe,) = [line for line in done.stdout.splitlines() if line.startswith("Mhe, not given")]
    assert "`stop.upper` = 1.4 mm" in mhe and "`mover.mass` = 0.0016 kg" in mhe and "coil.resistance" not in mhe
    assert "Semera, not given" in said and "`noise.current`" in said


def test_fmus_are_built_with_assumed_values_but_not_without_a_word(gapsense, monkeypatch, tmp_path):
    known(assumed=["stop.upper"])
    monkeypatch.chdir(Path(__file__).resolve().parents[2])
    done = gapsense("build", "semera", "ekf", "--parameters", tmp_path / "known.toml", "--out", tmp_path / "built")
    assert done.exit_code == 0 and "the parameter file only assumes `stop.upper`" in done.stderr


def test_gap_law_asks_for_the_turns_and_marks_what_rests_on_assumed_ones(gapsense):
    table = Path(__file__).parents[1] / "identification" / "records" / "takaha-inductance.csv"
    done = gapsense("gap-law", table)
    assert done.exit_code == 2 and "`coil.turns` (" in done.stderr and "--turns" in done.stderr
    done = gapsense("gap-law", table, "--assume")
    assert done.exit_code == 0 and "Assumed: `coil.turns` = 1200" in done.stdout
    assert read_sets([Path("gap.toml")]).assumed == ("coil.turns", "gap.file")
    again = gapsense("identify", "valve.csv", "--parameters", "gap.toml", "--model", "solenoid_valve")
    assert again.exit_code == 2 and "`gap.file` (" in again.stderr and "`stop.upper` (" in again.stderr


@pytest.mark.slow
def test_coil_of_unknown_turns_is_marked(gapsense, tmp_path):
    k = np.arange(1200)
    u = np.where((k > 100) & (k % 600 > 120) & (k % 600 < 280), 10.0, 0.0)
    i = np.zeros(k.size)
    for n in range(1, k.size):
        i[n] = i[n - 1] + 20e-6 * (0.5 * (u[n] + u[n - 1]) - 20.0 * i[n - 1]) / 10e-3
    noise = np.random.default_rng(1).standard_normal((2, k.size))
    signals = {"time [s]": 20e-6 * k, "voltage [V]": u + 0.01 * noise[0], "current [A]": i + 1e-3 * noise[1]}
    with (tmp_path / "coil.csv").open("w") as text:
        write_columns(text, signals)
    known("some.toml")  # without turns
    for options, is_known in (
        ((), False),
        (("--parameters", "some.toml"), False),
        (known("n.toml", **{"coil.turns": 300.0}), True),
    ):
        done = gapsense("identify", "coil.csv", *options, "--out", "coil.toml")
        assert done.exit_code == 0 and "No motion" in done.output, done.output
        values, assumed = read_sets([Path("coil.toml")])
        assert values["coil.turns"] == (300.0 if is_known else 1.0)
        assert assumed == (() if is_known else ("coil.turns",))
        assert ("`coil.turns` is assumed" in done.output) != is_known
