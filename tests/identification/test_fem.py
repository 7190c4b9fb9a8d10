"""From tables of finite elements to plant and estimators: one energy, little smoothing, and words for what is wrong."""

from __future__ import annotations

from pathlib import Path

import mhe_signals
import numpy as np
import pytest
from c_code import driven, run
from fem_tables import CURRENTS, GAPS, columns, solved, write
from network_records import DT, LONG, SHORT, measured, static
from scipy.interpolate import CubicSpline

import gapsense
from gapsense._os.files import read_columns
from gapsense.actuators import table_actuator
from gapsense.estimators import ekf
from gapsense.fmi.components import kernel_parameters, own
from gapsense.identification.fem.model import left_of, reduce, smooth, to_map
from gapsense.identification.fem.reading import Given, read_solved
from gapsense.identification.least_squares import rms
from gapsense.identification.measurements.record import Reading
from gapsense.identification.parameter_set import parameter_names, parameters_of, read_values
from gapsense.kernels.layout import names

MAGNET = Path(__file__).parent / "records" / "lifting-magnet-static.csv"
TURNS = 900.0
GRID = solved(currents=CURRENTS[1:])


def read(file, **more):
    return read_solved(file, Reading(), Given(TURNS, **more))


def made(points, has_force=True):
    """The surface, for the gaps of the table."""
    return smooth(points, reduce(points, TURNS), float(GAPS[0]), float(GAPS[-1]), has_force)


def noisy(share, seed=11):
    """The same with noise of flux linkage, and three times as much of the force."""
    random = np.random.default_rng(seed)
    changed = {
        name: GRID[name] * (1.0 + size * random.standard_normal(GRID[name].size))
        for name, size in (("flux_linkage", share), ("force", 3.0 * share))
    }
    return {**GRID, **changed}


def of_map(file, lam, h):
    """Current and force of a map as a plant reads it: cubic splines, odd in the flux linkage."""
    table = read_columns(file)
    gaps, fluxes = np.unique(table["gap"]), np.unique(table["flux_linkage"])
    rows = table["current"].reshape(gaps.size, fluxes.size)
    assert (np.diff(rows, axis=1) > 0.0).all() and (rows[:, 0] == 0.0).all() and fluxes[0] == 0.0
    odd = CubicSpline([*-fluxes[:0:-1], *fluxes], np.hstack((-rows[:, :0:-1], rows)), axis=1)
    energy = odd.antiderivative()
    found = []
    for flux, gap in zip(lam, h):
        current, work = CubicSpline(gaps, odd(flux)), CubicSpline(gaps, energy(flux) - energy(0.0))
        found.append((current(gap), -work(gap, 1)))
    return np.array(found).T


def test_plant_has_flux_linkage_and_force_of_the_device_between_the_points_too(tmp_path):
    found = gapsense.fem(write(tmp_path / "t.csv", GRID), turns=TURNS, out=tmp_path / "sets" / "d.toml")
    assert found.passed and found.files[1:] == [tmp_path / "sets" / f"d_{name}.csv" for name in ("law", "map")]
    h, i = (x.ravel() for x in np.meshgrid(np.linspace(0.2e-3, 2.0e-3, 7), [0.2, 0.55, 0.9, 1.3], indexing="ij"))
    truth = columns(h, i)
    current, force = of_map(tmp_path / "sets" / "d_map.csv", truth["flux_linkage"], h)
    assert np.abs(current / i - 1.0).max() < 4e-3
    assert np.abs(force / truth["force"] - 1.0).max() < 8e-3


def test_table_without_noise_is_hardly_smoothed_and_what_the_reduced_model_leaves_is_told(tmp_path):
    points = read(write(tmp_path / "t.csv", GRID))
    smoothed, reduced = left_of(points, made(points)), left_of(points, reduce(points, TURNS))
    assert rms(smoothed.flux) < 4e-4 and rms(smoothed.force) < 4e-4
    assert 4e-3 < rms(reduced.flux) < 0.012 and 0.01 < rms(reduced.force) < 0.03  # of another network
    said = " ".join(f"{gapsense.fem(tmp_path / 't.csv', turns=TURNS)}".split())
    assert f"{100.0 * rms(reduced.flux):.2g} % of the flux linkage" in said and "leaks past a part of the core" in said


@pytest.mark.parametrize("share", [1e-3, 1e-2])
def test_noise_is_smoothed_as_far_as_it_goes_and_the_map_is_that_of_a_device(tmp_path, share):
    points, exact = read(write(tmp_path / "n.csv", noisy(share))), read(write(tmp_path / "t.csv", GRID))
    surface, sharp = made(points), made(exact)
    assert surface.numbers < sharp.numbers and to_map(surface).is_device
    assert 0.5 * share < rms(left_of(points, surface).flux) < 1.5 * share
    after, before = left_of(exact, surface), (points.flux_linkage / exact.flux_linkage - 1.0)
    assert rms(after.flux) < 0.75 * rms(before)
    assert rms(after.force) < 0.75 * 3.0 * share


def test_scattered_points_and_gaps_beyond_them(tmp_path):
    random = np.random.default_rng(8)
    h, i = random.uniform(0.1e-3, 2.1e-3, 150), random.uniform(0.05, 1.5, 150)
    found = gapsense.fem(write(tmp_path / "s.csv", columns(h, i)), turns=TURNS, out=tmp_path / "s.toml")
    assert found.passed
    inside = columns(np.array([0.4e-3, 1.0e-3, 1.7e-3]), np.array([1.2, 0.5, 1.0]))
    current, force = of_map(tmp_path / "s_map.csv", inside["flux_linkage"], inside["gap"])
    assert current == pytest.approx(inside["current"], rel=0.01) and force == pytest.approx(inside["force"], rel=0.03)


def test_one_current_tells_the_others_as_well_as_it_says(tmp_path):
    """By flux linkage and force together: they have one energy, of which the core is the only unknown."""
    one = solved(gaps=np.linspace(0.1e-3, 2.1e-3, 21), currents=np.array([1.2]))
    found = gapsense.fem(write(tmp_path / "one.csv", one), turns=TURNS, out=tmp_path / "one.toml")
    said = " ".join(str(found).split())
    assert "not told by one current" in said and "Solve at smaller currents too" in said
    half = columns(GAPS, np.full(GAPS.size, 0.6))
    current, _ = of_map(tmp_path / "one_map.csv", half["flux_linkage"], half["gap"])
    assert current == pytest.approx(half["current"], rel=0.04)


def test_lifting_magnet_of_others_from_its_inductances_and_forces():
    found = gapsense.fem(MAGNET, turns=957.0, current=1.2)
    points = read_solved(MAGNET, Reading(), Given(957.0, 1.2))
    left = left_of(points, reduce(points, 957.0))
    assert found.passed and points.gap.size == 20 and "left out" in str(found)  # flux of the armature
    assert rms(left.flux) < 3e-3 and rms(left.force) < 6e-3 and rms(left.current) < 4e-3
    values = {"stop.lower": 0.25e-3, "stop.upper": 5e-3, "gap.law": "table", "coil.turns": 957.0}
    assert values.items() <= found.parameters.items()


def test_column_that_is_named_counts_before_others():
    given = Given(957.0, 1.2)
    usual, named = (read_solved(MAGNET, Reading(names), given) for names in ({}, {"flux": "armature_flux"}))
    assert usual.flux_linkage[0] == pytest.approx(1.2 * 0.11954) and "`armature_flux`" in " ".join(usual.remarks)
    assert named.flux_linkage[0] == pytest.approx(957.0 * 1.4821e-4) and "`inductance`" in " ".join(named.remarks)


SAME = {
    "heads of COMSOL": lambda t, f: f.write_text(
        "% Model,x.mph\n% gap (mm),I0 (A),mf.linkage (mWb),mf.Forcez (N)\n" + "\n".join(rows(t)), encoding="utf-8"
    ),
    "a row of units": lambda t, f: f.write_text(
        "gap,current,flux_linkage,force\nmm,A,mWb,N\n" + "\n".join(rows(t)), encoding="utf-8"
    ),
    "aligned columns of COMSOL": lambda t, f: f.write_text(
        "% Model:    x.mph\n% gap (mm)   I0 (A)    mf.linkage (mWb)  mf.Forcez (N)\n"
        + "\n".join(row.replace(",", "   ") for row in rows(t)),
        encoding="utf-8",
    ),
    "units of Maxwell": lambda t, f: f.write_text(
        '"gap [mm]","I [A]","FluxLinkage [mWb]","Force_x [mNewton]"\n' + "\n".join(row + "e3" for row in rows(t)),
        encoding="utf-8",
    ),
    "positive forces": lambda t, f: write(f, {**t, "force": -t["force"]}),
    "opposite currents": lambda t, f: write(f, {**t, "current": -t["current"], "flux_linkage": -t["flux_linkage"]}),
    "inductances": lambda t, f: write(
        f, {**without(t, "flux_linkage"), "inductance": t["flux_linkage"] / t["current"]}
    ),
    "points without current": lambda t, f: write(f, solved()),
    "points that come twice": lambda t, f: write(f, {name: np.append(x, x[:3]) for name, x in t.items()}),
}


def rows(table):
    """Lines of numbers in the units of `write`."""
    return write(Path(table["file"]), without(table, "file")).read_text().splitlines()[1:]


def without(table, *names):
    return {name: x for name, x in table.items() if name not in names}


@pytest.fixture(scope="module")
def usual(tmp_path_factory):
    return gapsense.fem(write(tmp_path_factory.mktemp("usual") / "t.csv", GRID), turns=TURNS).parameters


def check_same(found, usual):
    assert found.passed
    for name, value in usual.items():
        if not name.endswith("file"):
            assert found.parameters[name] == (value if isinstance(value, str) else pytest.approx(value, rel=1e-5)), name


@pytest.mark.parametrize("name", SAME)
def test_ways_in_which_programs_write_the_same_table(tmp_path, usual, name):
    table = {**GRID, "file": tmp_path / "numbers.csv"} if "units" in name or "COMSOL" in name else GRID
    SAME[name](table, tmp_path / "t.csv")
    separator = " " if "aligned" in name else ","
    check_same(gapsense.fem(tmp_path / "t.csv", turns=TURNS, separator=separator), usual)


def test_half_of_a_symmetric_device_with_flux_of_one_turn_and_decimal_commas(tmp_path, usual):
    table = {**without(GRID, "flux_linkage"), "force": GRID["force"] / 2, "flux": GRID["flux_linkage"] / 2 / TURNS}
    file = write(tmp_path / "t.csv", table, ";", ",")
    check_same(gapsense.fem(file, turns=TURNS, symmetry=2, separator=";", decimal=","), usual)


def test_stroke_that_counts_from_the_open_stop(tmp_path, usual):
    file = write(tmp_path / "t.csv", {**GRID, "gap": 2.2e-3 - GRID["gap"], "force": -GRID["force"]})
    check_same(gapsense.fem(file, turns=TURNS, closed=2.2e-3), usual)


def test_table_without_forces_says_what_that_means(tmp_path):
    found = gapsense.fem(write(tmp_path / "t.csv", without(GRID, "force")), turns=TURNS)
    assert found.passed and "Solve for forces too" in str(found)


@pytest.mark.parametrize("currents", [CURRENTS[1:], CURRENTS], ids=["with current", "also without"])
def test_remanence_is_told_before_it_is_large(tmp_path, currents):
    """Half a percent of the largest flux linkage was taken for one of the current, without a word."""
    table = solved(currents=currents)
    left = table["flux_linkage"] + 5e-3 * table["flux_linkage"].max()
    told = [
        str(gapsense.fem(write(tmp_path / "t.csv", {**table, "flux_linkage": lam}), turns=TURNS))
        for lam in (left, table["flux_linkage"])
    ]
    assert ["remains without current" in text for text in told] == [True, False]


def test_few_gaps_are_no_reason_to_doubt_the_forces(tmp_path):
    coarse = solved(gaps=np.linspace(0.1e-3, 2.1e-3, 4), currents=np.linspace(0.1, 1.5, 4)[1:])
    assert gapsense.fem(write(tmp_path / "t.csv", coarse), turns=TURNS).passed


def test_force_that_is_not_the_slope_of_the_energy_is_doubted(tmp_path):
    found = gapsense.fem(write(tmp_path / "t.csv", {**GRID, "force": GRID["force"] / 2}), turns=TURNS)
    assert not found.passed and "0.5 times the slope of the energy" in " ".join(found.doubts)


@pytest.mark.parametrize(("name", "factor", "line"), [("flux_linkage", 0.85, 62), ("force", 1.3, 66)])
def test_wrong_point_is_named_by_its_line(tmp_path, name, factor, line):
    wrong = GRID[name].copy()
    wrong[line - 2] *= factor
    found = gapsense.fem(write(tmp_path / "t.csv", {**GRID, name: wrong}), turns=TURNS)
    assert not found.passed and f"line {line}, 1.1 mm" in " ".join(found.doubts)


def changed(name, change):
    """The table with some cells changed."""
    x = GRID[name].copy()
    x[change[0]] = change[1](x)
    return {**GRID, name: x}


WRONG = {
    "falls with current": (
        lambda: changed("flux_linkage", (17, lambda x: 0.9 * x[15])),
        ["line 19, 300 um, 750 mA: the flux linkage falls", "line 18 with less current, where it has to rise"],
    ),
    "rises with gap": (lambda: {**GRID, "gap": 2.1e-3 - GRID["gap"]}, ["the inductance rises with", "`--closed`"]),
    "other sign of flux": (
        lambda: {**GRID, "flux_linkage": -GRID["flux_linkage"]},
        ["line 2, 100 um, 125 mA, and 131 more", "one of the sign of the current expected"],
    ),
    "permanent magnet": (
        lambda: {name: np.append(x, last) for (name, x), last in zip(GRID.items(), (0.5e-3, 0.0, 0.1, 0.0))},
        ["line 134, 500 um, 0 A", "without current found, 0 expected"],
    ),
    "force of both signs": (
        lambda: changed("force", (5, lambda x: -x[5])),
        ["line 7, 100 um, 750 mA: a force of 158.8 N found", "the field can only close the gap"],
    ),
    "twice, and differently": (
        lambda: {name: np.append(x, x[3] * (2.0 if name == "force" else 1.0)) for name, x in GRID.items()},
        ["the force of this point is another one in line 5", "Remove one of them"],
    ),
    "two gaps": (lambda: solved(gaps=GAPS[:2]), ["2 gaps found, at least 4 expected"]),
    "no current": (lambda: without(GRID, "current"), ["no column of the current in A", "`--current 1.2`"]),
    "no flux": (lambda: without(GRID, "flux_linkage"), ["no column of the flux linkage in Wb", "`inductance [mH]`"]),
    "two units": (
        lambda: {**GRID, "gap": 1e3 * GRID["gap"], "flux_linkage": 1e6 * GRID["flux_linkage"]},
        ["the largest position is 2.1 m", "the largest flux linkage is 2.437e+05 Wb", "Correct the unit in the head"],
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_wrong_table_is_refused_with_place_and_remedy_and_nothing_is_written(tmp_path, name):
    make, said = WRONG[name]
    file = write(tmp_path / "t.csv", make())
    with pytest.raises(ValueError, match=r"t\.csv") as error:
        gapsense.fem(file, turns=TURNS, out=tmp_path / "sets" / "d.toml", figure=tmp_path / "f.png")
    assert all(text in str(error.value) for text in said), str(error.value)
    assert [*tmp_path.iterdir()] == [file]


TEXT = "gap [mm],current [A],flux_linkage [mWb],force [N]\n"
UNREAD = {
    "cells without numbers": (
        TEXT + "0.1,1,200,-3\n0.2,abc,190,-2\n0.3,,180,nan\n0.4,1,inf,-1\n",
        [
            "line 3, column 2 (`current`): `abc`",
            "line 4, column 2 (`current`): ``",
            "line 4, column 4 (`force`): `nan`",
        ],
    ),
    "heads without units": (
        "gap,current,flux_linkage [mWb],force [kgf]\n0.1,1,200,-3\n",
        ["`gap` has no unit; m is expected", "`current` has no unit", "`force` has the unit `kgf`; N is expected"],
    ),
    "short lines and no current": (
        TEXT.replace("current [A]", "x2 [1]") + "0.1,1,2\n0.2,1,3,4\n",
        ["line 2: 3 values"],
    ),
    "semicolons": (TEXT.replace(",", ";") + "0.1;1;2;3\n", ['Add `--separator ";"`']),
    "blanks": ("% gap (mm)  I0 (A)  L (H)\n0.1   1.0   0.2\n", ['Add `--separator " "`', "two blanks between heads"]),
    "several gaps": (
        TEXT.replace("force [N]", "air_gap [mm]") + "0.1,1,2,3\n",
        ["Choose one: `--column position=gap`"],
    ),
    "no heads": ("0.1,1,200,-3\n0.2,1,190,-2\n", ["no heads above rows of numbers", "`gap [mm]`"]),
    "nothing": ("", ["no heads above rows of numbers"]),
    "binary": ("\x00\x01\x02", ["no heads above rows of numbers"]),
}


@pytest.mark.parametrize("name", UNREAD)
def test_file_that_cannot_be_read_is_refused_with_all_its_problems(tmp_path, name):
    text, said = UNREAD[name]
    (tmp_path / "t.csv").write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match=r"t\.csv") as error:
        gapsense.fem(tmp_path / "t.csv", turns=TURNS)
    assert all(each in str(error.value) for each in said), str(error.value)


def test_turns_are_asked_for(tmp_path):
    file = write(tmp_path / "t.csv", GRID)
    with pytest.raises(ValueError, match=r"`coil\.turns`"):
        gapsense.fem(file)
    found = gapsense.fem(file, assume=True, out=tmp_path / "d.toml")
    assert found.parameters["coil.turns"] == 1200.0
    marked = 'assumed = ["coil.turns", "stop.lower", "stop.upper", "core.eddy", "core.turnover"]'
    assert marked in (tmp_path / "d.toml").read_text()


def health_of_ekf(file, eddy):
    """Its mean from 5 ms on, with 6 mA of noise, on a plant with eddy currents that the table does not tell [S]."""
    values = read_values([file])
    plant, par = (
        kernel_parameters(folder, {n: v for n, v in values.items() if n in parameter_names([folder])})
        for folder in (own("table_actuator"), own("ekf"))
    )
    plant = plant._replace(eddy_currents=1.0, core_eddy_conductance=eddy * par.coil_turns**2)
    par = par._replace(noise_current=6e-3)
    u, dt = np.r_[np.zeros(100), np.full(800, 12.0), np.zeros(1000)], par.sample_time
    i, mode = driven(table_actuator, plant, u, dt, "current", "mode").T
    rows = {"time": dt * np.arange(u.size), "voltage": np.r_[0.0, u[:-1]], "mode": mode}
    rows["current"] = i + par.noise_current * np.random.default_rng(8).standard_normal(u.size)
    columns = [rows.get(name, np.zeros(u.size)) for name in names(ekf.Inputs)]
    found = run(ekf, np.column_stack(columns), par)
    return found[100:, names(ekf.Outputs).index("health")].mean()


def from_table(folder, magnet, more=None, seed=1):
    """Error of the position of `Mhe` in the first closing, from one current of the table and the data sheet [um]."""
    plant, gaps = magnet.plant, np.linspace(0.25e-3, 0.25e-3 + magnet.stroke, 20)
    lam, F = np.array([static(h, 1.2) for h in gaps]).T
    table = write(folder / "t.csv", {"gap": gaps, "current": np.full(20, 1.2), "flux_linkage": lam, "force": F})
    known = {name: x for name, x in magnet.set.items() if name.startswith(("coil", "mover", "spring", "damping"))}
    known |= {"coil.resistance": 10.0, "mover.mass": plant.mover_mass, "spring.stiffness": plant.spring_stiffness}
    known |= {"stop.lower": plant.stop_lower, "stop.upper": plant.stop_upper, **(more or {})}
    lines = [f'"{name}" = {value}\n' for name, value in known.items()]
    (folder / "known.toml").write_text("[values]\n" + "".join(lines), encoding="utf-8")
    gapsense.fem(table, parameters=folder / "known.toml", supply=12.0, out=folder / "m.toml")
    record, z = measured(magnet, pulses=1, seed=seed)
    par = parameters_of("mhe", folder / "m.toml")._replace(sample_time=DT)
    par = par._replace(window_longest=min(par.window_longest, 1998 * DT))
    found = mhe_signals.run(par, mhe_signals.rows(record.voltage, record.current, dt=DT))["position"]
    inside = slice(np.flatnonzero(record.voltage > 1.0)[0], np.flatnonzero(z <= plant.stop_lower)[0])
    return 1e6 * rms((found - z)[inside])


@pytest.mark.parametrize(
    ("magnet", "volts"), [pytest.param(LONG, 12.0, marks=pytest.mark.slow), (LONG, 14.0), (SHORT, 12.0)]
)
def test_first_currents_tell_eddy_currents_that_no_table_tells(tmp_path, magnet, volts):
    """0.5 mS were believed, of 4.4 mS, and the position was 1.2, 1.4 and 4.5 % of the stroke off until the landing."""
    assert from_table(tmp_path, magnet._replace(volts=volts)) < 0.005e6 * magnet.stroke


@pytest.mark.slow
def test_windows_of_mhe_come_from_a_trial_at_the_supply(tmp_path):
    known = tmp_path / "known.toml"
    known.write_text(
        '[values]\n"coil.turns" = 957\n"coil.resistance" = 10.0\n"mover.mass" = 26e-3\n"spring.stiffness" = 0.0\n'
        '"spring.rest" = 5e-3\n"damping" = 0.0\n"stop.lower" = 0.25e-3\n"stop.upper" = 5e-3\n'
    )
    found = gapsense.fem(MAGNET, current=1.2, supply=12.0, parameters=known, out=tmp_path / "m.toml")
    values = found.parameters
    assert values["sample_time"] == 50e-6 and values["window.tail"] == pytest.approx(12.7e-3, rel=0.02)
    assert values["window.longest"] == pytest.approx(2.0 * (12.7e-3 + 12.7e-3), rel=0.02)
    assert values["model.error"] == pytest.approx(3.4e-3, rel=0.05)
    par = parameters_of("mhe", tmp_path / "m.toml")
    assert par.window_tail == values["window.tail"] and len(par.gap_file_gap) > 50
    assert 'assumed = ["core.eddy", "core.turnover", "process.current_error"]' in (tmp_path / "m.toml").read_text()
    assert values["core.turnover"] == pytest.approx(0.07 * values["core.saturation"], rel=1e-3)
    more, values = tmp_path / "more.toml", '"window.tail" = 9e-3\n"core.eddy" = 3e-3\n"process.current_error" = 0.01\n'
    values += '"core.turnover" = 9e-3\n'
    more.write_text(known.read_text() + values)
    gapsense.fem(MAGNET, current=1.2, supply=12.0, parameters=more, out=tmp_path / "given.toml")
    kept = read_values([tmp_path / "given.toml"])
    assert (kept["window.tail"], kept["core.eddy"], kept["process.current_error"]) == (9e-3, 3e-3, 0.01)
    assert "prior.eddy" not in kept and "assumed" not in (tmp_path / "given.toml").read_text()
    assert health_of_ekf(tmp_path / "m.toml", eddy=4.4e-3) > 0.99  # before there was process noise, it was 0.18
    weak = gapsense.fem(MAGNET, current=1.2, supply=1e-3, parameters=known)
    assert "window.tail" not in weak.parameters and "does not close within" in str(weak)
