"""The benchmark of all estimators: its measures on constructed signals, what the estimators are told, and its runs."""

from pathlib import Path
from shutil import copytree

import numpy as np
import pytest
from matplotlib.image import imread
from typer.testing import CliRunner
from valve_signals import exact

from gapsense.cli import app
from gapsense.cosim import load, prepare, run
from gapsense.cosim.result.result import Result, Run, Timing
from gapsense.cosim.scenario.records import recorded_signals
from gapsense.estimators import hybrid_ekf
from gapsense.fmi.components import kernel_parameters
from gapsense.report import plot as figures
from gapsense.report.table import text as plain_text
from gapsense.scenarios.estimators import core, scenario
from gapsense.scenarios.estimators import measures as benchmark
from gapsense.scenarios.estimators import parameters as known
from gapsense.scenarios.estimators import show as drawn
from gapsense.scenarios.estimators.contenders import CONTENDERS, EKF, Contender
from gapsense.studies import drawer
from gapsense.studies.devices import RTS_VALVE

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "scenarios" / "estimators"
STEP, LOW, HIGH = 1e-3, 0.4e-3, 1.4e-3
FILTER = Contender("a filter", "it", {"position": "position", "velocity": "velocity"}, "")
SMOOTHER = Contender("a smoother", "it", {"position": "smoothed"}, "", published="published", time="about")
LIFT = FILTER._replace(is_lift=True)


def made(mode, position, signals=None):
    """A result with a true position, what an estimator `it` gives, and a first cycle of 4 ms."""
    rows = len(mode)
    about = Run(
        "", "made", None, "", 0.0, (rows - 1) * STEP, STEP, 1, {}, {"it": {"step": 1, "offset": 0}}, (), (), {}, {}
    )
    given = {f"it.{name}": np.asarray(values, float) for name, values in (signals or {}).items()}
    true = {"actuator.mode": np.asarray(mode, float), "actuator.position": np.asarray(position, float)}
    parameters = {
        "actuator.stop.lower": LOW,
        "actuator.stop.upper": HIGH,
        "actuator.coil.resistance": 48.0,
        "drive.profile.half_period": 2e-3,
    }
    timing = {"it": Timing(1e-3, 100)}
    return Result(about, STEP * np.arange(rows), {**true, **given}, {}, parameters, timing, 1.0)


#       0    1    2    3    4    5    6    7    8    9   10   11   12   13   14   15   16   17
MODE = [3, 2, 1, 1, 2, 2, 3, 3, 3, 3, 2, 2, 1, 1, 1, 1, 2, 3]
PLACE = [1.4, 1.0, 0.4, 0.4, 0.6, 1.0, 1.4, 1.4, 1.4, 1.4, 1.1, 0.7, 0.4, 0.4, 0.4, 0.4, 0.9, 1.4]
POSITION = 1e-3 * np.array(PLACE)


def test_landings_count_from_the_second_cycle_on_if_the_mover_leaves_again():
    assert benchmark.rests(made(MODE, POSITION)) == [8, 14]


@pytest.mark.parametrize(("shift", "lost"), [(0.0, 0), (0.09e-3, 0), (0.11e-3, 2), (-0.5e-3, 2), (np.nan, 2)])
def test_a_landing_is_missed_a_tenth_of_the_stroke_away(shift, lost):
    result = made(MODE, POSITION, {"position": POSITION + shift, "velocity": 0.0 * POSITION})
    found = benchmark.numbers(result, FILTER)
    assert (found["landings"], found["missed"]) == (2, lost)


def test_only_the_middle_of_the_rest_decides():
    late = np.where(np.arange(18) < 14, POSITION[9], POSITION)  # at the second stop only when half of the rest is over
    assert benchmark.numbers(made(MODE, POSITION, {"position": late, "velocity": late}), FILTER)["missed"] == 0
    late[14] = POSITION[9]
    assert benchmark.numbers(made(MODE, POSITION, {"position": late, "velocity": late}), FILTER)["missed"] == 1


def test_a_landing_is_not_missed_that_may_still_be_published_when_the_run_ends():
    slow = smoothed([(14, 4), (15, 5), (16, 6)])  # ten rows late: rows 10 and 11 would come after the end
    found = benchmark.numbers(made(MODE, POSITION, slow), SMOOTHER)
    assert (found["landings"], found["missed"]) == (1, 0)
    fast = smoothed([(7, 4), (8, 5), (9, 6)])  # three rows late: they should have come
    found = benchmark.numbers(made(MODE, POSITION, fast), SMOOTHER)
    assert (found["landings"], found["missed"]) == (2, 1)


def test_errors_are_those_in_motion_from_the_second_cycle_on():
    off = np.zeros(18)
    off[[1, 4]] = 1.0  # in motion, but in the first cycle
    off[[7, 13]] = 1.0  # at rest
    off[[5, 10]] = 3e-6, 4e-6
    result = made(MODE, POSITION, {"position": POSITION + off, "velocity": np.diff(POSITION, prepend=0.0) / STEP})
    found = benchmark.numbers(result, FILTER)
    assert found["position"] == pytest.approx(np.sqrt((9e-12 + 16e-12) / 4))  # rows 5, 10, 11, 16
    assert found["velocity"] == pytest.approx(0.0, abs=1e-15)
    assert np.isnan(found["flux_linkage"]) and np.isnan(found["resistance"])
    assert (found["latency"], found["after_landing"], found["cost"]) == (0.0, 0.0, pytest.approx(10.0))


def test_a_lift_counts_from_the_upper_stop_down():
    signals = {"position": HIGH - POSITION, "velocity": -np.diff(POSITION, prepend=0.0) / STEP}
    found = benchmark.numbers(made(MODE, POSITION, signals), LIFT)
    assert (found["position"], found["missed"]) == (pytest.approx(0.0, abs=1e-15), 0)
    assert found["velocity"] == pytest.approx(0.0, abs=1e-12)


def smoothed(pairs):
    """Signals of a smoother that publishes at the first row of each pair what is about the second."""
    published, about, values = np.zeros(18), STEP * np.arange(18), np.zeros(18)
    for came, row in pairs:
        published[came], about[came], values[came] = 1.0, STEP * row, POSITION[row]
    return {"published": published, "about": about, "smoothed": values}


def test_what_is_published_later_is_held_against_the_sample_that_it_is_about():
    result = made(MODE, POSITION, smoothed([(7, 4), (8, 5), (14, 10), (15, 11)]))
    samples = benchmark.lined_up(result, SMOOTHER)
    assert samples.came.tolist() == [7, 8, 14, 15]
    assert samples.about.tolist() == [4, 5, 10, 11]
    found = benchmark.numbers(result, SMOOTHER)
    assert found["position"] == pytest.approx(0.0, abs=1e-15)
    assert found["latency"] == pytest.approx(3.5e-3)  # median of 3, 3, 4, 4 ms
    assert found["after_landing"] == pytest.approx(2.5e-3)  # landed at rows 6 and 12, complete at 8 and 15


def test_a_motion_that_is_not_published_completely_does_not_count_for_the_wait():
    result = made(MODE, POSITION, smoothed([(7, 4), (14, 10), (15, 11)]))
    assert benchmark.numbers(result, SMOOTHER)["after_landing"] == pytest.approx(3e-3)
    nothing = benchmark.numbers(made(MODE, POSITION, smoothed([])), SMOOTHER)
    assert np.isnan(nothing["latency"]) and np.isnan(nothing["after_landing"]) and np.isnan(nothing["position"])
    assert nothing["missed"] == 2


def test_a_smoother_has_landed_where_its_last_estimate_of_the_motion_is():
    signals = smoothed([(7, 4), (8, 5), (14, 10), (15, 11)])
    signals["smoothed"][[8, 15]] = HIGH, LOW
    assert benchmark.numbers(made(MODE, POSITION, signals), SMOOTHER)["missed"] == 0
    signals["smoothed"][15] = HIGH
    assert benchmark.numbers(made(MODE, POSITION, signals), SMOOTHER)["missed"] == 1


def test_files_of_the_scenario_are_what_the_functions_give(tmp_path):
    shipped = (FOLDER / "scenario.toml").read_text()
    emptied = scenario.PART.sub(r"\1\3", shipped)
    assert len(scenario.PART.findall(shipped)) == len(scenario.parts())
    assert "ertss" not in emptied.partition("[baseline]")[0]
    (tmp_path / "scenario.toml").write_text(emptied)
    scenario.write(tmp_path)
    tables = ["gap_19.csv", "gap_19_other_gap.csv", "gap_19_other_table.csv", "rows_10.csv", "rows_5.csv"]
    assert sorted(p.name for p in tmp_path.iterdir()) == [*tables, "scenario.toml"]
    for file in tmp_path.iterdir():
        assert file.read_text() == (FOLDER / file.name).read_text()


def test_a_contender_that_joins_is_one_entry(monkeypatch, fmus, tmp_path):
    wires = {**EKF.wires, "current": "hybrid_ekf.current_estimated"}  # what another contender gives
    joins = EKF._replace(label="another", component="another", options={"process.flux_linkage": 1e-5}, wires=wires)
    for module in (scenario, benchmark, drawn):
        monkeypatch.setattr(module, "CONTENDERS", (*CONTENDERS, joins))
    (tmp_path / "scenarios").mkdir()
    folder = Path(copytree(FOLDER, tmp_path / "scenarios" / "estimators"))
    copytree(ROOT / "scenarios" / "profiles", tmp_path / "scenarios" / "profiles")
    scenario.write(folder)
    read = load(folder, "together")
    assert read.components["another"].values["process.flux_linkage"] == 1e-5
    assert read.components["another"].values["noise.current"] == 0.02
    assert "another.mover.mass" in map(str, read.rows[0])
    benchmark.require(recorded_signals(*prepare(folder, None, fmus)), "made")
    assert "| another | " in drawn.markdown({None: runs(), "warm": runs()})
    labels = [label.get_text() for label in drawn.conditions({None: runs()}).axes[0].get_yticklabels()]
    assert labels == [c.label for c in drawn.CONTENDERS if "position" in c.gives] and "another" in labels
    assert imread(figures.save(drawn.conditions({None: runs()}), tmp_path / "conditions.png")).std() > 0.01


def test_estimators_of_the_plain_scenario_know_the_valve():
    components = load(FOLDER).components
    for name, value in scenario.beliefs(known.VALVE).items():
        component, _, parameter = name.partition(".")
        assert components[component].values[parameter] == pytest.approx(value, rel=1e-9), name
    rows = load(FOLDER, "wrong_5").rows
    varied = known.wrong(np.linspace(0.02, 0.05, 8))  # equal ones may cancel
    right, wrong = scenario.beliefs(known.VALVE), scenario.beliefs(varied)
    assert {str(port) for port in rows[0]} == {name for name in right if right[name] != wrong[name]}
    assert len(rows) == scenario.DRAWS
    for row in rows:
        mass = {value for port, value in row.items() if port.variable == "mover.mass"}
        assert len(mass) == 1 and mass.pop() == pytest.approx(RTS_VALVE.mover_mass, rel=0.05)


@pytest.mark.parametrize("variant", known.DEVICES)
def test_estimators_are_told_of_another_device(variant):
    """The plant and all its estimators have every number of it, those that are not as before in the variant."""
    read, valve = load(FOLDER, variant), known.DEVICES[variant]
    for name, value in {
        **{f"actuator.{n}": v for n, v in known.plant(valve).items()},
        **scenario.beliefs(valve),
    }.items():
        component, _, parameter = name.partition(".")
        assert read.components[component].values[parameter] == pytest.approx(value, rel=1e-9), name
    file = Path(read.components["bounded_ukf"].values["gap.file"])
    gaps, reluctances, slopes = np.loadtxt(file, delimiter=",", skiprows=1).T
    assert (gaps[0], gaps[-1]) == (valve.lower, valve.upper)
    for gap, *law in zip(gaps, reluctances, slopes):
        assert law == pytest.approx(known.gap_law(gap, valve), rel=1e-9)


def test_the_other_table_is_that_of_semera():
    valve = known.DEVICES["other_table"]
    assert (valve.resistance, valve.stiffness, valve.rest, valve.damping) == (76.0, 37.0, 22.5e-3, 0.4)
    circuit = exact()
    assert (valve.slope, valve.fringing, valve.window) == pytest.approx(
        (circuit.gap_slope, circuit.gap_fringing, circuit.gap_window)
    )


@pytest.mark.slow  # the record is commissioned
def test_core_with_losses_is_what_a_record_gives(fmus):
    found = core.of_scenario(FOLDER)
    assert found == pytest.approx(known.CORE, rel=3e-3)
    conductance = RTS_VALVE.core_eddy_conductance / RTS_VALVE.coil_turns**2
    assert found.eddy == pytest.approx(conductance, rel=0.15)


def test_wrong_core_with_losses_is_as_wrong_as_the_one_without():
    valve = known.wrong([0, 0, 0, 0, 0.03, -0.02, 0.05, 0])
    ekf, ukf = known.reduced_core(valve), known.tabulated_core(valve)
    assert ekf["core.bend"] == pytest.approx(1.03 * known.CORE.bend)
    assert ekf["core.saturation"] == ukf["core.saturation"] == pytest.approx(0.98 * known.CORE.saturation)
    for name in ("core.reluctance", "core.bend"):
        assert ukf[name] / ukf["coil.turns"] ** 2 == pytest.approx(ekf[name] / known.VALVE.turns**2)
    assert ekf["core.eddy"] == ukf["core.eddy"] == known.CORE.eddy


def test_wrong_gap_is_the_same_for_a_formula_a_table_and_a_magnet():
    valve = known.wrong([0, 0, 0, 0, 0.03, 0, 0.05, 0])
    right, told = known.tabulated(known.VALVE), known.tabulated(valve)
    assert told["coil.turns"] ** -2 / right["coil.turns"] ** -2 == pytest.approx(1.05)
    of_core = told["core.reluctance"] / told["coil.turns"] ** 2, right["core.reluctance"] / right["coil.turns"] ** 2
    assert of_core[0] / of_core[1] == pytest.approx(1.03)
    assert known.reduced(valve)["gap.slope"] == pytest.approx(1.05 * RTS_VALVE.gap_slope)
    assert known.magnet(valve)["pole.area"] == pytest.approx(known.magnet(known.VALVE)["pole.area"] / 1.05)


def test_magnet_has_the_reluctance_and_the_force_of_the_valve():
    par = kernel_parameters(ROOT / "fmus" / "hybrid_ekf", load(FOLDER).components["hybrid_ekf"].values)
    m, v = hybrid_ekf.model(par), known.VALVE
    core = v.core / (1.0 - known.CORE_SHARE)
    for lift, gap in ((0.0, v.upper), (m.s_max, v.lower)):
        reluctance = v.turns**2 * (m.path + m.slope * lift) / m.K5
        assert reluctance == pytest.approx(known.gap_law(gap, v)[0] + core, rel=1e-6)
    lam, stroke = 0.015, v.upper - v.lower
    chord = (known.gap_law(v.upper, v)[0] - known.gap_law(v.lower, v)[0]) / stroke
    force = m.lift * (lam / m.K5) ** 2 * v.mass
    assert force == pytest.approx(0.5 * (lam / v.turns) ** 2 * chord, rel=1e-6)
    assert m.g * v.mass == pytest.approx(v.stiffness * (v.rest - 0.5 * (v.lower + v.upper)), rel=1e-6)


@pytest.fixture(scope="module")
def fmus(natives):
    """Native ones, which have the bits of the Python ones in all scenarios: tests/native/test_scenarios.py."""
    return natives


@pytest.fixture(scope="module")
def plain(fmus):
    return run(FOLDER, None, fmus)


def core_share(position, flux_linkage, current):
    """Share of saturation at which a constant core explains the currents best, in least squares; the gap's chord."""
    v = known.VALVE
    (low, _), (high, _) = known.gap_law(v.lower, v), known.gap_law(v.upper, v)
    gap = low + (position - v.lower) * (high - low) / (v.upper - v.lower)
    core = (v.turns**2 * current - gap * flux_linkage) @ flux_linkage / (flux_linkage @ flux_linkage)
    return 1.0 - v.core / core


def test_core_of_the_magnet_is_fitted_to_the_first_motions(plain):
    rows = benchmark.is_moving(plain) & (plain.times < benchmark.learnt(plain))
    share = core_share(*(plain[f"actuator.{s}"][rows] for s in ("position", "flux_linkage", "current")))
    assert share == pytest.approx(known.CORE_SHARE, abs=1e-3)


@pytest.mark.slow
def test_plain_run(plain, tmp_path):
    found = benchmark.measure(plain)
    position = {c.component: found[f"{c.component}.position"] for c in CONTENDERS if "position" in c.gives}
    assert max(position["ertss"], position["no_current_error"]) < 8e-6 < 15e-6 < position["ekf"] < 40e-6
    assert all(
        60e-6 < position[name] < 110e-6 for name in ("open_loop", "bounded_ukf", "bounded_ukf_tuned", "hybrid_ekf")
    )
    assert max(position[f"mhe_{c}"] for c in ("smoothed", "commissioned", "commissioned_smoothed")) < 8e-6
    assert position["mhe"] < 15e-6
    for c in CONTENDERS:
        assert found[f"{c.component}.landings"] in ((4, 5) if c.published else (5,))  # the last may come later
        assert found[f"{c.component}.missed"] == 0 or "position" not in c.gives
        assert found[f"{c.component}.cost"] > 0
        assert (found[f"{c.component}.latency"] > 0) == bool(c.published)
    assert {"ertss", "no_current_error", "integral_offline"} <= {c.component for c in CONTENDERS if c.published}
    assert found["integral_offline.latency"] == pytest.approx(20e-3, rel=1e-9)
    assert 4e-3 < found["ertss.latency"] < 7e-3 and 3.9e-3 < found["ertss.after_landing"] < 6e-3
    assert imread(figures.save(drawer("estimators")(plain), tmp_path / "run.png")).std() > 0.01


def test_figure_of_a_run_has_errors_of_a_few_estimators_per_panel(plain):
    axes = [axis for axis in drawer("estimators")(plain).axes if axis.get_visible()]
    assert all("/" in axis.get_ylabel() for axis in axes) and max(len(axis.lines) for axis in axes) <= 5
    of = {axis.get_ylabel().split("\n")[0]: [] for axis in axes[4:]}
    for axis in axes[4:]:
        of[axis.get_ylabel().split("\n")[0]] += [line.get_label() for line in axis.lines]
    assert set(of) == {"error of the", "error of the flux"}
    assert sorted(of["error of the flux"]) == sorted(c.label for c in CONTENDERS)


def test_what_is_not_recorded_is_told(plain):
    with pytest.raises(ValueError, match=r"`ekf\.velocity`, not recorded"):
        benchmark.require([name for name in plain.signals if name != "ekf.velocity"], "made")


NUMBERS = (*benchmark.QUANTITIES, "landings", "missed", "latency", "after_landing", "cost")


def runs(**changes):
    """Two runs in which every number is 1e-3, but for changes by `component__number`."""
    both = {f"{c.component}.{n}": np.full(2, 1e-3) for c in drawn.CONTENDERS for n in NUMBERS}
    return both | {name.replace("__", "."): np.array(values) for name, values in changes.items()}


def test_tables_show_median_worst_and_misses():
    none = [np.nan, np.nan]
    plain = runs(ekf__position=[10e-6, 30e-6], ekf__missed=[0.0, 1.0], ekf__landings=[5.0, 5.0], semera__missed=none)
    wrong = runs(ekf__position=[10e-6, 50e-6], ekf__missed=[2.0, 0.0], ekf__landings=[5.0, 5.0], ekf__resistance=none)
    text = plain_text(*drawn.tables({None: plain, "wrong_5": wrong}))
    lines = [line for line in text.splitlines() if line.startswith("  Ekf ")]
    assert "20.0 (30.0)" in lines[0] and lines[0].endswith("1 of 10")
    assert "30.0 (50.0)" in lines[1] and " - " in lines[1]
    held_out = drawn.markdown({None: plain, "volts_27": plain, "all_wrong": wrong}).partition("| z / um | 27 V")[2]
    assert held_out.startswith(" | all wrong | missed |") and "| Ekf | 20 | 30 (50) | 3 of 20 |" in held_out
    assert "| Semera |" not in held_out
    page = drawn.markdown({None: plain, "wrong_5": wrong})
    row = next(line for line in page.splitlines() if line.startswith("| Ekf "))
    cells = [cell.strip() for cell in row.strip("|").split("|")]
    assert cells[:3] == ["Ekf", "20.0", "30 (50)"] and "3 of 20" in cells
    assert next(line for line in text.splitlines() if line.startswith("  Semera ")).endswith(" -")
    head = next(line for line in page.splitlines() if line.startswith("|  |"))
    assert all(line.count("|") == head.count("|") for line in page.splitlines() if line.startswith("| "))
    narrow = plain_text(*drawn.tables({None: plain, "wrong_5": wrong, "all_wrong": wrong}), width=80)
    assert max(len(line) for line in narrow.splitlines() if " published completely " not in line) <= 80


def test_figure_of_the_conditions(tmp_path):
    found = {None: runs(), "warm": runs(ekf__position=[1e-6, 1e-4])}
    axis = drawn.conditions(found).axes[0]
    ticks = [
        label.get_text()
        for label in drawn.conditions({"wrong_5": runs(), "other_gap": runs()}).axes[0].get_xticklabels()
    ]
    assert ticks == ["5 %\nwrong", "other\ngap"]  # a number keeps its unit
    numbers = {tuple(text.get_position()): text.get_text() for text in axis.texts}
    row = [label.get_text() for label in axis.get_yticklabels()].index("Ekf")
    assert numbers[1, row] == "50" and len(numbers) == 2 * len(axis.get_yticks())  # the median of 1 and 100 um
    assert imread(figures.save(drawn.conditions(found), tmp_path / "conditions.png")).std() > 0.01


def test_table_of_the_page_has_every_estimator():
    page = (ROOT / "docs" / "estimators.md").read_text(encoding="utf-8")
    table = page.partition("## Errors and costs")[2].partition("\n## ")[0]
    for contender in CONTENDERS:
        assert f"\n| {contender.label} | " in table, contender.label
        assert contender.needs in table, contender.label


def test_unknown_condition_is_told_before_the_first_is_run(tmp_path):
    done = CliRunner().invoke(app, ["study", "estimators", "--variant", "warn", "--out", str(tmp_path)])
    assert done.exit_code == 2 and "Did you mean `warm`?" in " ".join(done.output.split())
    assert not [*tmp_path.iterdir()]


@pytest.mark.slow
def test_the_whole_family(natives, tmp_path, monkeypatch):
    """By native FMUs, which have the bits of the Python ones: the scenario is among those of tests/native."""
    monkeypatch.chdir(ROOT)
    arguments = ["study", "estimators", "--fmus", natives, "--seeds", 2, "--out", tmp_path]
    done = CliRunner().invoke(app, [str(a) for a in arguments])
    assert done.exit_code == 0, done.output
    assert " ".join(done.stdout.split()).count(" runs: root mean square errors") == len(drawn.TITLES)
    assert (tmp_path / "estimators.md").read_text("utf-8").count("| Mhe |") == 2
    assert all(imread(tmp_path / name).std() > 0.01 for name in ("estimators.png", "estimators_held_out.png"))
    assert set(load(FOLDER).variants) == {c for c in drawn.TITLES if c}
