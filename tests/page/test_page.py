"""What a page is made of: controls and their texts, wires in C, and what is refused."""

from __future__ import annotations

import re
import sys
import zipfile
from pathlib import Path
from types import SimpleNamespace
from xml.etree import ElementTree

import pytest
from typer.testing import CliRunner

from gapsense.cli import app
from gapsense.cosim import ScenarioError, check
from gapsense.cosim.check import prepare
from gapsense.cosim.run.recording import Subject
from gapsense.cosim.scenario.read import load
from gapsense.fmi.ports import Port
from gapsense.page import module, plan
from gapsense.page.content import CONTROLS, band, controls, scale
from gapsense.page.page import pack_binary, write_page
from gapsense.vectors import engine

ROOT = Path(__file__).resolve().parents[2]
SCENARIOS = ROOT / "scenarios"
PORT = Port("x", "parameter", "kg", "A parameter", nominal=2.0)


@pytest.fixture(scope="module")
def valve(fmus: Path) -> Subject:
    return Subject(*prepare(SCENARIOS / "semera_valve", None, fmus))


def without_controls(text: str) -> str:
    return re.sub(r"\[page\]\ncontrols = \[.*?\n\]\n", "", text, flags=re.DOTALL)


def changed(tmp_path: Path, old: str, new: str, name: str = "semera_valve") -> Path:
    """A shipped scenario with another text."""
    text = (SCENARIOS / name / "scenario.toml").read_text(encoding="utf-8")
    assert old in text
    text = text.replace(old, new, 1).replace('"parameters/', f'"{SCENARIOS}/{name}/parameters/')
    (tmp_path / "scenario.toml").write_text(text, encoding="utf-8")
    return tmp_path


def test_controls_are_those_that_the_scenario_names_in_its_order(valve):
    names = [control["name"] for control in controls(valve)]
    assert names == list(load(SCENARIOS / "semera_valve").page.controls) and len(names) == 9


def test_without_names_controls_are_the_first_tunable_numbers_that_components_are_given(tmp_path, fmus):
    text = (SCENARIOS / "semera_valve" / "scenario.toml").read_text(encoding="utf-8")
    (tmp_path / "scenario.toml").write_text(
        without_controls(text).replace('"parameters/', f'"{SCENARIOS}/semera_valve/parameters/'), encoding="utf-8"
    )
    subject = Subject(*prepare(tmp_path, None, fmus))
    names = [control["name"] for control in controls(subject)]
    assert len(names) == CONTROLS and names[0] == "drive.square.amplitude"
    for name in names:
        component, _, parameter = name.partition(".")
        assert subject.descriptions[component].variables[parameter].is_tunable
        assert parameter in subject.scenario.components[component].values


def test_texts_and_references_are_those_of_the_model_descriptions(valve):
    for control in controls(valve):
        component, _, parameter = control["name"].partition(".")
        with zipfile.ZipFile(valve.descriptions[component].path) as file:
            root = ElementTree.fromstring(file.read("modelDescription.xml"))
        variable = next(v for v in root.iter("ScalarVariable") if v.get("name") == parameter)
        assert control["text"] == variable.get("description")
        assert control["reference"] == int(variable.get("valueReference"))
        assert valve.order.names[control["part"]] == component


def test_choice_has_the_choices_of_its_parameter(fmus):
    subject = Subject(*prepare(SCENARIOS / "run_to_run", None, fmus))
    law = next(control for control in controls(subject) if control["name"] == "controller.law")
    assert list(law["choices"]) == ["contact", "model"] and "low" not in law and law["start"] == "contact"


@pytest.mark.parametrize(("end", "is_variance"), [("_std", False), ("_variance", True)])
def test_band_comes_from_the_deviation_or_variance_that_is_recorded_beside_a_signal(end, is_variance):
    result = SimpleNamespace(signals={"ekf.position": (), f"ekf.position{end}": (), "ekf.velocity": ()})
    assert band(result, "ekf.position") == {"signal": f"ekf.position{end}", "isVariance": is_variance, "sigmas": 2.0}
    assert band(result, "ekf.velocity") is None


@pytest.mark.parametrize(
    ("limits", "value", "ends"),
    [
        ({}, 8.0, (2.0, 32.0)),
        ({}, 0.0, (-2.0, 2.0)),
        ({}, -3.0, (-3.0, 3.0)),
        ({"min": 0.0}, 0.0, (0.0, 2.0)),
        ({"min": 4.0}, 8.0, (4.0, 32.0)),
        ({"min": 0.0, "max": 1.0}, 0.5, (0.0, 1.0)),
        ({"min": 1e-9, "max": 1e9}, 8.0, (2.0, 32.0)),
    ],
)
def test_slider_goes_from_a_quarter_to_four_times_within_the_limits(limits, value, ends):
    found = scale(PORT._replace(**limits), value)
    assert (found["low"], found["high"]) == ends


@pytest.mark.parametrize(
    ("unit", "value", "shown"),
    [
        ("m", 0.0225, ("mm", -3)),
        ("A", 2e-6, ("uA", -6)),
        ("kg", 1e-3, ("kg", 0)),
        ("1", 0.5, ("", 0)),
        ("V", 30, ("V", 0)),
    ],
)
def test_unit_is_the_one_that_a_report_shows(unit, value, shown):
    found = scale(PORT._replace(unit=unit), value)
    assert (found["unit"], found["exponent"]) == shown


def test_wires_steps_and_grid_are_in_c_and_values_are_not(valve):
    text = plan.header(valve)
    parts = re.findall(r"\.every = (\d+), \.steps_at = (\d+), \.takes_at = (\d+)", text)
    assert parts == [("1", "1", "0"), ("1", "1", "0"), *[("2", "3", "1")] * 4]
    assert text.count("&model_IntegralEstimator") == 2 and text.count("extern const Model model_") == 5
    assert ".base_step = 2.5e-05" in text and ".start = -0.00105" in text and "77.5" not in text
    links = re.findall(r"static Link links_\d\[\] = \{(.*?)\};", text)
    assert sum(len(re.findall(r"\{\d+, \d+, 0, 1\.0, 0\.0\}", own)) for own in links) == 11
    values = plan.values(valve, valve.make_take())
    assert [own["name"] for own in values] == list(valve.order.names)
    assert [1, "sensor"] in [[value, own["name"]] for own in values for _, kind, value in own["values"] if kind == 1]


def test_conversions_stand_behind_plain_copies_and_files_go_with_their_components(fmus):
    subject = Subject(*prepare(SCENARIOS / "run_to_run", None, fmus))
    own = re.findall(r"links_5\[\] = \{(.*)\};", plan.header(subject))[0]
    converts = [int(link.split(", ")[2]) for link in re.findall(r"\{(.*?)\}", own)]
    assert converts == sorted(converts) and sum(converts) == 1
    assert all(path.count("/") == 2 for path in plan.files(subject))


def test_played_signal_has_a_value_for_each_base_step(tmp_path, fmus):
    ramp = "{ times = [-1.05e-3, 0.1], values = [0.0, 1.0] }"
    folder = changed(tmp_path, '"drive.reference" = 0.0', f'"drive.reference" = {ramp}')
    subject = Subject(*prepare(folder, None, fmus))
    played = re.search(r"played\[\] = \{(.*?)\};", plan.header(subject))[1].split(", ")
    assert len(played) == subject.scenario.experiment.count + 1
    assert (played[0], float(played[-1])) == ("0.0", 1.0) and ".place_count = 1" in plan.header(subject)


def test_control_that_is_no_parameter_is_a_problem_of_the_scenario(tmp_path, fmus):
    folder = changed(tmp_path, '  "valve.damping",\n', '  "valve.dampin",\n  "valve.current",\n')
    problems = check(folder, fmus=fmus)
    assert any("page.controls: `valve.dampin` is no parameter. Did you mean `valve.damping`?" in p for p in problems)
    assert any("page.controls: `valve.current` is no parameter." in p for p in problems)


def test_signal_that_is_shown_first_must_be_recorded(tmp_path, fmus):
    problems = check(changed(tmp_path, "[page]\n", '[page]\nfirst = ["valve.position", "valve.velocity"]\n'), fmus=fmus)
    assert [p for p in problems if "page.first" in p] == [
        "scenario.toml, page.first: `valve.velocity` is not recorded. Add it to `record.signals`."
    ]


def test_scenario_with_fmus_of_others_is_refused_in_a_sentence(tmp_path, fmus, monkeypatch):
    monkeypatch.setattr(engine, "own_guid", lambda *_: "")
    with pytest.raises(ScenarioError, match=r"not from this version: `drive` \(DriveVoltage.fmu\).*gapsense build"):
        write_page(SCENARIOS / "semera_valve", tmp_path / "x.html", fmus=fmus)
    assert not (tmp_path / "x.html").exists()


def test_missing_compiler_is_told_with_what_to_install(tmp_path, fmus, monkeypatch):
    monkeypatch.setattr(module, "zig_version", lambda: None)
    words = ["page", str(SCENARIOS / "semera_valve"), "--fmus", str(fmus), "--out", str(tmp_path / "x.html")]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 2 and "pip install ziglang==" in " ".join(done.output.split())


def test_missing_bokeh_is_told_with_what_to_install(tmp_path, fmus, monkeypatch, zig):
    monkeypatch.setitem(sys.modules, "bokeh", None)
    words = ["page", str(SCENARIOS / "semera_valve"), "--fmus", str(fmus), "--out", str(tmp_path / "x.html")]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 2 and "pip install 'gapsense[report]'" in " ".join(done.output.split())


def test_file_of_others_is_not_replaced(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("semera_valve.html").write_text("mine", encoding="utf-8")
    done = CliRunner().invoke(app, ["page", str(SCENARIOS / "semera_valve")])
    assert done.exit_code == 2 and Path("semera_valve.html").read_text(encoding="utf-8") == "mine"


def test_module_is_packed_as_browsers_unpack_it():
    import base64
    import zlib

    assert zlib.decompress(base64.b64decode(pack_binary(b"\0asm" * 1000)), -zlib.MAX_WBITS) == b"\0asm" * 1000


def test_plotting_library_is_the_version_that_the_page_names_and_has_its_licence():
    folder = ROOT / "src" / "gapsense" / "page" / "uplot"
    from gapsense.page.page import UPLOT

    assert f"v{UPLOT.split()[1]})" in (folder / "uPlot.iife.min.js").read_text(encoding="utf-8")[:100]
    assert "MIT License" in (folder / "LICENSE").read_text(encoding="utf-8")
