"""The gap law from positions, fitted together with the valve, and from inductances; what is refused, what is told."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from valve_records import GUESS, record

from gapsense.identification.gap_law.laws import Law, reluctance, total
from gapsense.identification.gap_law.motion import Measured, best, trials
from gapsense.identification.valve.fit import fit_valve
from gapsense.identification.valve.form import Form, Sought, shape, value_of
from gapsense.identification.valve.gap import describe_gap, find_gap
from gapsense.identification.valve.model import prepare, simulate_batch, simulate_experiment, weight
from gapsense.problems import InputError
from gapsense.studies.devices import VALVE

TURNS, UPPER = 1200.0, 0.9e-3
GRID = np.linspace(0.0, 1.1e-3, 56)
FREE = Sought(forms=())
HELD = FREE._replace(held=("coil_turns",))


def leaky(h):
    """A gap beside a leak, and a second one: no formula of ours."""
    return 1.0 / (1.0 / (3e10 * h + 2e5) + 4e-8) + 2e13 * h**2


def slope(h):
    return (leaky(h + 1e-8) - leaky(h - 1e-8)) / 2e-8


LEAKY = VALVE._replace(
    gap_law=2.0,
    gap_file_gap=GRID.tolist(),
    gap_file_reluctance=leaky(GRID).tolist(),
    gap_file_slope=slope(GRID).tolist(),
)
FRINGING = VALVE._replace(gap_law=1.0)


def noisy(par=VALVE, seed=1, volts=(30.0, 26.0), **options):
    options = {"gap_noise": 2e-6, **options}
    return [record(par=par, seed=seed + 50 * k, volts=v, **options) for k, v in enumerate(volts)]


def guess(par):
    """A guess that is off, with the turns as they are and a gap law that is wrong."""
    return GUESS._replace(coil_turns=TURNS, gap_slope=2.2e10)


def found(par, records, sought=HELD):
    start = find_gap(guess(par), records, sought, None, ("trapezoid",))
    return start, fit_valve(start.records, start.parameters, 1, 1, conventions=start.conventions, sought=start.sought)


def errors(result, par):
    """Errors of what was identified, in standard errors."""
    truth = [getattr(par, name) for name in result.names]
    off = [float(value_of(result.parameters, name)) / x - 1.0 for name, x in zip(result.names, truth)]
    return dict(zip(result.names, np.array(off) / result.uncertainty.relative))


def test_law_follows_from_current_flux_linkage_and_gap_of_any_core():
    rng = np.random.default_rng(3)
    h, lam = rng.uniform(0.0, UPPER, 600), rng.uniform(1e-3, 0.022, 600)
    for law, kind in ((lambda x: 2.7e10 * x, "linear"), (leaky, "6 slopes")):
        current = lam / TURNS**2 * (law(h) + 3.25e6 / (1.0 - lam / 0.024)) + 2e-4 * rng.standard_normal(h.size)
        taken = best(trials(Measured(current, lam, h), TURNS, UPPER))
        assert taken.law.name == kind
        assert taken.core_saturation == pytest.approx(0.024, rel=5e-3)
        at = np.linspace(0.05e-3, 0.85e-3, 9)
        assert total(taken.law, at) + taken.core_reluctance == pytest.approx(law(at) + 3.25e6, rel=0.01)
        assert reluctance(taken.law, at)[1] == pytest.approx((law(at + 1e-8) - law(at - 1e-8)) / 2e-8, rel=0.1)


def test_any_turns_explain_the_records_alike():
    """Reluctances times the square of a factor, turns times the factor: the same current and motion."""
    (one,) = noisy(volts=(30.0,))
    experiment, _ = prepare(one)
    other = VALVE._replace(coil_turns=2.0 * TURNS, core_reluctance=4.0 * 3.25e6, gap_slope=4.0 * VALVE.gap_slope)
    a, b = simulate_experiment(VALVE, experiment), simulate_experiment(other, experiment)
    np.testing.assert_allclose(a.current, b.current, atol=1e-9)
    np.testing.assert_allclose(a.position, b.position, atol=1e-9)


def test_position_has_the_weight_of_its_noise_and_the_same_numbers_in_c():
    (one,) = noisy(volts=(30.0,))
    plain, _ = prepare(one)
    fitted, _ = prepare(one._replace(position_noise=2e-6))
    model = simulate_experiment(VALVE, fitted)
    r, n = weight(fitted, model), plain.current.size
    np.testing.assert_array_equal(r[: 2 * n], weight(plain, model))
    assert r[2 * n :].std() == pytest.approx(r[:n].std(), rel=0.15)
    (response,) = simulate_batch([VALVE], fitted)
    np.testing.assert_array_equal(response.position, model.position)
    assert simulate_batch([VALVE], plain)[0].position is None


@cache
def of(kind: str, seed: int):
    return found({"leaky": LEAKY, "linear": VALVE}[kind], noisy({"leaky": LEAKY, "linear": VALVE}[kind], seed))


def test_linear_law_is_found_with_the_valve_within_its_errors():
    start, result = of("linear", 1)
    assert result.names[:-1] == ("core_reluctance", "core_saturation", *result.names[2:5], "gap_slope")
    z = errors(result, VALVE)
    assert max(map(abs, z.values())) < 4.0, z
    relative = dict(zip(result.names, result.uncertainty.relative))
    assert relative["damping"] < 0.055 and relative["mover_mass"] < 0.01  # currents alone leave 9 and 1 %
    said = " ".join(map(str, [*start.told, *describe_gap(result, start.records)]))
    assert "`coil.turns` is held at 1200" in said and said.count("of the position, which is noise") == 2


def test_law_whose_form_is_confirmed_stays_and_the_turns_are_sought():
    start = find_gap(GUESS._replace(core_reluctance=2e6), noisy(seed=9), FREE, None, ("trapezoid",))
    assert start.sought is FREE and "confirm the form" in start.told[-1]
    assert start.parameters.coil_turns == pytest.approx(TURNS, rel=0.01)
    assert start.parameters.core_reluctance == pytest.approx(3.25e6, rel=0.03)
    result = fit_valve(start.records, start.parameters, 1, conventions=start.conventions, sought=start.sought)
    z = errors(result, VALVE)
    assert result.names[0] == "coil_turns" and max(map(abs, z.values())) < 4.0, z
    for par in (LEAKY, FRINGING):  # otherwise the law is sought, and the turns are held
        start = find_gap(guess(VALVE), noisy(par, 9), FREE, None, ("trapezoid",))
        assert "coil_turns" in start.sought.held


def test_law_without_a_formula_is_found_with_the_valve_within_its_errors():
    start, result = of("leaky", 4)
    z = errors(result, LEAKY)
    assert max(map(abs, z.values())) < 4.0, z
    law, at = result.form.law_at(result.ratios), np.linspace(0.1e-3, 0.9e-3, 9)
    assert np.abs(reluctance(law, at)[1] / slope(at) - 1.0).max() < 0.06
    assert law.offset + result.parameters.core_reluctance == pytest.approx(leaky(0.0) + 3.25e6, rel=0.02)
    assert result.is_explained and set(result.uncertainty.shape) == set(start.sought.gap)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(20, 26))
@pytest.mark.parametrize(("par", "volts"), [(VALVE, (28.0, 32.0)), (LEAKY, (34.0, 25.0)), (FRINGING, (30.0, 24.0))])
def test_other_drives_and_seeds_give_the_valve_within_its_errors(par, volts, seed):
    _, result = found(par, noisy(par, seed, volts, gap_noise=4e-6))
    z = {name: x for name, x in errors(result, par).items() if name in ("mover_mass", "spring_stiffness", "damping")}
    assert max(map(abs, z.values())) < 4.0, z


def test_record_whose_position_rests_or_is_absent_is_taken_as_before():
    for records in (noisy(volts=(6.0,)), [record(seed=1)]):
        start = find_gap(VALVE, records, FREE, None, ("trapezoid",))
        assert start.parameters is VALVE and start.sought is FREE and not start.told
        assert prepare(start.records[0])[0].position is None


def test_offset_of_the_sensor_is_subtracted_and_another_unit_refused():
    (one,) = noisy(volts=(30.0,))
    start = find_gap(VALVE, [one._replace(position=one.position + 0.3e-3)], FREE, None, ("trapezoid",))
    assert float(start.records[0].position[:8].mean()) == pytest.approx(UPPER, abs=2e-6)
    for wrong in (1e3 * one.position, UPPER - one.position):
        with pytest.raises(InputError, match="Correct unit or direction"):
            find_gap(VALVE, [one._replace(position=wrong)], FREE, None, ("trapezoid",))


def test_reading_of_the_voltage_follows_from_the_positions():
    start = find_gap(guess(VALVE), noisy(), FREE, None, ("trapezoid", "end", "start"))
    assert start.conventions == ("trapezoid",)


@pytest.mark.slow
def test_inductances_give_the_law_and_saturation_the_part_of_the_core(tmp_path):
    gaps = np.linspace(0.0, 1e-3, 11)
    L = TURNS**2 / (3.25e6 + leaky(gaps)) * (1.0 + 3e-4 * np.random.default_rng(5).standard_normal(gaps.size))
    rows = [f"{1e3 * h!r},{1e3 * x!r}" for h, x in zip(gaps.tolist(), L.tolist())]
    (tmp_path / "L.csv").write_text("\n".join(["gap [mm],inductance 20Hz [mH]", *rows]) + "\n", encoding="utf-8")
    records = noisy(LEAKY, 7, gap_noise=None)
    start = find_gap(guess(LEAKY), records, FREE, tmp_path / "L.csv", ("trapezoid",))
    result = fit_valve(start.records, start.parameters, 1, conventions=start.conventions, sought=start.sought)
    par, law = result.parameters, result.form.law_at(result.ratios)
    assert par.core_reluctance == pytest.approx(3.25e6, rel=0.03) and par.coil_turns == TURNS
    assert law.offset + par.core_reluctance == pytest.approx(leaky(0.0) + 3.25e6, rel=2e-3)
    assert par.mover_mass == pytest.approx(1.6e-3, rel=0.05) and par.spring_stiffness == pytest.approx(37.0, rel=0.02)
    assert "are the core's" in str(describe_gap(result, start.records)[-1])
    with pytest.raises(InputError, match="at least half of the largest"):
        find_gap(VALVE._replace(stop_upper=5e-3), records, FREE, tmp_path / "L.csv", ())


def test_form_makes_the_table_of_its_law():
    law = Law("2 slopes", 1e5, (2e10, 3e10), (0.0, UPPER))
    form = Form(VALVE._replace(gap_law=2.0), ("core_reluctance", *shape(law)), law=law)
    par = form.at(np.log([1.1, 2.0, 1.0, 1.5]))
    assert par.gap_file_reluctance[0] == pytest.approx(2e5) and par.gap_file_slope[0] == pytest.approx(2e10)
    assert np.interp(UPPER, par.gap_file_gap, par.gap_file_slope) == pytest.approx(4.5e10)
    split = Form(VALVE._replace(gap_law=2.0), ("core_reluctance",), law=law, total=4e6)
    par = split.at(np.log([1.1]))
    assert par.gap_file_reluctance[0] + par.core_reluctance == pytest.approx(4e6)
