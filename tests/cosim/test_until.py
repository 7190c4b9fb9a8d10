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
