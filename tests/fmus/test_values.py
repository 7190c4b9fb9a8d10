"""One home for parameter values: what a component takes, the same for everybody who gives it values."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from parts import FOLDERS

from gapsense.fmi.components import kernel_of, kernel_parameters, load_component
from gapsense.fmi.ports import Component, Limit
from gapsense.fmi.values import ValuesError, fields, problems
from gapsense.kernels.interface import choice, option, parameter, seed, table
from gapsense.kernels.layout import fields as record_fields
from gapsense.kernels.layout import leaves

CURVE = "x,y\n0,1\n1,2\n"
COMPONENT = Component(
    name="Thing",
    description="For these tests",
    kernel="none",
    rising=(("stop.lower", "stop.upper"),),
    limits=(Limit((("gain", 2), ("stop.upper", -1)), 100.0, "it would melt"),),
    ports=(
        parameter("1", "Gain", 1.0, min=0.0, max=50.0, name="gain"),
        parameter("V", "Offset", 0.0, name="offset"),
        parameter("m", "Lower stop", 0.5, min=0.0, name="stop.lower"),
        parameter("m", "Upper stop", 1.0, min=0.0, name="stop.upper"),
        seed(),
        option("Quiet", True, name="is.quiet"),
        choice("Law: linear, table", name="law")._replace(start="linear", choices=("linear", "table")),
        table("Curve", ("x", "rising:y"), "curve.csv", name="curve.file"),
    ),
)
WRONG: dict[str, tuple[dict[str, Any], list[str]]] = {
    "unknown": ({"gian": 1.0}, ["there is no parameter `gian`. Did you mean `gain`?"]),
    "unlike all": ({"zzzzz": 1.0}, ["there is no parameter `zzzzz`. Remove it."]),
    "truth value": ({"gain": True}, ["`gain` is true; expected a number."]),
    "text": ({"gain": "much"}, ["`gain` is `much`; expected a number."]),
    "broken number": ({"seed": 1.5}, ["`seed` is 1.5; expected a whole number."]),
    "number for a truth value": ({"is.quiet": 1}, ["`is.quiet` is 1; expected true or false."]),
    "number for a text": ({"law": 1.0}, ["`law` is 1.0; expected a text."]),
    "list": ({"gain": [1.0]}, ["`gain` is [1.0]; expected a number."]),
    "too small": ({"stop.lower": -0.1}, ["`stop.lower` is -0.1; expected at least 0 m."]),
    "too large": ({"gain": 51}, ["`gain` is 51; expected 0 to 50."]),
    "not finite": ({"offset": math.inf}, ["`offset` is inf; expected a finite number."]),
    "no number": ({"gain": math.nan}, ["`gain` is nan; expected 0 to 50."]),
    "no choice": ({"law": "round"}, ["`law` is `round`; expected one of linear, table."]),
    "not rising": ({"stop.lower": 1.0}, ["`stop.lower` is 1.0; expected less than `stop.upper` = 1.0."]),
    "over a limit": ({"gain": 10.0}, ["`gain` * `gain` / `stop.upper` is 100; expected less than 100: it would melt."]),
    "several": (
        {"stop.lower": 2.0, "gian": 0.0, "law": "round"},
        ["there is no", "`law` is `round`", "`stop.lower` is 2.0"],
    ),
}


VALUES = st.one_of(st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=3), st.just([1.0]))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "curve.csv").write_text(CURVE)
    return tmp_path


@pytest.mark.parametrize("case", WRONG)
def test_everything_wrong_is_said_in_one_wording(folder, case):
    values, sentences = WRONG[case]
    found = problems(COMPONENT, values)
    assert len(found) == len(sentences)
    assert all(text.startswith(sentence) for text, sentence in zip(found, sentences)), found
    with pytest.raises(ValuesError) as caught:
        fields(COMPONENT, values, folder)
    assert caught.value.problems == found and str(caught.value) == " ".join(found)


def test_good_values_become_fields(folder):
    made = fields(COMPONENT, {"gain": 3, "law": "table", "is.quiet": False, "seed": 7}, folder)
    assert made == {
        "gain": 3.0, "offset": 0.0, "stop_lower": 0.5, "stop_upper": 1.0, "seed": 7.0, "is_quiet": 0.0, "law": 1.0,
        "curve_file_x": [0.0, 1.0], "curve_file_y": [1.0, 2.0],
    }  # fmt: skip
    assert all(isinstance(value, (float, list)) for value in made.values())


def test_problems_of_tables_come_with_the_others(folder):
    (folder / "bad.csv").write_text("x,y\n0,1\n1,1\n2,nan\n")
    with pytest.raises(ValuesError) as caught:
        fields(COMPONENT, {"curve.file": str(folder / "bad.csv"), "gain": -1.0}, folder)
    range_, curve = caught.value.problems
    assert range_.startswith("`gain` is -1.0") and curve.startswith("`curve.file`: bad.csv: ")
    assert "row 3" in curve and "row 4" in curve
    with pytest.raises(ValuesError, match=r"`curve.file`: .*none.csv.* is not a file"):
        fields(COMPONENT, {"curve.file": "none.csv"}, folder)


@given(st.dictionaries(st.sampled_from([*(p.name for p in COMPONENT.ports), "x"]), VALUES))
def test_values_are_taken_or_refused_but_never_break(values):
    found = problems(COMPONENT, values)
    assert all(text.endswith((".", "?")) for text in found)


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda folder: folder.name)
def test_every_component_takes_its_own_start_values(folder):
    component = load_component(folder)
    assert problems(component, {}) == []
    par = kernel_parameters(folder, {})
    assert [name for name, _, _ in leaves(par)] == [*record_fields(kernel_of(component).module.Parameters)]


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda folder: folder.name)
def test_stops_that_are_exchanged_are_refused_by_every_component(folder):
    component = load_component(folder)
    starts = {p.name: p.start for p in component.ports}
    for low, high in component.rising:
        (problem,) = problems(component, {low: 2.0 * starts[high], high: starts[high]})
        assert problem.startswith(f"`{low}` is ") and f"less than `{high}`" in problem
