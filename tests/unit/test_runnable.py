"""The classes of components: bits and refusals of the FMUs, many records, steps, and words for what is wrong."""

from __future__ import annotations

import csv
import inspect
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import gapsense
from gapsense import runnable
from gapsense._os.native import own_compiler
from gapsense.cli import _stubs
from gapsense.fmi.components import find_components, load_component
from gapsense.runnable import Runnable
from gapsense.shipped import COMPONENTS

FOLDERS = {load_component(folder).name: folder for folder in find_components(COMPONENTS)}
MOST = 2_000  # samples in Python, as the FMU has them too: of a record that is longer, in C and by the FMU alone
COMPILED = pytest.mark.skipif(own_compiler() is None, reason="needs a C compiler")


@pytest.fixture(params=["C", "Python"])
def language(request, monkeypatch):
    """Both ways to run: what has no compiler gives the same bits."""
    if request.param == "Python":
        monkeypatch.setattr(runnable, "own_compiler", lambda: None)
    elif own_compiler() is None:
        pytest.skip("needs a C compiler")
    return request.param


def reference(name):
    """Times, inputs and outputs of what the FMU gave."""
    with (FOLDERS[name] / "reference.csv").open(encoding="utf-8") as file:
        heads, *rows = csv.reader(file)
    table, inputs = np.array(rows, dtype=float), len(load_component(FOLDERS[name]).of("input"))
    return heads, table[:, 0], table[:, 1 : 1 + inputs], table[:, 1 + inputs :]


def test_every_component_has_a_class():
    offered = {name: getattr(gapsense, name) for name in gapsense.__all__}
    classes = {name for name, made in offered.items() if isinstance(made, type) and issubclass(made, Runnable)}
    assert classes == set(FOLDERS)
    assert set(dir(gapsense)) >= {*FOLDERS, "Scenario", "run"} and "os" not in dir(gapsense)


@pytest.mark.parametrize("name", sorted(FOLDERS))
def test_bits_are_those_of_the_fmu(name, language):
    heads, times, inputs, outputs = reference(name)
    made = getattr(gapsense, name)()
    period = made.parameters.get("sample_time", times[1])
    samples = round(times[1] / period)  # that fall due in a step of the host
    rows = len(times) if language == "C" else 1 + MOST // samples
    inputs, outputs = inputs[:rows], outputs[:rows]
    held = np.repeat(inputs[1:], samples, axis=0)
    response = made.run(*np.vstack([inputs[:1], held]).T, sample_time=period)
    for k, output in enumerate(heads[1 + inputs.shape[1] :]):
        found, expected = response.outputs[output][::samples], outputs[:, k]
        is_time = load_component(FOLDERS[name]).of("output")[k].unit == "s"  # hosts round times in their own way
        assert np.allclose(found, expected, rtol=1e-15 if is_time else 0.0, atol=0.0), output


@COMPILED
@pytest.mark.parametrize("name", sorted(FOLDERS))
def test_many_records_have_the_bits_of_each_alone_and_of_python(name, monkeypatch):
    inputs = reference(name)[2]
    made, rng = getattr(gapsense, name)(), np.random.default_rng(1)
    many = [x * rng.uniform(0.9, 1.0, (11, 1)) if x.any() and np.ptp(x) > 5.0 else x for x in inputs.T]
    together = made.run(*many, sample_time=20e-6)
    monkeypatch.setattr(runnable, "own_compiler", lambda: None)
    for k in (0, 10):
        alone = made.run(*(x[k] if x.ndim == 2 else x for x in many), sample_time=20e-6)
        for output, values in alone.outputs.items():
            found = together.outputs[output][k] if together.outputs[output].ndim == 2 else together.outputs[output]
            assert found.tobytes() == values.tobytes(), output


@given(st.lists(st.floats(0.0, 30.0), min_size=2, max_size=20), st.data())
def test_steps_are_rows_and_go_on_from_a_saved_state(voltages, data):
    valve = gapsense.SolenoidValve()
    expected = valve.run(voltages, sample_time=25e-6).current
    k = data.draw(st.integers(1, len(voltages) - 1))
    for voltage in voltages[:k]:
        valve.step(voltage, sample_time=25e-6)
    saved = valve.state
    for _ in range(2):
        valve.state = saved
        made = [valve.step(voltage=voltage, sample_time=25e-6).current for voltage in voltages[k:]]
        assert made == expected[k:].tolist()
    valve.reset()
    assert valve.state is None and valve.step(voltages[0], sample_time=25e-6).current == expected[0]


def test_steps_do_not_change_a_state_that_was_saved():
    mhe = gapsense.Mhe()
    mhe.step(0.0, 0.0, 0.0)
    saved = mhe.state
    for _ in range(50):
        mhe.step(24.0, 0.1, 1.0)
    mhe.state = saved
    again = gapsense.Mhe()
    again.step(0.0, 0.0, 0.0)
    assert [mhe.step(24.0, 0.1, 1.0) for _ in range(50)] == [again.step(24.0, 0.1, 1.0) for _ in range(50)]


def stepped(component):
    """A component after its first step."""
    component.step(*[0.0] * 3)
    return component


def test_inputs_are_what_they_say_whatever_their_type():
    """Numbers of any type and layout have the same bits; what is masked is a lost sample; an output is named alone."""
    voltage, current = np.full(60, 24.0), np.repeat(np.arange(20) / 64, 3)
    ekf = gapsense.Ekf()
    expected = ekf.run(voltage, current, 3.0)
    for u, i in (([*voltage], tuple(current)), (voltage.astype(int), np.repeat(current, 2)[::2].astype(">f4"))):
        assert np.array_equal(ekf.run(u, i, 3, outputs="position").position, expected.position)
    assert list(ekf.run(voltage, current, 3, outputs="position")._one()) == ["position"]
    lost = np.where(np.arange(60) == 5, np.nan, current)
    masked = ekf.run(voltage, np.ma.masked_invalid(lost), 3.0)
    assert np.array_equal(masked.health, ekf.run(voltage, lost, 3.0).health)
    assert not np.array_equal(masked.health, expected.health)


def test_unknown_name_comes_with_the_module_so_that_python_suggests_another():
    with pytest.raises(AttributeError) as error:
        gapsense.Erts  # noqa: B018
    assert (error.value.name, error.value.obj) == ("Erts", gapsense)


@pytest.mark.parametrize(
    ("act", "words"),
    [
        (
            lambda: gapsense.Ertss(coil_resistanc=3.0),
            "`coil_resistanc` is not a parameter of Ertss. Did you mean `coil_resis",
        ),
        (lambda: gapsense.Ertss(coil_resistance=-3.0), "`coil.resistance` is -3.0; expected at least 1e-09 Ohm."),
        (lambda: gapsense.Ertss(coil_resistance="48"), "`coil.resistance` is `48`; expected a number."),
        (lambda: gapsense.Ertss().run([1.0], [1.0]), "input `mode` missing"),
        (
            lambda: gapsense.Ertss().run([1.0], [1.0], 0.0, modes=1.0),
            "`modes` is not an input of Ertss. Did you mean `mode`?",
        ),
        (lambda: gapsense.Ertss().run([1.0], [1.0], 0.0, mode=1.0), "input `mode` is given twice"),
        (lambda: gapsense.Ertss().run([1.0, 2.0, 3.0], [1.0, 2.0], 0.0), "`voltage` (3,), `current` (2,) found"),
        (lambda: gapsense.Ertss().run([], [], []), "not empty"),
        (lambda: gapsense.SolenoidValve().run([1.0], sample_time=-1.0), "the communication step is -1.0 s"),
        (lambda: gapsense.Ekf().run([1.0], [1.0], 0.0, sample_time=0.0), "`sample_time` is 0.0; expected at least"),
        (lambda: gapsense.Ekf().run([1.0], [1.0], 0.0, outputs=["positon"]), "Did you mean `position`?"),
        (lambda: gapsense.Ekf().run([1.0], [1.0], 0.0).positon, "`positon` is not an output. Did you mean `position`?"),
        (lambda: gapsense.Nothing, "no attribute 'Nothing'"),
        (lambda: gapsense.Ekf().run(None, [1.0], 0.0), "input `voltage` missing"),
        (lambda: gapsense.Ekf().run([1.0 + 0j], [1.0], 0.0), "input `voltage`: complex numbers found"),
        (lambda: gapsense.Ekf().run([1.0], ["a"], 0.0), "input `current`: an array or a number expected, could not"),
        (lambda: gapsense.Ekf().step([1.0, 2.0], 1.0, 0.0), "`run` takes arrays"),
        (lambda: setattr(gapsense.Ekf(), "state", 3), "`3` found, a `state` of another moment of Ekf expected"),
        (lambda: setattr(gapsense.Ekf(), "state", stepped(gapsense.Mhe()).state), "of another moment of Ekf expected"),
    ],
)
def test_what_is_wrong_is_told(act, words):
    with pytest.raises((ValueError, TypeError, AttributeError)) as error:
        act()
    assert words in str(error.value)


def test_refusals_in_a_record_are_those_of_the_fmu_with_run_and_sample(language):
    voltages = np.full((3, 5), 12.0)
    voltages[1, 3] = np.nan
    with pytest.raises(ValueError, match=r"run 1, sample 3: input `voltage` is not finite. Check the component"):
        gapsense.SolenoidValve().run(voltages, sample_time=25e-6)
    with pytest.raises(ValueError, match=r"sample 4: output .* is not finite. Check the parameters"):
        gapsense.SolenoidValve().run([0.0] * 4 + [1e308], sample_time=1e-3)


def test_time_between_samples_is_that_of_the_component_if_it_is_not_given():
    assert gapsense.SolenoidValve().run([0.0, 24.0]).time.tolist() == [0.0, 25e-6]
    assert gapsense.Ekf(sample_time=1e-4).run([0.0, 24.0], 0.0, 0.0).time.tolist() == [0.0, 1e-4]
    assert gapsense.Ekf().run([0.0, 24.0], 0.0, 0.0, sample_time=1e-4).time.tolist() == [0.0, 1e-4]


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("dampin", "`dampin` is not an attribute of Mhe. Did you mean `damping`?"),
        ("damping", "`damping` does not change any more. Make another one: Mhe(damping=1.0)."),
        ("sate", "Did you mean `state`?"),
    ],
)
def test_attribute_that_would_do_nothing_is_refused(name, words):
    with pytest.raises(AttributeError) as error:
        setattr(gapsense.Mhe(), name, 1.0)
    assert words in str(error.value)


def test_parameters_are_to_be_read():
    made = gapsense.Mhe(damping=0.6)
    with pytest.raises(TypeError):
        made.parameters["damping"] = 0.7
    assert made.parameters["damping"] == 0.6


def test_response_shows_itself():
    response = gapsense.SolenoidValve().run(np.full(40, 24.0), sample_time=25e-6)
    assert repr(response).startswith("<SolenoidValve: 40 samples, outputs current, position")
    assert "position" in dir(response) and response.units["position"] == "m"
    assert response.plot("position", "current").axes[0].get_lines()
    frame = response.to_pandas()
    assert frame.index.name == "time" and frame["position"].iloc[-1] == response.position[-1]
    many = gapsense.SolenoidValve().run(np.full((3, 40), 24.0), sample_time=25e-6, outputs=["position"])
    assert len(many) == 3 and list(many.outputs) == ["position"] and many.position.shape == (3, 40)
    assert np.array_equal(many[2].position, response.position) and "3 runs" in repr(many)
    with pytest.raises(TypeError, match="these are 3 runs"):
        many.plot()


def test_column_of_a_table_is_not_taken_for_as_many_runs():
    column = np.ones((40, 1))
    with pytest.raises(ValueError, match=r"`voltage` \(40, 1\), `current` \(40, 1\) found, 40 runs of one sample each"):
        gapsense.Semera().run(column, column)
    assert gapsense.Semera().run(column.T, column[:3]).flux_linkage.shape == (3, 40)  # a current for each run


def test_parameters_come_from_a_file_as_far_as_a_component_has_them(tmp_path):
    file = tmp_path / "valve.toml"
    file.write_text('[values]\n"coil.resistance" = 51.5\ndamping = 0.4\n', encoding="utf-8")
    assert gapsense.SolenoidValve.from_file(file).parameters["coil.resistance"] == 51.5
    changed = gapsense.Semera.from_file(file, gate_sigmas=5.0)
    assert repr(changed) == "Semera(gate_sigmas=5.0)"
    file.write_text("values = 3", encoding="utf-8")
    with pytest.raises(ValueError, match="values"):
        gapsense.SolenoidValve.from_file(file)


def test_core_with_a_bend_is_not_taken_for_one_without(tmp_path):
    file = tmp_path / "fem.toml"
    file.write_text('[values]\n"core.reluctance" = 1.5e6\n"core.saturation" = 0.028\n"core.bend" = 8e6\n', "utf-8")
    with pytest.raises(ValueError, match=r"fem.toml, SolenoidValve: `core.bend` is 8e\+06 1/H.*TableActuator"):
        gapsense.SolenoidValve.from_file(file)
    assert gapsense.Ekf.from_file(file).parameters["core.bend"] == 8e6
    file.write_text('[values]\n"core.reluctance" = 1.5e6\n"core.bend" = 0.0\n', "utf-8")
    assert gapsense.SolenoidValve.from_file(file).parameters["core.reluctance"] == 1.5e6


@pytest.mark.parametrize("name", sorted(FOLDERS))
def test_help_tells_every_port_with_its_unit(name):
    component, made = load_component(FOLDERS[name]), getattr(gapsense, name)
    lines = inspect.getdoc(made).splitlines()
    for port in component.ports:
        field = port.field if port.causality == "parameter" else port.name
        line = next(line for line in lines if line.startswith(f"{field} : "))
        assert port.unit == "1" or port.kind != "Real" or f"[{port.unit}]" in line
    assert list(inspect.signature(made).parameters) == [port.field for port in component.of("parameter")]


def test_types_for_editors_are_those_of_the_port_tables():
    assert _stubs.FILE.read_text(encoding="utf-8") == _stubs.text(), "run `python -m gapsense.cli._stubs`"


CHECKED = """
import gapsense
result = gapsense.Ertss(coil_resistance=48.0).run([1.0], [0.1], 0.0, sample_time=20e-6)
result.position + result.smoothed_position
gapsense.Ertss(coil_resistanc=48.0)
result.positon
"""
SEEN = """
[mypy]
strict = true
[mypy-gapsense,gapsense.components,gapsense.runnable,gapsense._os.offered,gapsense.version]
follow_imports = normal
[mypy-gapsense.*,fmpy.*,scipy.*,matplotlib.*,pandas.*,pyarrow.*,dask.*,distributed.*,bokeh.*]
follow_imports = skip
"""


@pytest.mark.slow
def test_a_type_checker_knows_parameters_and_outputs(tmp_path):
    """It reads what these lines see of the package; all of it is checked by `make types`."""
    (tmp_path / "use.py").write_text(CHECKED, encoding="utf-8")
    (tmp_path / "mypy.ini").write_text(SEEN, encoding="utf-8")
    command = [sys.executable, "-m", "mypy", str(tmp_path / "use.py")]
    environment = {**os.environ, "MYPYPATH": str(Path(gapsense.__file__).parents[1])}
    said = subprocess.run(command, capture_output=True, text=True, check=False, cwd=tmp_path, env=environment).stdout
    assert "coil_resistanc" in said and said.count("error:") == 2 and "positon" in said
