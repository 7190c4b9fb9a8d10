"""Functions for records and results: the options of the commands, the same answers, arrays as data."""

from __future__ import annotations

import inspect
import pydoc
from pathlib import Path

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

import gapsense
from gapsense.cli import app
from gapsense.identification.options import OPTIONS, OUTPUTS, SHIPPED, key
from gapsense.report.table import text
from gapsense.shipped import RECORDS

NAMES = ("inspect", "identify", "commission", "gap_law", "fem", "estimate", "compare")
ONLY_HERE = {"progress"}
ONLY_THERE = {"compare": {"figure"}}  # `Comparison` has no figure of its own
RECORD = RECORDS / "sample_valve.csv"


def options(name: str) -> dict[str, typer.core.TyperOption]:
    """Options and arguments of a command, as a function would call them."""
    params = typer.main.get_command(app).commands[name.replace("_", "-")].params
    return {p.name if p.param_type_name == "argument" else p.opts[0].strip("-").replace("-", "_"): p for p in params}


def plain(value: object) -> object:
    """A default without what commands and functions say differently: nothing, or no text."""
    return None if value in ((), [], None) else str(value)


@pytest.mark.parametrize("name", NAMES)
def test_function_has_the_options_of_the_command_and_their_defaults(name):
    function, command = getattr(gapsense, name), options(name)
    known = inspect.signature(function).parameters
    assert {*known} - ONLY_HERE == {*command} - ONLY_THERE.get(name, set()) - {"help"}
    for option, parameter in known.items():
        if option not in {"out", "figure", *ONLY_HERE} and parameter.default is not parameter.empty:
            assert plain(parameter.default) == plain(command[option].default), option
    assert all(f"\n{option}" in inspect.getdoc(function) or f", {option}" in function.__doc__ for option in known)


def test_table_of_options_has_what_the_functions_take_and_nothing_else():
    names = [name for name in NAMES if name != "compare"]
    taken = {
        key(name, argument) for name in names for argument in inspect.signature(getattr(gapsense, name)).parameters
    }
    assert taken == {*OPTIONS} and {*OUTPUTS} <= taken and {*SHIPPED} <= taken


def test_gapsense_shows_what_is_public_and_nothing_else():
    import gapsense.cosim

    assert set(dir(gapsense)) == {*gapsense.__all__, "__version__"} and set(NAMES) <= set(gapsense.__all__)
    assert all(inspect.getdoc(getattr(gapsense, name)) for name in gapsense.__all__)
    text = pydoc.plain(pydoc.render_doc(gapsense))
    assert all(f"\n    {name}(" in text for name in NAMES) and "class Scenario" in text
    with pytest.raises(AttributeError, match="no attribute 'identfy'"):
        _ = gapsense.identfy


def test_answer_prints_what_the_command_prints():
    printed = CliRunner().invoke(app, ["inspect", "sample_valve.csv"]).output
    found = gapsense.inspect("sample_valve.csv")
    assert "".join(text(*found.shown, width=80).split()) == "".join(printed.split())
    assert str(found).startswith("sample_valve: 5151 samples every 20 us")


def test_arrays_are_records_too():
    time, voltage, current = np.loadtxt(RECORD, delimiter=",", skiprows=1, usecols=(0, 1, 2)).T * [[1e-3], [1], [1]]
    found = gapsense.inspect({"time": time, "voltage": voltage, "current": current})
    lines, others = str(found).splitlines(), str(gapsense.inspect(RECORD)).splitlines()
    assert lines[1:-2] == others[1:-2] and "record_0" in lines[0]  # the first and the last lines name the record
    with pytest.raises(ValueError, match="current missing"):
        gapsense.inspect({"time": time, "voltage": voltage})
    with pytest.raises(ValueError, match="equal ones expected"):
        gapsense.inspect({"time": time, "voltage": voltage[:-1], "current": current})


def test_estimates_are_arrays_and_are_drawn(fmus, tmp_path):
    found = gapsense.estimate(
        RECORD, estimator="Semera", parameters=RECORDS / "sample_valve.toml", fmus=fmus, figure=tmp_path / "e.png"
    )
    assert found.signals["Semera.resistance"][-1] == pytest.approx(46.0, abs=0.2)
    assert found.signals["time"].shape == found.signals["Semera.flux_linkage"].shape
    assert found.files == [tmp_path / "e.png"] and (tmp_path / "e.png").stat().st_size > 10_000
    assert found.plot().axes and "Semera" in str(found)


def test_gap_law_gives_its_parameters_and_keeps_the_files_that_it_needs(tmp_path):
    gap = np.linspace(0.1, 1.0, 6)
    rows = "".join(f"{g:.3g},{50.0 / (0.2 + g):.6g}\n" for g in gap)
    (tmp_path / "measured.csv").write_text(f"gap [mm],inductance [mH]\n{rows}")
    found = gapsense.gap_law(tmp_path / "measured.csv", turns=1000.0, out=tmp_path / "gap.toml")
    assert (tmp_path / "gap.toml").is_file() and found.files == [tmp_path / "gap.toml"]
    assert found.parameters["coil.turns"] == 1000.0 and found.parameters["gap.law"] == "linear"
    assert found.parameters["gap.slope"] == pytest.approx(1e6 / 50e-3 / 1e-3 * 1.0, rel=1e-3)
    assert {*found.standard_errors} == {"core.reluctance", "gap.slope"}
    assert all(0.0 <= error < 1e-4 * found.parameters[name] for name, error in found.standard_errors.items())


def test_results_are_compared_by_file(tmp_path):
    times = np.arange(5.0)
    for name, values in {"a": times, "b": times + [0.0, 0.0, 1e-3, 0.0, 0.0]}.items():
        np.savetxt(tmp_path / f"{name}.csv", np.c_[times, values], delimiter=",", header="time [s],x [V]", comments="")
    a, b = tmp_path / "a.csv", tmp_path / "b.csv"
    assert gapsense.compare(a, a)[str(a)].passed
    (found,) = gapsense.compare(a, b, edge_steps=0).values()
    assert not found.passed and [d.name for d in found.failing] == ["x"]
    assert gapsense.compare(a, b, tolerance={"x": "0.1"})[str(a)].passed
    assert gapsense.compare(a, b, before=1.0)[str(a)].passed
    with pytest.raises(ValueError, match="RTOL"):
        gapsense.compare(a, b, tolerance=["x"])


@pytest.mark.parametrize("options", [{"period": -1.0}, {"period": float("nan")}, {"resistance": "48"}])
def test_numbers_beyond_the_limits_of_the_command_are_refused_here_too(options):
    (name,) = options
    with pytest.raises(ValueError, match=f"--{name}: .* found, a number of at least 1e-09 expected"):
        gapsense.inspect(RECORD, **options)


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (3, "`3` found; a file, a mapping of arrays, or a list"),
        ([], "no record is given"),
        ([RECORD, RECORD], "2 records found, one expected"),
        ({"time": ["a"], "voltage": [1.0], "current": [1.0]}, "a record needs arrays of numbers"),
        (dict.fromkeys(("time", "voltage", "current"), np.zeros((3, 3))), r"\(samples,\) for each"),
    ],
)
def test_what_is_no_record_is_told(data, words):
    with pytest.raises((ValueError, TypeError), match=words):
        gapsense.estimate(data, estimator="Semera")


def test_what_is_missing_is_asked_for(tmp_path):
    with pytest.raises(ValueError, match="stop"):
        gapsense.identify(RECORD, model="solenoid_valve")
    with pytest.raises(ValueError, match="one of auto, coil, solenoid_valve expected"):
        gapsense.identify(RECORD, model="relay")
    assert [*Path(tmp_path).iterdir()] == []
