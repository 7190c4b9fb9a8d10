"""Gap laws from inductances: the law that made them comes back, its slope too; what eddy currents rule is refused."""

from __future__ import annotations

import math
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from gapsense.actuators import magnetics
from gapsense.identification.gap_law.laws import best_law, candidates, fringing_of, jackknife, reluctance, rows, total
from gapsense.identification.gap_law.table import columns_given, missing_part, read_inductances, remarks
from gapsense.problems import InputError

TAKAHA = Path(__file__).parent / "records" / "takaha-inductance.csv"
MU_0, TURNS, CORE = 4e-7 * math.pi, 1200.0, 3.25e6
GAPS = np.linspace(0.0, 1.2e-3, 13)


def linear(h):
    return 2.7e10 * h


def fringing(h, area=1.75e-5, window=10e-3):
    bulge = np.where(h > 0.0, h / math.sqrt(area) * np.log(2.0 * window / np.maximum(h, 1e-12)), 0.0)
    return h / (MU_0 * area) / (1.0 + bulge)


def pot(h):
    """A gap beside a leak, and a second gap that grows with the square of the first: no law of ours."""
    return 1.0 / (1.0 / (2e9 * h + 1e5) + 4e-8) + 6e12 * h**2


@cache
def chosen(truth, noise=0.0, seed=1, gaps=GAPS):
    measured = TURNS**2 / (CORE + truth(gaps)) * (1.0 + noise * np.random.default_rng(seed).standard_normal(gaps.size))
    return best_law(candidates(gaps, TURNS**2 / measured))


def slope(truth, h):
    return (truth(h + 1e-7) - truth(h - 1e-7)) / 2e-7


@pytest.mark.parametrize("truth", [pytest.param(linear, marks=pytest.mark.slow), fringing])
def test_exact_inductances_give_the_law_back(truth):
    law = chosen(truth).law
    assert law.name == truth.__name__
    assert law.offset == pytest.approx(CORE, rel=1e-4)
    np.testing.assert_allclose(reluctance(law, GAPS)[0], truth(GAPS), rtol=1e-4, atol=10.0)


@pytest.mark.parametrize(
    ("truth", "seed"),
    [
        pytest.param(truth, seed, marks=[] if (truth, seed) == (pot, 0) else [pytest.mark.slow])
        for truth in (linear, fringing, pot)
        for seed in range(4)
    ],
)
def test_noisy_inductances_give_a_slope_within_its_error(truth, seed):
    found = chosen(truth, 2e-3, 10 + seed)
    inner = GAPS[1:-1]
    made = np.array([reluctance(law, inner)[1] for law in (found.law, *found.others)])
    error = made[0] / slope(truth, inner) - 1.0
    allowed = 3.0 * jackknife(made[1:]) / slope(truth, inner) + 0.02
    assert np.mean(np.abs(error) < allowed) > 0.8, (found.law.name, error)
    assert np.sqrt(np.mean(error**2)) < 0.12
    assert total(found.law, GAPS) == pytest.approx(CORE + truth(GAPS), rel=0.01)


def test_fringes_are_those_of_the_actuators():
    h, numbers = np.array([-1e-4, 0.0, 1e-5, 1e-3, 9.9e-3, 10e-3, 11e-3]), (4.5e10, 240.0, 10e-3)
    made = [magnetics.fringing(gap, *numbers)[:2] for gap in h.tolist()]
    np.testing.assert_allclose(np.transpose(fringing_of(h, *numbers)), made, rtol=1e-14)


def test_table_of_a_law_begins_without_reluctance_and_goes_beyond_the_stop():
    law = chosen(pot, 2e-3, 10).law
    made = rows(law._replace(offset=0.0), 1e-3)
    assert made["reluctance"][0] == made["gap"][0] == 0.0 and made["gap"][-1] > 1.1e-3
    between = np.diff(made["reluctance"]) / np.diff(made["gap"])
    np.testing.assert_allclose(between, 0.5 * (made["slope"][1:] + made["slope"][:-1]), rtol=2e-3)
    assert (made["slope"] >= 0.0).all()


def test_measured_solenoid_gives_a_table_from_its_lowest_frequency():
    measured = read_inductances(TAKAHA)
    assert measured.frequency == 100.0 and sorted(measured.others) == [1e3, 1e4, 1e5]
    assert measured.gap[-1] == pytest.approx(4.1e-3) and measured.inductance[0] == pytest.approx(0.11391)
    found = best_law(candidates(measured.gap, TURNS**2 / measured.inductance))
    assert found.law.name == "3 slopes" and found.foretold < 0.02
    part = missing_part(measured)
    assert part is not None and 0.02 < part[-1] < part[0] < 0.1
    assert "does not even fall" in " ".join(remarks(measured))


@pytest.mark.parametrize(("column", "sentence"), [("L_1kHz_mH", "rises by 19 %"), ("L_100kHz_mH", "does not change")])
def test_inductances_that_eddy_currents_rule_are_refused(column, sentence):
    with pytest.raises(InputError, match=f"{sentence}.* eddy currents keep the flux out of the iron"):
        read_inductances(TAKAHA, {"inductance": column})


def test_one_loop_of_eddy_currents_is_found_at_its_size(tmp_path):
    L, g = 0.1 - 30.0 * GAPS, 3e-3  # static, and conductance
    heads, columns = ["gap [mm]"], [1e3 * GAPS]
    for hertz in (50.0, 100.0):
        heads.append(f"inductance {hertz:g}Hz [mH]")
        columns.append(1e3 * L / (1.0 + (2.0 * math.pi * hertz * g * L) ** 2))
    text = "\n".join([",".join(heads), *(",".join(map(repr, row)) for row in np.array(columns).T.tolist())])
    (tmp_path / "two.csv").write_text(text + "\n", encoding="utf-8")
    part = missing_part(read_inductances(tmp_path / "two.csv"))
    x = (2.0 * math.pi * 50.0 * g * L) ** 2
    np.testing.assert_allclose(part, x / (1.0 + x), rtol=1e-6)


WRONG = {
    "gap [mm],inductance [mH]\n0,100\n1,80\n": "2 gaps found, at least 3 expected",
    "gap [mm],inductance [mH]\n-1,100\n0,90\n1,80\n": "a gap of -1 mm found",
    "gap [mm],inductance [mH]\n0,100\n1,-80\n2,70\n": "positive ones expected",
    "gap [m],inductance [mH]\n0,100\n1,90\n2,80\n": "the largest gap is 2 m, 10 um to 200 mm expected",
    "gap [mm],inductance [H]\n0,100\n1,90\n2,80\n": "the largest inductance is 100 H, 1 uH to 50 H expected",
    "gap [mm],inductance [mH]\n0,100\n1,wide\n2,70\n": "`wide` found, a number expected",
    "x [mm],y [mm],L [mH]\n0,1,100\n1,2,90\n2,3,70\n": "2 columns may be the gap. Choose one: `--column gap=x`",
    "gap [mm],La [mH],Lb [mH]\n0,1,2\n1,2,3\n2,3,4\n": "do not tell their frequencies",
    "gap [mm],inductance\n0,100\n1,90\n2,70\n": "no column of the inductance in H is found",
    "gap [mm];inductance [mH]\n0;100\n1;90\n2;70\n": "separated by semicolons",
}


@pytest.mark.parametrize("text", WRONG)
def test_wrong_tables_are_refused_in_words(text, tmp_path):
    (tmp_path / "t.csv").write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        read_inductances(tmp_path / "t.csv")
    assert WRONG[text] in str(caught.value)


def test_columns_are_chosen_by_name(tmp_path):
    (tmp_path / "t.csv").write_text("x (um),y [mm],L [mH]\n0,1,100\n900,2,90\n1100,3,70\n", encoding="utf-8")
    assert read_inductances(tmp_path / "t.csv", columns_given(["gap=x"])).gap[-1] == pytest.approx(1.1e-3)
    with pytest.raises(ValueError, match="`gap=NAME` or `inductance=NAME` expected"):
        columns_given(["voltage=u"])
