"""Events on inputs: a component gets what numpy makes of the recorded signals, whatever the steps and the method."""

from __future__ import annotations

import hashlib

import numpy as np
import pytest
from events_text import HEAD, RAMP, event
from hypothesis import given, settings
from hypothesis import strategies as st

from gapsense.cosim import run
from gapsense.cosim.run.events import noise
from gapsense.kernels.random import normal

BASE, COUNT = 0.1, 20
NUMBER = st.floats(-9.0, 9.0).map(lambda x: round(x, 3))


def taken(step, offset, method):
    """Base steps at which an input is taken: the initialization, and the ends or the beginnings of steps."""
    first = offset + (step if method == "gauss-seidel" else 0)
    return [0, *(k for k in range(first, COUNT + 1, step) if k)]


def number(name, seed, k):
    """Random number of an event for a base step: a hash is the state of a generator."""
    digest = hashlib.sha256(f"{name} {seed} {k}".encode()).digest()
    words = [int.from_bytes(digest[4 * j : 4 * j + 4], "little") for j in range(6)]
    state = [float(w % (4294967087 if j < 3 else 4294944443)) for j, w in enumerate(words)]
    return normal(state)[1]


def expected(source, moments, events, seed=0):
    """Values of the input at the moments at which it is taken."""
    entered, held, out = {}, {}, []
    for k in moments:
        value = source[k]
        for e in events:
            name, passed = e["name"], value
            if e["begin"] <= k < e["end"]:
                held.setdefault(name, entered.get(name))
                since = k - e["begin"]
                share = min(1.0, since / e["steps"]) if e["steps"] else 1.0
                value = {
                    "set": lambda e=e: e["value"],
                    "ramp": lambda e=e, h=held[name], s=share: h + s * (e["value"] - h) if s < 1.0 else e["value"],
                    "bias": lambda e=e, v=value, s=share: v + s * e["value"],
                    "scale": lambda e=e, v=value, s=share: v * (1.0 + s * (e["value"] - 1.0)),
                    "stuck": lambda h=held[name]: h,
                    "dropout": lambda: np.nan,
                    "noise": lambda e=e, v=value, n=name, k=k: v + abs(e["value"]) * number(n, seed, k),
                }[e["action"]]()
            entered[name] = passed
        out.append(value)
    return np.array(out)


@st.composite
def cases(draw):
    """Events on one input, as they are in the file, and steps of its component."""
    events = []
    for j in range(draw(st.integers(1, 3))):
        action = draw(st.sampled_from(["set", "ramp", "bias", "scale", "stuck", "dropout", "noise"]))
        begin = draw(st.integers(int(action in ("ramp", "stuck")), COUNT))
        grows = action == "ramp" or (action in ("bias", "scale") and draw(st.booleans()))
        events.append(
            {
                "name": f"e{j}",
                "action": action,
                "begin": begin,
                "end": draw(st.integers(begin + 1, COUNT + 5)),
                "steps": draw(st.integers(1, 8)) if grows else 0,
                "value": draw(NUMBER),
            }
        )
    return events, draw(st.integers(1, 3)), draw(st.integers(0, 2)), draw(st.sampled_from(["gauss-seidel", "jacobi"]))


def text_of(events):
    """Their text."""
    return "".join(
        event(
            e["name"],
            "tuned.u",
            e["action"],
            value={"stuck": None, "dropout": None, "noise": abs(e["value"])}.get(e["action"], e["value"]),
            over=e["steps"] * BASE or None,
            at=e["begin"] * BASE,
            until=e["end"] * BASE,
        )
        for e in events
    )


@settings(max_examples=25, deadline=None)
@given(case=cases())
def test_input_is_what_numpy_makes_of_the_source(fmus, tmp_path_factory, case):
    events, step, offset, method = case
    path = tmp_path_factory.mktemp("events") / "scenario.toml"
    text = RAMP.replace("base_step = 0.1", f'base_step = 0.1\nmethod = "{method}"')
    path.write_text(text.replace('"Tuned"', f'"Tuned"\nstep = {step}\noffset = {offset}') + text_of(events))
    result = run(path, fmus=fmus)
    moments = taken(step, offset, method)
    values = expected(result["source.y"], moments, events)
    last = np.searchsorted(moments, np.arange(COUNT + 1), side="right") - 1
    np.testing.assert_allclose(result["tuned.u"], values[last], rtol=1e-12, atol=1e-12)
    assert [(s.name, round(s.begin / BASE)) for s in result.events] == sorted(
        ((e["name"], e["begin"]) for e in events if e["begin"] <= COUNT), key=lambda two: (two[1], two[0])
    )
    ends = {e["name"]: e["end"] for e in events}
    assert all(
        ends[s.name] > COUNT if s.end is None else round(s.end / BASE) == ends[s.name] <= COUNT for s in result.events
    )


STEADY = f"""{HEAD}
[components.tuned]
fmu = "Tuned"
[inputs]
"tuned.u" = 2.5
"""


def test_event_on_a_constant_is_a_signal_with_the_same_bits(write, fmus):
    """A played table that holds is an independent way to the same values."""
    events = event("jump", "tuned.u", "set", value=-1.25, at=0.5, until=1.2)
    times, values = [0.0, 0.5, 1.2, 2.0], [2.5, -1.25, 2.5, 2.5]
    signal = f'[inputs.tuned.u]\ntimes = {times}\nvalues = {values}\ninterpolation = "hold"\n'
    one = run(write(STEADY + events), fmus=fmus)
    other = run(write(STEADY.partition("[inputs]")[0] + signal, "other"), fmus=fmus)
    assert np.ptp(one["tuned.u"]) == 3.75
    assert all(one[name].tobytes() == other[name].tobytes() for name in other.signals)


def test_event_on_a_signal_acts_on_what_it_plays(write, fmus):
    signal = "[inputs.tuned.u]\ntimes = [0.0, 2.0]\nvalues = [0.0, 20.0]\n"
    events = event("twice", "tuned.u", "scale", value=2.0, at=1.0)
    result = run(write(STEADY.partition("[inputs]")[0] + signal + events), fmus=fmus)
    k = np.arange(COUNT + 1)
    np.testing.assert_allclose(result["tuned.u"], np.where(k < 10, k, 2.0 * k), rtol=1e-14)


def test_bias_and_scale_from_the_start_are_a_connection_that_converts(write, fmus):
    """The same bits as `factor` and `bias` of a connection, which are there without events."""
    both = event("gain", "tuned.u", "scale", value=0.3, at=0.0) + event("shift", "tuned.u", "bias", value=-0.7, at=0.0)
    long = '[[connections]]\nfrom = "source.y"\nto = "tuned.u"\nfactor = 0.3\nbias = -0.7\nunit = "V"\n'
    one = run(write(RAMP + both), fmus=fmus)
    other = run(write(RAMP.partition("[connect]")[0] + long, "other"), fmus=fmus)
    assert all(one[name].tobytes() == other[name].tobytes() for name in other.signals)


def test_shift_is_the_same_as_an_fmu_in_between(write, fmus):
    between = RAMP.replace('"tuned.u" = "source.y"', '"gain.u" = "source.y"')
    between += '[[connections]]\nfrom = "gain.y"\nto = "tuned.u"\nfactor = 1.0\nunit = "V"\n'
    between += '[components.gain]\nfmu = "Gain"\nset = { gain = -2.0 }\n'
    events = event("reversed", "tuned.u", "scale", value=-2.0, at=0.0)
    one, other = run(write(RAMP + events), fmus=fmus), run(write(between, "other"), fmus=fmus)
    assert all(one[name].tobytes() == other[name].tobytes() for name in ("tuned.u", "tuned.seen"))


def test_events_that_do_nothing_leave_all_bits(write, fmus):
    nothing = event("off", "tuned.u", "set", value=7.0, at=0.5, enabled=False)
    nothing += event("never", "tuned.u", "dropout", when={"signal": "source.y", "above": 1e9})
    nothing += event("same", "tuned.gain", "set", value=2.0, at=0.5)
    one, other = run(write(RAMP + nothing), fmus=fmus), run(write(RAMP, "other"), fmus=fmus)
    assert [span.name for span in one.events] == ["same"]
    assert all(one[name].tobytes() == other[name].tobytes() for name in other.signals)


def test_lost_samples_reach_the_component_as_nan(write, fmus):
    result = run(write(RAMP + event("lost", "tuned.u", "dropout", at=0.5, until=0.9)), fmus=fmus)
    assert result["tuned.lost"][-1] == 4.0
    assert np.flatnonzero(np.isnan(result["tuned.u"])).tolist() == [5, 6, 7, 8]


OTHERS = """
[components.slow]
fmu = "Tuned"
step = 3
[components.late]
fmu = "Gain"
offset = 1
[connect]
"tuned.u" = "source.y"
"slow.u" = "source.y"
[[connections]]
from = "source.y"
to = "late.u"
factor = 2.0
unit = "V"
"""


def test_event_on_an_output_is_one_on_all_inputs_that_it_drives(write, fmus):
    """With the same noise for all that take a value at the same time, after conversions."""
    text = RAMP.partition("[connect]")[0] + OTHERS + event("sensor", "source.y", "noise", value=1.0, at=0.5, until=1.6)
    result = run(write(text), fmus=fmus)
    error, late = result["tuned.u"] - result["source.y"], result["late.u"] - 2.0 * result["source.y"]
    assert np.flatnonzero(error).tolist() == [*range(5, 16)]
    np.testing.assert_allclose(error[2:], late[2:], atol=1e-12)
    np.testing.assert_allclose((result["slow.u"] - result["source.y"])[::3], error[::3], atol=1e-12)
    assert [span[:3] for span in result.events] == [("sensor", "source.y", "noise")]
    assert 0.4 < np.std(error[5:16]) < 2.0


def test_noise_of_events_is_normal_and_white():
    x = np.array([noise("burst", 1, k) for k in range(4000)])
    assert abs(x.mean()) < 0.06 and abs(x.std() - 1.0) < 0.05 and abs(np.mean(np.abs(x) < 1.0) - 0.6827) < 0.03
    others = [np.roll(x, 1), np.array([noise("burst", 2, k) for k in range(4000)])]
    assert all(abs(np.mean(x * other)) < 0.06 for other in others)


def test_noise_of_events_differs_by_name_by_seed_and_by_run(write, fmus):
    def drawn(name, seed, shift):
        text = STEADY + event(name, "tuned.u", "noise", value=1.0, at=0.0, seed=seed)
        result = run(write(text), fmus=fmus, seed_shift=shift)
        assert result.run.seeds == {f"events.{name}": seed + shift}
        return result["tuned.u"].tobytes()

    different = {drawn("a", 0, 0), drawn("b", 0, 0), drawn("a", 1, 0)}
    assert len(different) == 3
    assert drawn("a", 0, 1) == drawn("a", 1, 0)


TYPES = f"""{HEAD}
[components.types]
fmu = "Types"
[inputs]
"types.step" = 2
"types.is_on" = true
"types.label" = "n"
"""


@pytest.mark.parametrize("isolation", ["none", "process"])
def test_inputs_of_other_types_are_set_and_stuck(write, fmus, isolation):
    text = TYPES.replace('"Types"', f'"Types"\nisolation = "{isolation}"')
    text += event("leap", "types.step", "set", value=10, at=0.5, until=0.7)
    text += event("off", "types.is_on", "set", value=False, at=1.0, until=1.5)
    text += event("hold", "types.step", "stuck", at=0.6, until=0.9)
    result = run(write(text), fmus=fmus)
    steps = np.diff(result["types.count"])
    assert steps.tolist() == [2] * 4 + [10] * 4 + [2] + [0] * 5 + [2] * 6
