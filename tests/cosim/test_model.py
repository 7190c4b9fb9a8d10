"""A scenario as an object is the same model as its file: same checks, same sentences, same bits."""

from __future__ import annotations

import gc
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import gapsense
from gapsense import Scenario
from gapsense.cosim import FmuError, ScenarioError, check, read_result, run
from gapsense.cosim.fmu.instance import Instance
from gapsense.cosim.scenario.build import plain
from gapsense.problems import InputError


@pytest.fixture
def ramp(fmus, tmp_path):
    """Source, lag and gain, as in the text `chain`."""
    with Scenario("ramp", folder=tmp_path, fmus=fmus, stop=1.0, base_step=0.1) as scenario:
        scenario.add("source", "Source", slope=2.0).add("lag", "Lag").add("gain", "Gain")
        yield scenario.connect("source.y", "lag.u").connect("lag.y", "gain.u")


@pytest.fixture
def loads(monkeypatch):
    """Names of the instances loaded."""
    names: list[str] = []
    plain = Instance.__init__

    def counting(self: Instance, name: str, *arguments: object) -> None:
        names.append(name)
        plain(self, name, *arguments)

    monkeypatch.setattr(Instance, "__init__", counting)
    return names


def test_object_and_file_give_the_same_bits(ramp, write, chain, fmus):
    ours, theirs = ramp.run(), run(write(chain), fmus=fmus)
    assert list(ours.signals) == list(theirs.signals)
    assert all(np.array_equal(ours[name], theirs[name]) for name in ours.signals)


def test_saved_scenario_is_the_same_model(ramp, tmp_path, fmus):
    ramp.connect("lag.y", "gain.u", factor=2.0, unit="V").record("lag.*", decimation=2)
    ramp.metric("end", "final", "lag.y", bounds=(-np.inf, np.float64(3.0)), description="two\nlines")
    ramp.set("lag.time.constant", np.float32(0.5)).set("source.table", {"file": None})
    file = ramp.save(tmp_path)
    loaded = Scenario.load(file, fmus)
    assert (file.name, loaded.data) == ("scenario.toml", ramp.data)
    results = (ramp.run(), loaded.run(), run(file, fmus=fmus))
    assert len({result["lag.y"].tobytes() for result in results}) == 1
    assert [r.metrics["end"].value for r in results] == 3 * [results[0]["lag.y"][-1]]


TEXTS = st.text(max_size=8)
VALUES = st.floats(allow_nan=False) | st.integers(-(2**60), 2**60) | st.booleans() | TEXTS
LISTS, TABLES = st.lists(VALUES, max_size=3), st.dictionaries(TEXTS, VALUES, max_size=3)


@example({"description": "a\r\nb\r"})
@given(st.dictionaries(TEXTS, VALUES | LISTS | TABLES, max_size=4))
@settings(max_examples=20)
def test_whatever_is_in_it_is_written_exactly(content):
    with TemporaryDirectory() as folder:
        scenario = Scenario(folder=folder)
        scenario.data |= {"title": "t", **content}
        assert Scenario.load(scenario.save(folder)).data == plain(scenario.data)


def test_numpy_values_and_paths_are_those_of_toml(ramp, tmp_path):
    ramp.data["record"] = {"signals": ("lag.y",), "decimation": np.int64(2)}
    assert Scenario.load(ramp.save(tmp_path)).data["record"] == {"signals": ["lag.y"], "decimation": 2}
    assert list(ramp.run().signals) == ["lag.y"]


def test_relative_paths_stay_valid_where_it_is_saved(ramp, tmp_path, fmus):
    (tmp_path / "sets").mkdir()
    (tmp_path / "sets" / "lag.toml").write_text('[values]\n"time.constant" = 0.5\n')
    (tmp_path / "u.csv").write_text("x\n")
    (tmp_path / "rows.csv").write_text("source.slope\n1.0\n")
    (tmp_path / "mine.fmu").write_bytes((fmus / "Gain.fmu").read_bytes())
    ramp.add("mine", Path("mine.fmu")).connect("lag.y", "mine.u")
    ramp.components["lag"]["parameters"] = ["sets/lag.toml"]
    ramp.components["source"]["set"]["t"] = {"file": "u.csv"}
    ramp.data |= {"sweep": {"rows": "rows.csv", "gain.t.file": ["u.csv"]}, "baseline": {"file": "b.csv"}}
    ramp.data["variants"] = {"other": {"components": {"lag": {"parameters": ["sets/lag.toml"]}}}}
    moved = Scenario.load(ramp.save(tmp_path / "deep" / "er" / "my.toml")).data
    assert moved["components"]["lag"]["parameters"] == ["../../sets/lag.toml"]
    assert moved["components"]["source"]["set"] == {"slope": 2.0, "t": {"file": "../../u.csv"}}
    assert moved["components"]["mine"]["fmu"] == "../../mine.fmu"
    assert moved["components"]["gain"]["fmu"] == "Gain"
    assert moved["sweep"] == {"rows": "../../rows.csv", "gain.t.file": ["../../u.csv"]}
    assert moved["baseline"] == {"file": "../../b.csv"}
    assert moved["variants"]["other"]["components"]["lag"]["parameters"] == ["../../sets/lag.toml"]


def test_changed_value_runs_on_the_loaded_fmus(ramp, loads):
    first = ramp.run()
    changed = ramp.set("source.slope", 3.0).run()
    again = ramp.set("source.slope", 2.0).run()
    ramp.data["experiment"]["stop"] = 0.5
    assert ramp.run().times[-1] == 0.5
    assert sorted(loads) == ["gain", "lag", "source"]
    assert (first["source.y"][-1], changed["source.y"][-1]) == (3.0, 4.0)
    assert first["lag.y"].tobytes() == again["lag.y"].tobytes()


def test_parameter_that_is_given_no_more_has_its_start_value_again(ramp):
    plain = ramp.set("lag.time.constant", 0.25).run()
    del ramp.components["lag"]["set"]
    fresh = Scenario("ramp", folder=ramp.path.parent, fmus=ramp.fmus)
    fresh.data = {**ramp.data}
    with fresh:
        assert ramp.run()["lag.y"].tobytes() == fresh.run()["lag.y"].tobytes() != plain["lag.y"].tobytes()


def test_added_component_and_another_wire_load_anew(ramp, loads):
    ramp.run()
    ramp.add("second", "Gain").connect("lag.y", "second.u")
    assert "second.y" in ramp.run().signals and len(loads) == 7
    ramp.connect("source.y", "second.u")
    assert np.array_equal((result := ramp.run())["second.u"], result["source.y"]) and len(loads) == 11


def test_object_runs_in_another_process_where_it_says_so(ramp, loads):
    here = ramp.run()
    ramp.data["experiment"]["isolation"] = "process"
    away = ramp.run()
    assert away["lag.y"].tobytes() == here["lag.y"].tobytes() and len(loads) == 3
    ramp.data["experiment"]["isolation"] = "none"
    ramp.components["lag"]["isolation"] = "process"
    assert ramp.run()["lag.y"].tobytes() == here["lag.y"].tobytes() and sorted(loads)[1:] == [
        "gain",
        "lag",
        "source",
        "source",
    ]


def test_set_knows_where_a_value_belongs(ramp, fmus):
    ramp.set("lag.u", 2.0)
    assert ramp.data["inputs"] == {"lag.u": 2.0} and ramp.data["connect"] == {"gain.u": "lag.y"}
    ramp.connect("source.y", "lag.u", factor=1.0)
    assert ramp.data["inputs"] == {} and len(ramp.data["connections"]) == 1
    ramp.connect({"lag.u": "source.y"})
    assert ramp.data["connections"] == [] and ramp.data["connect"]["lag.u"] == "source.y"
    ramp.add("noise", "Noise", {"sample_time": 0.1}, seed=np.int64(3), step=2)
    assert ramp.data["seeds"] == {"noise": 3}
    assert ramp.components["noise"] == {"fmu": "Noise", "step": 2, "set": {"sample_time": 0.1}}
    ramp.components["lag"]["set"] = {"time": {"constant": 3.0}}
    assert ramp.set("lag.time.constant", 1).components["lag"]["set"] == {"time.constant": 1}


def test_components_are_connected_by_the_names_of_their_ports(fmus, tmp_path):
    scenario = Scenario("loop", tmp_path, fmus, stop=1.0, base_step=0.1).add("a", "Gain").add("b", "Gain")
    with pytest.raises(ScenarioError, match="no output and input of one name: `a` has y, mode"):
        scenario.connect("a", "b")
    scenario.pairs = lambda source, target: [("a.y", "b.u")]
    assert scenario.connect("a", "b").data["connect"] == {"b.u": "a.y"}


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (lambda s: s.set("sourc.slope", 1), "ramp, sourc.slope: there is no component `sourc`. Did you mean `source`?"),
        (lambda s: s.set("source", 1), "ramp, source: `component.variable` expected."),
        (lambda s: s.connect("sourc.y", "lag.u"), "Did you mean `source`?"),
        (lambda s: s.add("lag", "Lag"), "there is a component `lag` already"),
    ],
)
def test_component_that_is_not_there_is_told_at_once(ramp, change, expected):
    with pytest.raises(ScenarioError) as caught:
        change(ramp)
    assert expected in str(caught.value)


def test_typos_get_the_sentences_of_a_file_all_at_once(ramp, write, chain, fmus):
    ramp.set("source.slop", 1).connect("source.z", "lag.u").record("lagg.*")
    ramp.data["experiment"]["metod"] = "jacobi"
    text = chain.replace("slope = 2.0", "slope = 2.0, slop = 1").replace('"source.y"', '"source.z"')
    text = text.replace("base_step", 'metod = "jacobi"\nbase_step') + '[record]\nsignals = ["lagg.*"]\n'
    theirs = check(write(text), fmus=fmus)
    ours = [problem.replace("ramp,", "scenario.toml,") for problem in ramp.check()]
    sentences = [{p.partition(": ")[2] for p in problems} for problems in (ours, theirs)]
    assert sentences[0] == sentences[1] and len(ours) == 4
    with pytest.raises(ScenarioError) as caught:
        ramp.run()
    assert caught.value.problems == ramp.check()


def test_component_that_failed_is_loaded_again(fmus, tmp_path, loads):
    with Scenario("fails", tmp_path, fmus, stop=1.0, base_step=0.1) as scenario:
        scenario.add("bad", "Faulty", u=1.0, at=0.5, fault="raise")
        with pytest.raises(FmuError) as caught:
            scenario.run()
        assert caught.value.result is not None and caught.value.result.times.size
        scenario.set("bad.at", 5.0)
        assert scenario.run().times[-1] == 1.0 and loads == ["bad", "bad"]


def test_forgotten_scenario_leaves_nothing(fmus, tmp_path):
    scenario = Scenario("a", tmp_path, fmus, stop=0.2, base_step=0.1).add("source", "Source")
    scenario.run()
    instance = scenario.master.parts[0].instance
    assert not instance.is_dead
    del scenario
    gc.collect()
    assert instance.is_dead


def test_sweep_of_an_object_needs_no_file(ramp, tmp_path):
    ramp.metric("end", "final", "source.y")
    with pytest.raises(ScenarioError, match=r"sweep.source.slope: one value found, a list"):
        ramp.sweep({"source.slope": 1.0})
    swept = ramp.sweep({"source.slope": [1.0, np.float64(2.0)]}, workers=1, out=tmp_path)
    assert swept.metrics["end"].tolist() == [2.0, 3.0]
    assert (swept.computed, ramp.sweep(workers=1, out=tmp_path).computed) == (2, 0)
    ramp.set("lag.time.constant", 0.5)
    assert ramp.sweep(workers=1, out=tmp_path).computed == 2
    frame = swept.to_pandas()
    assert frame["source.slope"].tolist() == [1.0, 2.0] and frame.attrs["units"] == {"source.slope": "V/s", "end": "V"}
    assert repr(swept) == "<Sweep: 2 runs, 1 metrics>"
    assert "<td>end</td>" in swept._repr_html_()


def test_variant_of_an_object(ramp):
    ramp.data["variants"] = {"steep": {"components": {"source": {"set": {"slope": 4.0}}}}}
    assert ramp.run("steep")["source.y"][-1] == 5.0
    assert ramp.check("stee")[0].endswith("Did you mean `steep`?")


# What is shown --------------------------------------------------------------------------------------------------------


def test_objects_tell_what_they_are(ramp, tmp_path):
    assert repr(ramp) == "<Scenario 'ramp': source (Source), lag (Lag), gain (Gain), not loaded>"
    ramp.metric("end", "final", "lag.y", bounds=[100.0, 200.0], label="<end>")
    result = ramp.run()
    assert ", loaded>" in repr(ramp)
    line = "<Result 'ramp': 11 rows from 0 s to 1 s, 7 signals, 1 metrics (1 outside their bounds)>"
    assert repr(result) == line
    assert repr(read_result(result.save(tmp_path / "r.csv"))) == line
    for shown in (ramp, result):
        html = shown._repr_html_()
        assert html.count("<table>") == html.count("</table>") == 2 and "<end>" not in html
    assert "outside its bounds" in result._repr_html_()


def test_plot_draws_the_chosen_signals(ramp):
    figure = ramp.run().plot("lag.*", "gain.y")
    assert [axis.get_ylabel() for axis in figure.axes] == ["voltage / V", "y / mA"]
    assert figure._repr_png_()[:4] == b"\x89PNG"
    with pytest.raises(InputError, match=r"`lagg.y` was not recorded"):
        ramp.run().plot("lagg.y")


def test_result_as_data_frame(ramp, monkeypatch):
    result = ramp.run()
    frame = result.to_pandas()
    assert np.array_equal(frame["lag.y"].to_numpy(), result["lag.y"]) and frame.index.name == "time"
    assert frame.attrs["units"]["gain.y"] == "A"
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(InputError, match=r"pip install 'gapsense\[pandas\]'"):
        result.to_pandas()


def test_package_offers_its_names_lazily():
    assert {"Scenario", "run", "check", "read_result", "Result"} <= set(dir(gapsense))
    assert gapsense.run is run and gapsense.check is check
    with pytest.raises(AttributeError, match="no attribute 'Scenari'"):
        _ = gapsense.Scenari
    code = "import gapsense, sys; print('numpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout == "False\n"
