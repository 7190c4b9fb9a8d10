"""Values laid over a scenario are checked as strictly as its own, and `--set` is named as their place."""

from __future__ import annotations

import pytest

from gapsense.cosim import ScenarioError, changed, check, load, run, sweep
from gapsense.cosim.scenario.records import Port


def test_value_wins_over_sets_variants_and_the_file(write, chain, fmus):
    text = chain + "[variants.fast]\ncomponents.source.set.slope = 4.0\n"
    source = changed(write(text), ["source.slope = 3", "lag.time.constant=0.5"])
    assert load(source).components["source"].values == {"slope": 3}
    assert load(source, "fast").components["source"].values == {"slope": 3}
    plain, other = run(write(text), fmus=fmus), run(source, fmus=fmus)
    assert (plain["source.y"][-1], other["source.y"][-1]) == (3.0, 4.0)
    assert plain.run.scenario == other.run.scenario == "demo"
    assert set(other.run.files) - set(plain.run.files) == {"changes"}
    assert changed("x", []) == "x"


def test_input_and_seed_that_the_file_states_are_replaced_there(write, chain, fmus):
    text = chain.replace(
        '[[connections]]\nfrom = "source.y"\nto = "lag.u"\n', "[inputs]\nlag.u = 2\n[seeds]\nlag = 4\n"
    )
    source = changed(write(text), ["lag.u=3.5", "lag.seed=7"])
    assert load(source).inputs == {Port("lag", "u"): 3.5}
    assert load(source).seeds == {"lag": 7}
    assert load(source).components["lag"].values == {}


@pytest.mark.parametrize(
    ("setting", "expected"),
    [
        ("source.slop=1", "components.source (from --set): unknown parameter `slop`. Did you mean `slope`?"),
        ("sourc.slope=1", "--set, sourc.slope: there is no component `sourc`. Did you mean `source`?"),
        ("source.slope=fast", 'components.source (from --set): `slope` is `"fast"`, a value of type Real is expected'),
        ("source.slope=nan", "--set, source.slope: `nan` found, a finite number"),
        ("source.slope=[1]", "--set, source.slope: `[1]` found, a finite number"),
        ("source.table.file=none.csv", "--set, source.table.file: there is no file"),
        ("source.y=1", "(from --set): `y` is not a parameter but has the causality `output`"),
        ("lag.u=true", "inputs.lag.u: `true` found, a value of type Real is expected"),
        ("lag.seed=-1", "--set, lag.seed: `-1` found, a whole number of at least 0 expected"),
    ],
)
def test_wrong_value_is_told_with_its_place(write, chain, fmus, setting, expected):
    text = chain.replace(
        '[[connections]]\nfrom = "source.y"\nto = "lag.u"\n', "[inputs]\nlag.u = 2\n[seeds]\nlag = 4\n"
    )
    found = check(changed(write(text + "[sweep]\ngain.gain = [1.0, 2.0]\n"), [setting]), fmus=fmus)
    assert any(expected in problem for problem in found), found


@pytest.mark.parametrize(
    ("settings", "expected"),
    [
        (["source.slope"], "--set, source.slope: `component.parameter=value` expected"),
        (["slope=1"], "--set, slope=1: `component.parameter=value` expected"),
        (["a.b=1", "a.b=2"], "--set, a.b: given twice"),
    ],
)
def test_setting_that_is_none_is_told_with_what_is_wrong_with_the_file(write, chain, fmus, settings, expected):
    broken = chain.replace("[experiment]", "[experiment]\nmehtod = 1")
    with pytest.raises(ScenarioError, match=expected) as error:
        load(changed(write(broken), settings))
    assert any("mehtod" in problem for problem in error.value.problems)
    assert any(expected in problem for problem in check(changed(write(chain), settings), fmus=fmus))


def test_variant_that_is_none_is_told_with_what_is_wrong_with_the_file(write, chain, fmus):
    found = check(write(chain.replace("[experiment]", "[experiment]\nmehtod = 1")), "nope", fmus)
    assert len(found) == 2 and "there is no variant `nope`" in found[0] and "mehtod" in found[1]


def test_file_is_relative_to_the_working_folder(write, chain, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "u.csv").touch()
    scenario = load(changed(write(chain), ["source.table.file=u.csv"]))
    assert scenario.components["source"].values["table.file"] == str(tmp_path / "u.csv")


def test_sweep_runs_with_it_and_computes_anew_for_another(write, chain, fmus, tmp_path):
    metric = '[sweep]\ngain.gain = [1.0, 2.0]\n[metrics.end]\nkind = "final"\nsignal = "source.y"\n'
    file = write(chain + metric)
    ends = [
        sweep(changed(file, settings), fmus=fmus, workers=1, out=tmp_path).metrics["end"].tolist()
        for settings in ([], ["source.slope=3"])
    ]
    assert ends == [[3.0, 3.0], [4.0, 4.0]]


def test_what_a_sweep_gives_is_set_for_a_run_only(write, chain, fmus):
    source = changed(write(chain + "[sweep]\ngain.gain = [1.0, 2.0]\n"), ["gain.gain=3"])
    assert run(source, fmus=fmus).parameters["gain.gain"] == 3.0
    with pytest.raises(ScenarioError, match=r"--set, gain.gain: `\[sweep\]` gives it too. Keep one."):
        sweep(source, fmus=fmus)
