"""What components take of a parameter set of the valve."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gapsense._os.files import read_columns
from gapsense.actuators.magnetics import MU_0, fringing
from gapsense.fmi.components import load_component, own
from gapsense.identification.parameter_set import read_values, reduced_gap, values_for
from gapsense.problems import InputError
from gapsense.studies.devices import VALVE

GAP_AREA, GAP_WINDOW = VALVE.gap_area, VALVE.gap_window
LINEAR = {"gap.law": "linear", "gap.slope": 2.7e10, "coil.resistance": 76.0, "coil.turns": 1200.0}
REDUCED = ("gap.reluctance", "gap.slope", "gap.fringing", "gap.window", "coil.turns")
GAPS = np.linspace(0.05e-3, 0.9e-3, 7)


def reduced(law, h):
    slope, k, window = (float(law.get(n, 1.0)) for n in ("gap.slope", "gap.fringing", "gap.window"))
    return float(law["gap.reluctance"]) + fringing(h, slope, k, window)[0]


def test_component_with_the_valves_own_gap_takes_names_as_they_are():
    names = ("gap.law", "gap.slope", "coil.turns", "seed")
    assert values_for(names, LINEAR) == {"gap.law": "linear", "gap.slope": 2.7e10, "coil.turns": 1200.0}


def test_resistance_of_a_device_is_not_taken_for_its_deviation():
    mhe = [port.name for port in load_component(own("mhe")).of("parameter")]
    taken = values_for(mhe, LINEAR)
    assert taken["coil.resistance"] == 76.0 and "prior.resistance" not in taken
    assert values_for(("prior.resistance", "prior.inductance"), LINEAR)["prior.resistance"] == 76.0


def test_linear_law_has_no_fringing():
    law = values_for(REDUCED, LINEAR)
    assert law == {"gap.reluctance": 0.0, "gap.slope": 2.7e10, "gap.fringing": 0.0, "coil.turns": 1200.0}
    assert [reduced(law, h) for h in GAPS] == pytest.approx(2.7e10 * GAPS)


def test_actuator_with_another_gap_law_of_the_same_name_gets_its_own():
    names = ("gap.law", "gap.slope", "gap.fringing", "gap.window", "gap.reluctance")
    assert values_for(names, LINEAR)["gap.law"] == "fringing"
    own = {"gap.law": "fringing", "gap.slope": 4.7e10, "gap.fringing": 300.0, "gap.window": 9.73e-3}
    assert values_for(names, own) == own
    assert values_for(("gap.law", "gap.slope", "gap.area", "gap.window"), own) == {}


def test_fringing_law_is_the_same_in_other_symbols():
    law = reduced_gap({"gap.law": "fringing", "gap.area": GAP_AREA, "gap.window": GAP_WINDOW})
    expected = [fringing(h, 1 / (MU_0 * GAP_AREA), GAP_AREA**-0.5, 2 * GAP_WINDOW)[0] for h in GAPS]
    assert [reduced(law, h) for h in GAPS] == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(
    "law",
    [
        {"gap.law": "linear", "gap.slope": 2.7e10},
        {"gap.law": "fringing", "gap.area": GAP_AREA, "gap.window": GAP_WINDOW},
        {
            "gap.law": "fringing",
            "gap.reluctance": 1e6,
            "gap.slope": 4.7e10,
            "gap.fringing": 300.0,
            "gap.window": 9.73e-3,
        },
    ],
    ids=["linear", "valve", "rts"],
)
def test_component_that_takes_a_table_only_gets_one(law):
    values = values_for(("gap.file", "stop.upper"), {**law, "stop.upper": 0.9e-3})
    columns = read_columns(Path(values["gap.file"]))
    form = law if "gap.fringing" in law else reduced_gap(law)
    assert columns["reluctance"] == pytest.approx([reduced(form, h) for h in columns["gap"]], rel=1e-12)
    middle = np.diff(columns["reluctance"]) / np.diff(columns["gap"])
    assert 0.5 * (columns["slope"][1:] + columns["slope"][:-1])[5:] == pytest.approx(middle[5:], rel=1e-3)
    assert columns["gap"][-1] > values["stop.upper"] == 0.9e-3


def test_table_serves_both(tmp_path):
    rows = [
        ",".join(map(repr, row)) for row in zip(VALVE.gap_file_gap, VALVE.gap_file_reluctance, VALVE.gap_file_slope)
    ]
    (tmp_path / "gap.csv").write_text("\n".join(["gap,reluctance,slope", *rows]) + "\n", encoding="utf-8")
    table = {"gap.law": "table", "gap.file": str(tmp_path / "gap.csv")}
    assert values_for(("gap.law", "gap.file", "gap.fringing"), table) == table
    rest = {"coil.turns": 1200.0, "core.reluctance": 3.25e6, "stop.upper": 0.9e-3}
    inductance = 1200.0**2 / (VALVE.gap_file_reluctance[-1] + 3.25e6)
    assert values_for(("prior.inductance",), {**table, **rest})["prior.inductance"] == pytest.approx(inductance)


def test_priors_follow_unless_they_are_given():
    rest = {**LINEAR, "core.reluctance": 3.25e6, "stop.upper": 0.9e-3}
    names = ("prior.resistance", "prior.inductance")
    found = values_for(names, rest)
    assert found["prior.resistance"] == 76.0
    assert found["prior.inductance"] == pytest.approx(52.27e-3, rel=1e-3)  # N^2/(k_air h_max + R_iron0) of [SEMERA]
    assert values_for(names, {**rest, "prior.inductance": 0.05})["prior.inductance"] == 0.05


def test_later_files_win_and_all_problems_are_told(tmp_path):
    for name, text in (("a", "x = 1.0\ny = 2.0"), ("b", "y = 3.0"), ("c", "z = [1]"), ("d", "z = nan")):
        (tmp_path / f"{name}.toml").write_text(f"[values]\n{text}\n", encoding="utf-8")
    assert read_values([tmp_path / "a.toml", tmp_path / "b.toml"]) == {"x": 1.0, "y": 3.0}
    with pytest.raises(InputError) as caught:
        read_values([tmp_path / "c.toml", tmp_path / "d.toml", tmp_path / "e.toml"])
    assert len(caught.value.problems) == 3


@pytest.mark.parametrize(
    ("device", "expected"),
    [
        ({"initial.position": 0.3e-3, "stop.upper": 0.5e-3}, 0.3e-3),
        ({"stop.upper": 0.5e-3}, 0.5e-3),
        ({"stop.lower": 0.1e-3, "stop.upper": 0.5e-3, "spring.rest": 0.02}, 0.5e-3),
        ({"stop.lower": 0.1e-3, "stop.upper": 0.5e-3, "spring.rest": -0.02}, 0.1e-3),
        ({"stop.upper": 0.5e-3, "prior.position": 0.2e-3}, 0.2e-3),
    ],
)
@pytest.mark.parametrize("name", ["bounded_ukf", "hybrid_ekf"])
def test_estimators_begin_where_the_device_does(name, device, expected):
    names = [port.name for port in load_component(own(name)).of("parameter")]
    assert values_for(names, device)["prior.position"] == expected


def test_a_factor_of_the_gap_goes_into_the_law_of_who_has_none(tmp_path):
    law = {"gap.law": "fringing", "gap.reluctance": 1e6, "gap.slope": 4.7e10, "gap.fringing": 300.0, "gap.factor": 1.1}
    assert values_for(("gap.slope", "gap.factor", "gap.fringing"), law)["gap.slope"] == 4.7e10
    taken = values_for(("gap.slope", "gap.reluctance", "gap.fringing"), law)
    assert taken == {"gap.slope": 1.1 * 4.7e10, "gap.reluctance": 1.1e6, "gap.fringing": 300.0}
    (tmp_path / "law.csv").write_text((own("mhe") / "fringing_29.csv").read_text())
    table = {"gap.law": "table", "gap.file": str(tmp_path / "law.csv"), "gap.factor": 1.1}
    before = read_columns(tmp_path / "law.csv")
    for names in (("gap.file",), ("gap.law", "gap.file", "gap.fringing")):
        after = read_columns(Path(values_for(names, table)["gap.file"]))
        assert after["gap"] == pytest.approx(before["gap"])
        assert after["reluctance"] == pytest.approx(1.1 * before["reluctance"])
    assert values_for(("gap.file", "gap.factor"), table)["gap.file"] == str(tmp_path / "law.csv")


def test_a_deviation_of_the_resistance_is_not_taken_for_one():
    """`Mhe` has priors of everything, `Semera` one of the resistance itself; each set says whose it is."""
    names, values = ("prior.resistance", "prior.inductance"), {"coil.resistance": 48.0, "prior.resistance": 0.1}
    assert values_for(names, {**values, "prior.eddy": 0.05})["prior.resistance"] == 48.0
    assert values_for(names, {**values, "prior.resistance": 47.0})["prior.resistance"] == 47.0
