"""Numbers in a page: in files as Python writes them, in tables as a report does, and metrics as a run measures them."""

from __future__ import annotations

import math
import random
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gapsense.cosim.result.metrics import KINDS
from gapsense.report.table import PREFIXES, UNPREFIXED, quantity

PAGE = Path(__file__).resolve().parents[2] / "src" / "gapsense" / "page"
KNOWN = {"prefixes": PREFIXES, "unprefixed": UNPREFIXED}


@pytest.fixture(scope="module")
def page(browser: Any) -> Any:
    opened = browser.new_page()
    for name in ("numbers.js", "measure.js"):
        opened.add_script_tag(content=(PAGE / name).read_text(encoding="utf-8"))
    yield opened
    opened.close()


def doubles(count: int) -> list[float]:
    """Numbers of all sizes: any bits, and what a run has."""
    draw = random.Random(7)
    bits = [struct.unpack("<d", draw.randbytes(8))[0] for _ in range(count)]
    sizes = [draw.choice((-1, 1)) * draw.random() * 10.0 ** draw.randint(-9, 20) for _ in range(count)]
    whole = [float(draw.randint(-(10**17), 10**17)) for _ in range(100)]
    edges = [0.0, -0.0, 1e16, 9999999999999998.0, 1e-4, 9.999e-5, 1e22, 5e-324, 1.7976931348623157e308, 0.1, 1 / 3]
    return [x for x in (*bits, *sizes, *whole, *edges, *(-x for x in edges)) if np.isfinite(x)]


def test_numbers_in_files_are_those_of_python(page):
    numbers = doubles(4000)
    texts = page.evaluate("(numbers) => numbers.map(pythonNumber)", numbers)
    assert [(x, text) for x, text in zip(numbers, texts) if text != repr(x)] == []


def test_numbers_that_are_not_finite_are_written_as_python_does(page):
    assert page.evaluate("[NaN, Infinity, -Infinity].map(pythonNumber)") == ["nan", "inf", "-inf"]


@pytest.mark.parametrize("unit", ["V", "kg", "1", "", "m", "Ohm"])
def test_quantities_are_those_of_a_report(page, unit):
    numbers = [x for x in doubles(300) if abs(x) < 1e12] + [0.99999, 0.0099996, 1234.5678, 4.199e-3, 0.0]
    texts = page.evaluate(
        "([numbers, unit, known]) => numbers.map((x) => quantity(x, unit, known))", [numbers, unit, KNOWN]
    )
    assert [(x, t, quantity(x, unit)) for x, t in zip(numbers, texts) if t != quantity(x, unit)] == []


def test_typed_number_has_the_bits_of_its_digits_in_the_base_unit(page):
    cases = [("0.7", -3, 0.7e-3), ("22.5", -3, 22.5e-3), ("1e-3", -6, 1e-9), ("-3.3", -6, -3.3e-6), ("48", 0, 48.0)]
    found = page.evaluate("(cases) => cases.map(([text, power]) => shifted(Number(text), power))", cases)
    assert found == [x for _, _, x in cases]
    assert page.evaluate("shifted(7e-4, 3)") == 0.7


@pytest.mark.parametrize("kind", KINDS)
def test_metric_of_samples_is_that_of_a_run(page, kind):
    draw = np.random.default_rng(3)
    y, x, times = draw.normal(size=300), draw.normal(size=300), np.arange(300) * 1e-3
    of = KINDS[kind]
    arguments = [y, x] if of.reference == "axis" else [y, times] if of.takes_times else [y]
    arguments += [draw.normal(size=300), draw.normal(size=300)] if of.takes_flows else []
    found = page.evaluate("([kind, args]) => MEASURES[kind](...args)", [kind, [a.tolist() for a in arguments]])
    assert found == pytest.approx(of.compute(*arguments), rel=1e-12)


def test_every_kind_of_metric_is_measured(page):
    assert sorted(page.evaluate("Object.keys(MEASURES)")) == sorted(KINDS)


TIMES = {"start": -0.5, "baseStep": 0.25, "count": 9, "decimation": 2}


def test_part_of_a_run_is_nan_where_it_has_not_come(page):
    plan = {**TIMES, "signals": [["a.x", "m"], ["a.y", "V"]]}
    found = page.evaluate("([record, plan]) => columnsOf({ record, events: [] }, plan)", [[1.0, 2.0, 3.0, 4.0], plan])
    assert found["times"] == [-0.5, 0.0, 0.5, 1.0, 1.5] and found["rows"] == 5
    np.testing.assert_array_equal(found["signals"]["a.x"], [1.0, 3.0, *[math.nan] * 3])
    np.testing.assert_array_equal(found["signals"]["a.y"], [2.0, 4.0, *[math.nan] * 3])


@pytest.mark.parametrize(
    ("metric", "window"),
    [
        ({}, [-math.inf, math.inf]),
        ({"after": 0.1, "before": None}, [0.1, math.inf]),
        ({"event": "bad", "after": 0.5}, [1.0, math.inf]),
        ({"event": "bad", "before": 0.25}, [0.5, 0.75]),
        ({"event": "other"}, [math.inf, math.inf]),
    ],
)
def test_window_of_a_metric_counts_from_the_first_beginning_of_its_event(page, metric, window):
    run = {"events": [["bad", 4, 5], ["bad", 7, None]]}
    assert page.evaluate("([metric, run, plan]) => windowOf(metric, run, plan)", [metric, run, TIMES]) == window


@pytest.mark.slow
def test_bond_takes_the_values_that_the_steps_had(page):
    """With Jacobi those of inputs stand a row before."""
    plan = {**TIMES, "decimation": 1, "count": 3, "components": [{"name": "a", "step": 1, "offset": 0}]}
    signals = {"a.e": [1.0, 2.0, 3.0, 4.0], "b.e": [5.0, 1.0, 2.0, 0.0], "a.f": [1.0, 1.0, 2.0, 2.0], "b.f": [3.0] * 4}
    plan["signals"] = [[name, ""] for name in signals]
    metric = {"kind": "bond", "signal": "a.e", "reference": "b.e", "flows": ["a.f", "b.f"]}
    late = {**metric, "isLate": [False, True, True, False]}
    run = {"rows": 4, "times": [0.0] * 4, "signals": signals, "events": []}
    found = page.evaluate("([metric, run, plan]) => measure(metric, run, plan)", [late, run, plan])
    e, o, f, g = np.array([2.0, 3.0, 4.0]), np.array([5.0, 1.0, 2.0]), np.array([1.0, 1.0, 2.0]), np.full(3, 3.0)
    assert found == pytest.approx(KINDS["bond"].compute(e, o, f, g))
