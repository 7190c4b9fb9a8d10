"""Metrics that tell when a signal is above or below a level for the first time."""

from __future__ import annotations

import math

import pytest
from events_text import RAMP, event

from gapsense.cosim import check, run


def text(kind, reference, **more):
    keys = {"kind": kind, "signal": "tuned.u", "reference": reference, "bounds": [0.0, math.inf], **more}
    return "[metrics.time]\n" + "".join(
        f"{k} = {f'{chr(34)}{v}{chr(34)}' if isinstance(v, str) else v}\n" for k, v in keys.items()
    )


@pytest.mark.parametrize(
    ("kind", "reference", "more", "expected"),
    [
        ("until_above", 3.95, {}, 1.0),  # 1 + 3 t
        ("until_above", 3.95, {"after": 0.45}, 0.55),
        ("until_above", 4.0, {}, 1.1),  # equal is not above
        ("until_above", 8.0, {}, math.inf),
        ("until_below", 0.0, {}, 1.5),
        ("until_below", -9.0, {}, math.inf),
        ("until_above", "source.y", {}, 1.5),
    ],
)
def test_time_until_a_signal_passes_a_level(write, fmus, kind, reference, more, expected):
    fault = 1.5 if kind == "until_below" or reference == "source.y" else None
    sign = -1.0 if kind == "until_below" else 2.0
    events = event("now", "tuned.u", "scale", value=sign, at=fault) if fault else ""
    path = write(RAMP + events + text(kind, reference, **more))
    assert check(path, fmus=fmus) == []
    measured = run(path, fmus=fmus).metrics["time"]
    assert (measured.value, measured.unit, measured.passed) == (pytest.approx(expected), "s", True)


def test_level_is_needed(write, fmus):
    (found,) = check(write(RAMP + '[metrics.time]\nkind = "until_above"\nsignal = "tuned.u"\n'), fmus=fmus)
    assert "metrics.time.reference: missing; `until_above` compares with" in found


def test_times_of_a_metric_count_from_the_first_beginning_of_an_event(write, fmus):
    """Of one with a condition nobody knows it before."""
    now = event(
        "now", "tuned.u", "set", value=9.5, duration=0.3, when={"signal": "source.y", "above": 3.5, "again": True}
    )
    never = event("never", "tuned.u", "set", value=9.5, when={"signal": "source.y", "above": 1e3})
    metrics = text("until_below", 9.0, event="now") + text("max", 0.0, event="now", after=0.25, before=0.45)
    metrics = metrics.replace('[metrics.time]\nkind = "max"', '[metrics.most]\nkind = "max"')
    metrics += '[metrics.none]\nkind = "mean"\nsignal = "tuned.u"\nevent = "never"\n'
    result = run(write(RAMP + now + never + metrics), fmus=fmus)
    assert [round(span.begin, 9) for span in result.events] == [1.0]
    assert result.metrics["time"].value == pytest.approx(0.3)
    assert result.metrics["most"].value == pytest.approx(1.0 + 3.0 * 1.4)
    assert math.isnan(result.metrics["none"].value) and not result.metrics["none"].passed


def test_event_of_a_metric_must_be_there(write, fmus):
    wrong = '[metrics.none]\nkind = "mean"\nsignal = "tuned.u"\nevent = "nwo"\n'
    (found,) = check(write(RAMP + event("now", "tuned.u", "set", value=1.0, at=0.5) + wrong), fmus=fmus)
    assert "metrics.none.event: there is no event `nwo`. Did you mean `now`?" in found
