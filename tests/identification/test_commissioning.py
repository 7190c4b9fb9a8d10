"""All parameters of `Mhe` from one record: of its own model, and of the actuator of the benchmark."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from gapsense._os.files import read_columns, write_columns
from gapsense.actuators.magnetics import fringing
from gapsense.cli import app
from gapsense.cosim import run
from gapsense.estimators.mhe.model import device
from gapsense.fmi.components import kernel_parameters, own
from gapsense.identification.actuator import fit
from gapsense.identification.actuator import fit as problem
from gapsense.identification.actuator import show as file
from gapsense.identification.actuator.drive import read_excitation
from gapsense.identification.actuator.kernel import USUAL
from gapsense.identification.actuator.show import doubts, missing
from gapsense.identification.least_squares import Minimum
from gapsense.identification.measurements.record import Columns, to_record
from gapsense.identification.parameter_set import parameters_of, read_sets, read_values, take_values
from gapsense.report.table import text
from gapsense.scenarios.estimators import commissioned
from gapsense.scenarios.estimators.parameters import CORE, blind, wrong
from gapsense.studies.devices import RTS_VALVE

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "scenarios" / "estimators"
SETS = FOLDER / "parameters"
ERRORS = 0.05 * np.array([0.6, -0.5, -0.8, 0.9, -0.7, 0.8, 0.7, -0.9])
DT, NOISE = 20e-6, 2e-3
TRUE = parameters_of("mhe", SETS / "mhe_commissioned.toml")
BELIEVED = kernel_parameters(own("mhe"), {**read_values([SETS / "mhe.toml"]), **blind(wrong(ERRORS))})


def columns(par=TRUE, samples=2100):
    """Two operations of the model with noise."""
    k = np.arange(samples)
    voltage = np.where((k >= 50) & ((k - 50) % 1000 < 500), 30.0, 0.0)
    noise = NOISE * np.random.default_rng(1).standard_normal(samples)
    return {"time": DT * k, "voltage": voltage, "current": simulated(par, voltage)[:, 0] + noise}


def simulated(par, voltage):
    """Current, flux linkage and position of the model; edges lie half-way between samples."""
    means = 0.5 * (voltage + np.append(0.0, voltage[:-1]))
    return problem.run(par._replace(sample_time=DT), means.tolist())


def record(**options):
    values = columns(**options)
    return to_record(Columns("made.csv", np.arange(values["time"].size), values))


@pytest.fixture(scope="module")
def found():
    return fit.commission([record()], BELIEVED)


def test_a_record_of_the_model_gives_its_parameters_back(found):
    """From beliefs that are wrong by up to 5 % and guesses of the losses; errors are what the standard errors say."""
    assert set(found.names) == set(problem.DEVIATIONS) and found.beyond == USUAL
    right = fit.with_bend(TRUE)._replace(gap_factor=TRUE.gap_slope / BELIEVED.gap_slope)
    off = np.array([np.log(getattr(found.parameters, name) / getattr(right, name)) for name in found.names])
    assert np.all(np.abs(off) < 3.0 * np.array([*found.errors.values()])), dict(zip(found.names, off))
    assert abs(found.parameters.coil_resistance / right.coil_resistance - 1.0) < 1e-3
    assert found.misfit < 1.0
    first, voltage = found.drives[0].first, columns()["voltage"]
    true, believed = (simulated(par, voltage)[first:, 2] for par in (TRUE, BELIEVED))
    assert np.sqrt(np.mean((found.model.position - true) ** 2)) < 6e-6
    assert np.sqrt(np.mean((found.model.position - believed) ** 2)) > 30e-6


def at_limit(is_sought):
    """Of a record whose eddy currents are 7400 times the guess; the search goes as far as a thousand times."""
    one, guess = record(par=TRUE._replace(core_eddy=7.4e-3), samples=1100), BELIEVED._replace(core_eddy=1e-6)
    if is_sought:
        return fit.commission([one], guess)
    p = fit.Problem(fit.with_bend(guess), [*fit.DEVIATIONS], [read_excitation(one, guess)])
    return fit.conclude(p, np.log(1e3) * np.eye(p.deviations.size)[p.names.index("core_eddy")], 1)


@pytest.mark.parametrize("is_sought", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_a_value_that_ends_at_a_limit_is_told_and_no_position_is_called_certain(found, is_sought):
    result = at_limit(is_sought)
    said = " ".join(file.remarks(result, fit.with_bend(BELIEVED)))
    assert "core_eddy" in result.at_limit and "`core.eddy` ends at a limit of the search: 1 mS" in said
    table = text(*file.actuator_tables(result, BELIEVED))
    assert file.standard_errors(result)["core.eddy"] == np.inf and "unknown" in table and "inf" not in table
    assert not result.is_explained and "the model is another one" in said and "certain to" not in said
    alike = result._replace(residuals=found.residuals, misfit=0.5)  # at a limit, though nothing is left
    assert "certain to" not in " ".join(file.remarks(alike, fit.with_bend(BELIEVED)))
    sound = " ".join(file.remarks(found, fit.with_bend(BELIEVED)))
    (scales,) = [text for text in file.actuator_tables(found, BELIEVED) if "for exact" in str(text)]
    assert "`stop.lower`, `stop.upper` and `coil.turns`" in str(scales)
    assert not found.at_limit and "certain to" in sound and "ends" not in sound


@pytest.mark.parametrize(("true", "guess"), [(7.4e-3, 1e-4), (1e-3, 2e-5)])
def test_losses_of_a_solid_core_are_found_from_the_guess_for_another_one(true, guess):
    """The search ended at ten times the guess: with a misfit of 9, or with another hysteresis in its place."""
    lossy = TRUE._replace(core_eddy=true)
    result = fit.commission([record(par=lossy)], BELIEVED._replace(core_eddy=guess))
    right = fit.with_bend(lossy)._replace(gap_factor=TRUE.gap_slope / BELIEVED.gap_slope)
    off = {n: np.log(getattr(result.parameters, n) / getattr(right, n)) / e for n, e in result.errors.items()}
    assert result.is_explained and not result.at_limit and result.misfit < 1.0
    assert max(map(abs, off.values())) < 3.0 and result.errors["core_eddy"] < 0.1, off


def test_turnover_of_the_hysteresis_is_found_beyond_ten_times_the_guess():
    """The search ended there; the belief still pulls, by less than two standard errors."""
    lossy = TRUE._replace(core_turnover=6e-3)
    result = fit.commission([record(par=lossy)], BELIEVED._replace(core_turnover=3e-4))
    error = result.errors["core_turnover"]
    assert result.is_explained and not result.at_limit and error < 0.3
    assert abs(np.log(result.parameters.core_turnover / 6e-3)) < 2.0 * error


def test_a_search_that_ends_where_no_minimum_is_says_so(monkeypatch):
    monkeypatch.setattr(fit, "minimise", lambda p, x, *_: Minimum(x, p.residuals([x])[0], 0))
    result = fit.commission([record(samples=1100)], BELIEVED)
    (said,) = [text for text in file.remarks(result, fit.with_bend(BELIEVED)) if "The search ends" in text]
    assert "without one step from what was believed" in said and not result.is_minimum


def test_derivatives_of_the_cost_are_its_slopes():
    """By logarithms, offsets, what the places of edges share and each of them; of two records together."""
    par = fit.with_bend(BELIEVED)
    drives = [read_excitation(record(samples=n), par) for n in (600, 400)]
    p = problem.Problem(par, [*problem.DEVIATIONS], drives)
    x, by = np.zeros(p.deviations.size), 1e-4 * np.random.default_rng(2).standard_normal(p.deviations.size)
    assert x.size == 13 + 2 + 2 + 2 + 1
    before, after = p.residuals([x, x + by])
    assert np.linalg.norm(after - before - p.jacobian(x) @ by) < 0.02 * np.linalg.norm(after - before)


def test_bend_of_the_core_changes_no_device():
    before, after = device(BELIEVED), device(fit.with_bend(BELIEVED))
    assert after == pytest.approx(before, rel=1e-12)
    assert device(fit.with_bend(TRUE)) == pytest.approx(device(TRUE), rel=1e-12)
    assert fit.with_bend(TRUE).core_bend == pytest.approx(TRUE.core_bend, rel=1e-12)


def test_what_is_zero_stays_zero_and_a_table_has_a_factor_only():
    gap = {"gap.law": "table", "gap.file": str(ROOT / "fmus" / "mhe" / "fringing_29.csv")}
    par = kernel_parameters(own("mhe"), {**read_values([SETS / "mhe.toml"]), **gap, "damping": 0.0})
    names = [name for name in problem.DEVIATIONS if fit.is_fitted(fit.with_bend(par), name)]
    assert set(problem.DEVIATIONS) - set(names) == {"gap_fringing", "damping"}


def test_the_parameter_set_is_what_was_found(found, tmp_path):
    given = read_values([SETS / "mhe.toml"])
    written = file.write_actuator(tmp_path / "new" / "mine.toml", found, given, "test")
    read = parameters_of("mhe", written)
    (model,) = (problem.simulate(read, d, at) for d, at in zip(found.drives, found.places))
    assert model.position == pytest.approx(found.model.position, abs=1e-9)
    assert read.gap_factor == 1.0 and read.gap_slope == pytest.approx(
        BELIEVED.gap_slope * found.parameters.gap_factor, rel=1e-7
    )
    shipped = parameters_of("mhe", SETS / "mhe.toml")
    for name in file.LEARNT:
        field = name.replace(".", "_")
        assert file.LEAST <= getattr(read, field) < 0.5 * getattr(shipped, field), name
    assert read.prior_resistance == shipped.prior_resistance


def test_standard_errors_have_the_units_of_the_values(found):
    errors, values = file.standard_errors(found), file.found_values(found)
    assert {file.PORTS[name].name for name in found.names} == {*errors}
    assert errors["mover.mass"] == found.errors["mover_mass"] * found.parameters.mover_mass
    assert abs(values["coil.resistance"] - TRUE.coil_resistance) < 4.0 * errors["coil.resistance"]


def test_a_table_keeps_its_place_and_gets_a_factor(found, tmp_path):
    table = tmp_path / "law.csv"
    table.write_text((ROOT / "fmus" / "mhe" / "fringing_29.csv").read_text())
    given = {**read_values([SETS / "mhe.toml"]), "gap.law": "table", "gap.file": str(table)}
    par = kernel_parameters(own("mhe"), given)
    by_table = found._replace(parameters=found.parameters._replace(gap_law=par.gap_law))
    read = read_values([file.write_actuator(tmp_path / "sets" / "mine.toml", by_table, given, "test")])
    assert Path(read["gap.file"]).samefile(table)
    assert read["gap.factor"] == pytest.approx(found.parameters.gap_factor, rel=1e-7)


@pytest.mark.slow
def test_parameters_of_the_benchmark_are_what_a_record_gives(fmus):
    """The plant is another model, with Jiles-Atherton hysteresis; its position is not used.

    The shipped set was found with edges in the middle of their intervals, where they are. Now their places are sought,
    which leave less of the core: that is late, too. So the sets differ more than their positions do.
    """
    shipped = parameters_of("mhe", SETS / "mhe_commissioned.toml")
    result = commissioned.of_scenario(FOLDER)
    (d,), (places,) = result.drives, result.places
    assert np.sqrt(np.mean((problem.simulate(shipped, d, places).position - result.model.position) ** 2)) < 3e-6
    for name in set(problem.DEVIATIONS) - {"gap_factor", "gap_fringing", "core_turnover"}:
        allowed = 2.0 * result.errors[name]  # each set has such errors
        assert getattr(result.parameters, name) == pytest.approx(getattr(shipped, name), rel=max(allowed, 1e-3)), name
    truth = run(FOLDER, seed_shift=commissioned.SEED)["actuator.position"]
    assert np.sqrt(np.mean((result.model.position - truth[result.drives[0].first :]) ** 2)) < 4e-6
    assert result.parameters.core_eddy == pytest.approx(CORE.eddy, rel=0.1)
    assert result.parameters.coil_resistance == pytest.approx(RTS_VALVE.coil_resistance, rel=1e-3)


def commission(folder, *arguments):
    command = ["commission", str(folder / "record.csv"), "--parameters", str(SETS / "mhe.toml"), *arguments]
    return CliRunner().invoke(app, command)


def saved(path, values):
    named = {f"{name} [{unit}]": values[name] for name, unit in zip(values, ("s", "V", "A"))}
    with path.open("w") as text:
        write_columns(text, named)


def test_the_command_writes_a_parameter_set_and_says_how_certain_it_is(tmp_path):
    saved(tmp_path / "record.csv", columns(samples=1100))
    done = commission(tmp_path, "--out", str(tmp_path / "mine.toml"))
    assert done.exit_code == 0, done.output
    for words in ("coil.resistance", "standard", "as it was believed", "the model explains the current"):
        assert words in done.output, done.output
    assert parameters_of("mhe", tmp_path / "mine.toml").core_eddy == pytest.approx(TRUE.core_eddy, rel=0.3)


def test_a_record_that_begins_with_current_is_refused(tmp_path):
    saved(tmp_path / "record.csv", {name: x[300:] for name, x in columns().items()})
    done = commission(tmp_path)
    assert done.exit_code == 2 and "record from rest" in done.output


def other(stroke, turns):
    """A device with as many times the stroke, and other turns, that has nearly the currents of the true one."""
    square = (turns / TRUE.coil_turns) ** 2
    shares = {"stop_lower": 1, "stop_upper": 1, "spring_rest": 1, "gap_window": 1, "gap_slope": -1, "gap_fringing": -1}
    changes = {name: getattr(TRUE, name) * stroke**power for name, power in shares.items()}
    changes |= {name: getattr(TRUE, name) / stroke**2 for name in ("mover_mass", "spring_stiffness", "damping")}
    for name in ("gap_slope", "gap_reluctance", "core_reluctance", "core_bend"):
        changes[name] = changes.get(name, getattr(TRUE, name)) * square
    return TRUE._replace(**changes, coil_turns=turns)


DEVICES = ((1.25, 1200.0), (0.8, 900.0))  # stroke and turns
NAMES = (("stop.lower", "stop.upper"), ("coil.turns",), ("spring.rest", "mover.mass"), missing(TRUE, ()))


@pytest.mark.parametrize(
    ("names", "stroke", "turns"),
    [
        pytest.param(names, *device, marks=[] if k % 2 == j or k == 3 else [pytest.mark.slow])
        for k, names in enumerate(NAMES)
        for j, device in enumerate(DEVICES)
    ],
)
def test_what_is_assumed_makes_all_that_goes_with_it_uncertain(names, stroke, turns):
    """With the start values of `Mhe` in place of the true ones; the stated errors hold the truth."""
    true, shipped = other(stroke, turns), parameters_of("mhe", None)
    fields = [name.replace(".", "_") for name in names]
    known = true._replace(**{field: getattr(shipped, field) for field in fields})
    result = fit.commission([record(par=true)], known, doubts=doubts(names))
    right = fit.with_bend(true)._replace(gap_factor=true.gap_slope / known.gap_slope)
    off = [np.log(getattr(result.parameters, n) / getattr(right, n)) / error for n, error in result.errors.items()]
    assert result.is_explained and np.abs(off).max() < 3.0, dict(zip(result.names, off))
    if "stop.upper" in names:
        assert fit.position_error(result) > 20e-6


def test_what_a_set_leaves_out_is_asked_for_by_name_or_assumed_and_marked(tmp_path):
    saved(tmp_path / "record.csv", columns(samples=1100))
    text = (SETS / "mhe.toml").read_text(encoding="utf-8")
    few = "".join(line for line in text.splitlines(True) if not line.startswith(('"stop.upper"', '"coil.turns"')))
    (tmp_path / "few.toml").write_text(few, encoding="utf-8")
    command = ["commission", str(tmp_path / "record.csv"), "--parameters", str(tmp_path / "few.toml")]
    refused = CliRunner().invoke(app, command)
    assert (
        refused.exit_code == 2 and "few.toml: `stop.upper` (" in refused.stderr and "`coil.turns` (" in refused.stderr
    )
    assert "`mover.mass` (" not in refused.stderr and "--assume" in refused.stderr
    for start in (command, ["identify", "--commission", *command[1:]]):
        done = CliRunner().invoke(app, [*start, "--assume", "--out", str(tmp_path / "mine.toml")])
        assert done.exit_code == 0 and "Assumed, and not given: `stop.upper` = 1.4 mm" in done.stdout, done.output
        assert read_sets([tmp_path / "mine.toml"]).assumed == ("stop.upper", "coil.turns")
    command[-1] = str(tmp_path / "mine.toml")
    again = CliRunner().invoke(app, command)
    assert again.exit_code == 2 and "mine.toml: `stop.upper` (" in again.stderr


def test_identify_takes_the_option_and_says_what_it_has_not(tmp_path):
    saved(tmp_path / "record.csv", columns(samples=1100))
    command = ["identify", "--commission", str(tmp_path / "record.csv"), "--out", str(tmp_path / "mine.toml")]
    known = ["--parameters", str(SETS / "mhe.toml")]
    figure = ["--figure", str(tmp_path / "fit.png"), "--validate", str(tmp_path / "record.csv")]
    done = CliRunner().invoke(app, [*command, *known, *figure])
    assert done.exit_code == 0 and "Validation" in done.output and (tmp_path / "fit.png").is_file(), done.output
    assert commission(tmp_path, "--out", str(tmp_path / "same.toml")).exit_code == 0
    texts = [(tmp_path / name).read_text() for name in ("mine.toml", "same.toml")]
    assert texts[0] == texts[1] and '"gap.law" = "fringing"' in texts[0] and '"sample_time" = 2e-05' in texts[0]
    refused = CliRunner().invoke(app, [*command, *known, "--forms", "eddy", "--period", "0.02"])
    assert refused.exit_code == 2 and "--period, --forms found" in refused.output
    missing = CliRunner().invoke(app, command)
    assert missing.exit_code == 2 and "`--parameters` is missing" in missing.output


def test_each_estimator_gets_the_device_that_was_found(found, tmp_path):
    given = {name: value for name, value in read_values([SETS / "mhe.toml"]).items() if name != "sample_time"}
    written = file.write_actuator(tmp_path / "mine.toml", found, {**given, "prior.resistance": 0.08}, "test")
    names = ("mhe", "ekf", "ertss", "bounded_ukf", "semera", "integral_estimator")
    sets = {folder.name: values for folder, values in take_values([own(name) for name in names], [written]).items()}
    par = found.parameters
    assert sets["mhe"]["prior.resistance"] == 0.08
    for name in ("semera", "integral_estimator"):
        assert sets[name]["prior.resistance"] == pytest.approx(par.coil_resistance)
        assert sets[name]["prior.inductance"] == pytest.approx(inductance_at_rest(par), rel=1e-6)
    for name in ("ekf", "ertss", "bounded_ukf"):
        for port, field in (("core.eddy", "core_eddy"), ("core.bend", "core_bend"), ("mover.mass", "mover_mass")):
            assert sets[name][port] == pytest.approx(getattr(par, field)), (name, port)
        assert sets[name]["noise.current"] == pytest.approx(NOISE, rel=0.1)
    assert sets["ekf"]["gap.slope"] == pytest.approx(par.gap_slope * par.gap_factor)
    law = read_columns(Path(sets["bounded_ukf"]["gap.file"]))
    at = np.interp(0.9e-3, law["gap"], law["reluctance"])
    R = par.gap_factor * fringing(0.9e-3, par.gap_slope, par.gap_fringing, par.gap_window)[0]
    assert at == pytest.approx(R, rel=1e-3) and sets["bounded_ukf"]["prior.position"] == par.stop_upper
    assert sets["mhe"]["sample_time"] == pytest.approx(DT)


def inductance_at_rest(par):
    """N^2 / (R_gap + R_c) at the upper stop."""
    R = par.gap_factor * fringing(par.stop_upper, par.gap_slope, par.gap_fringing, par.gap_window)[0]
    return par.coil_turns**2 / (R + par.core_reluctance)
