"""What is wrong with events is told before a run, all at once, with place, what was expected and what to do."""

from __future__ import annotations

import re

import pytest
from events_text import RAMP, event

from gapsense import Scenario
from gapsense.cosim import ScenarioError, check, run, sweep
from gapsense.cosim.scenario.read import changed


def problems(write, fmus, text, variant=None):
    return check(write(RAMP + text), variant, fmus)


def ok(**more):
    """Keys of an event without problems, with others laid over them."""
    keys = {"target": "tuned.u", "action": "set", "value": 1.0, "at": 0.5, **more}
    return event("e", **keys)


WRONG = {
    "target = 1": (ok(target=1), "`1` found, a text expected"),
    "no dot": (ok(target="tuned"), "events.e.target: `tuned` found, `component.variable` expected"),
    "component": (ok(target="tunde.u"), "there is no component `tunde`. Did you mean `tuned`?"),
    "variable": (ok(target="tuned.gian"), "unknown variable `gian` in `tuned`. Did you mean `gain`?"),
    "output": (ok(target="tuned.y"), "the output `tuned.y` drives no input. Connect it, or choose another"),
    "types of inputs": (ok(target="source.y", value=True), "found, a value of type Real is expected"),
    "fixed": (ok(target="tuned.start"), "`tuned.start` is fixed and cannot change during a run; tunable"),
    "no tunable": (ok(target="source.level"), "it has none that is tunable"),
    "action": (ok(action="bais"), "events.e.action: `bais` found. Did you mean `bias`?"),
    "unknown key": (ok(untill=1.0), "events.e.untill: unknown key. Did you mean `until`?"),
    "no value": (ok(value=None), "events.e.value: missing; `set` needs the value"),
    "value too many": (ok(action="stuck"), "events.e.value: `stuck` has no value. Remove it."),
    "text": (ok(value="on"), 'found, a value of type Real is expected'),
    "text for a number": (ok(action="bias", value="on"), "`bias` needs a number"),
    "range": (ok(target="tuned.gain", value=101.0), "events.e.value: 101.0 found, 0 to 100 expected"),
    "range after": (ok(target="tuned.gain", action="scale", value=51.0), "`tuned.gain` becomes 102.0: 0 to 100 exp"),
    "type": (ok(target="tuned.mode", value=1.5), "a value of type Integer is expected"),
    "not real": (ok(target="tuned.mode", action="bias"), "`bias` needs a target of type Real, `tuned.mode` is Integer"),
    "stuck parameter": (ok(target="tuned.gain", action="stuck", value=None), "`stuck` is for inputs"),
    "spread": (ok(action="noise", value=-1.0), "-1.0 found, a standard deviation cannot be negative"),
    "seed": (ok(seed=1), "events.e.seed: `set` is not random"),
    "over missing": (ok(action="ramp"), "events.e.over: missing; `ramp` needs its duration"),
    "over too many": (ok(over=0.5), "events.e.over: `set` begins at once. Remove it, or use `ramp`."),
    "over": (ok(action="bias", over=0.25), "events.e.over: 0.25 s is 2.5 base steps of 0.1 s"),
    "between": (ok(at=0.55), "events.e.at: 0.55 s is not a base step; the nearest are 0.5 s and 0.6 s"),
    "until between": (ok(until=0.71), "events.e.until: 0.71 s is not a base step; the nearest are 0.7 s and 0.8 s"),
    "before": (ok(at=-0.1), "events.e.at: -0.1 s is outside the run from 0 s to 2 s"),
    "late": (ok(at=2.1), "events.e.at: 2.1 s is outside the run"),
    "start": (ok(action="stuck", value=None, at=0.0), "at the start there is no earlier value"),
    "order": (ok(until=0.5), "`at` is 0.5 s and `until` is 0.5 s. `at` must be the smaller one."),
    "two ends": (ok(until=1.0, duration=0.5), "events.e.duration: `until` gives the end too. Keep one."),
    "never": (ok(at=None), "neither found, either `at` or `when` expected"),
    "both": (ok(when={"signal": "source.y", "above": 1.0}), "both found, either `at` or `when` expected"),
    "until when": (ok(at=None, until=1.0, when={"signal": "source.y", "above": 1.0}), "lasts for a `duration`"),
    "again": (ok(at=None, when={"signal": "source.y", "above": 1.0, "again": True}), "happens once. Add `duration`."),
    "level": (ok(at=None, when={"signal": "source.y"}), "events.e.when: neither found, either `above` or `below`"),
    "levels": (ok(at=None, when={"signal": "source.y", "above": 1.0, "below": 0.0}), "events.e.when: both found"),
    "signal": (ok(at=None, when={"signal": "source.z", "above": 1.0}), "events.e.when.signal: `source.z`: unknown"),
    "parameter": (ok(at=None, when={"signal": "source.level", "above": 1.0}), "no input or output that is a number"),
    "signal of none": (ok(at=None, when={"signal": "sorce.y", "above": 1.0}), "Did you mean `source`?"),
    "when key": (ok(at=None, when={"signal": "source.y", "above": 1.0, "agian": True}), "when.agian: unknown key"),
    "after": (ok(at=None, when={"signal": "source.y", "above": 1.0, "after": 3.0}), "when.after: 3 s is outside"),
    "for": (ok(at=None, when={"signal": "source.y", "above": 1.0, "for": 0.01}), "when.for: 0.01 s is 0.1 base"),
    "name": (ok().replace("[events.e]", '[events."e 1"]'), "an event's name is letters, digits and `_`"),
    "no table": ("[events]\ne = 1\n", "events.e: `1` found, a table expected"),
    "list": ("[[events]]\ntarget = 1\n", "events: a list found, a table expected"),
    "called events": (ok() + '[components.events]\nfmu = "Noise"\n', "no component may have this name"),
    "swept": (ok() + "[sweep]\nevents.e.at = [0.5, 0.55]\n", "sweep, events.e.at: 0.55 s is not a base step"),
    "swept kind": (ok() + '[sweep]\nevents.e.enabled = ["no"]\n', "events.e.enabled: `\"no\"` found, true or"),
    "swept key": (ok() + "[sweep]\nevents.e.vlaue = [1.0]\n", "sweep, events.e.vlaue: unknown key. Did"),
    "swept event": (ok() + "[sweep]\nevents.f.at = [0.5]\n", "there is no event `f`."),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_wrong_event_is_refused(write, fmus, name):
    text, words = WRONG[name]
    found = problems(write, fmus, text)
    assert any(words in problem for problem in found), found
    assert len(found) == 1, found
    assert found[0].startswith("scenario.toml, ")


def test_all_problems_are_told_at_once(write, fmus):
    plain = [text for text, _ in WRONG.values() if text.startswith("[events.e]") and not re.search(r"\[[cs]", text)]
    texts = [
        text.replace("events.e]", f"events.e{k}]").replace("events.e.", f"events.e{k}.") for k, text in enumerate(plain)
    ]
    found = problems(write, fmus, "".join(texts))
    assert len(texts) > 30
    for k in range(len(texts)):
        assert any(f"events.e{k}." in p or f"events.e{k}:" in p for p in found), texts[k]


def test_text_is_no_target(write, fmus):
    text = '[components.types]\nfmu = "Types"\n[inputs]\ntypes.step = 1\ntypes.is_on = true\ntypes.label = "n"\n'
    (found,) = problems(write, fmus, text + ok(target="types.label", value="m"))
    assert "`types.label` is a text" in found
    (found,) = problems(write, fmus, text + ok(target="types.step", value=2.5))
    assert "a value of type Integer is expected" in found


# Other ways to say it -------------------------------------------------------------------------------------------------


def test_variant_changes_a_key_of_an_event_and_adds_another(write, fmus):
    text = (
        ok()
        + "[variants.late.events.e]\nat = 1.5\n"
        + ok(action="bias").replace("[events.e]", "[variants.late.events.f]")
    )
    path = write(RAMP + text)
    assert check(path, fmus=fmus) == []
    assert [(s.name, s.begin) for s in run(path, "late", fmus).events] == [("f", 0.5), ("e", 1.5)]
    assert [(s.name, s.begin) for s in run(path, fmus=fmus).events] == [("e", 0.5)]


def test_value_on_the_command_line_changes_a_key_of_an_event(write, fmus):
    path = write(RAMP + ok())
    result = run(changed(path, ["events.e.at=1.5", "events.e.value=-4"]), fmus=fmus)
    assert [s.begin for s in result.events] == [1.5] and result["tuned.u"][15] == -4.0
    with pytest.raises(ScenarioError, match=r"no event `f`\. Known: `e`"):
        run(changed(path, ["events.f.at=1.5"]), fmus=fmus)
    with pytest.raises(ScenarioError, match=r"unknown key\. Did you mean `value`"):
        run(changed(path, ["events.e.vlaue=1.5"]), fmus=fmus)


def test_object_has_the_event_of_the_file(write, fmus, tmp_path):
    path = write(RAMP + event("e", "tuned.u", "stuck", duration=0.5, when={"signal": "source.y", "above": 2.0}))
    with Scenario.load(write(RAMP, "other"), fmus) as scenario:
        scenario.event("e", "tuned.u", "stuck", duration=0.5, when={"signal": "source.y", "above": 2.0})
        ours, theirs = scenario.run(), run(path, fmus=fmus)
        assert ours.events == theirs.events and len(ours.events) == 1
        assert ours["tuned.u"].tobytes() == theirs["tuned.u"].tobytes()
        scenario.event("f", "tuned.gain", "set", value=3.0, at=1.0)
        assert [s.name for s in scenario.run().events] == ["e", "f"]
        saved = run(scenario.save(tmp_path / "saved"), fmus=fmus)
        assert [s.name for s in saved.events] == ["e", "f"]


METRIC = '[metrics.seen]\nkind = "final"\nsignal = "tuned.seen"\n'


def test_sweep_goes_through_keys_of_events_with_any_number_of_workers(write, fmus, tmp_path):
    text = ok(target="tuned.u", action="noise", value=1.0, until=1.5) + METRIC
    text += "[sweep]\nevents.e.at = [0.2, 0.7]\nevents.e.value = [0.5, 2.0, 4.0]\n"
    path = write(RAMP + text)
    one, two = (sweep(path, 2, workers=n, fmus=fmus, out=tmp_path / str(n)) for n in (1, 2))
    assert one.indices == tuple(range(12)) and not one.errors
    assert one.metrics["seen"].tobytes() == two.metrics["seen"].tobytes()
    assert len(set(one.metrics["seen"])) == 12
    assert (one.units["events.e.at"], one.units["events.e.value"]) == ("s", "V")
    single = run(changed(path, ["events.e.at=0.7", "events.e.value=2.0"]), fmus=fmus, seed_shift=4)
    assert one.metrics["seen"][4] == single.metrics["seen"].value


def test_combination_that_contradicts_itself_is_told_before_the_first_run(write, fmus):
    (found,) = problems(write, fmus, ok(until=1.0) + "[sweep]\nevents.e.at = [0.5, 1.2]\n")
    assert "sweep, events.e.until: `at` is 1.2 s and `until` is 1 s" in found
