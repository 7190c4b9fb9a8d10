"""All kernels over runs, in C and by numpy: each run has the numbers that it has alone."""

from __future__ import annotations

import random
from typing import Any

import numpy as np
import pytest
from kernel_cases import input_sequence, kernel, kernel_modules, parameters

from gapsense.lanes import stepped
from gapsense.lanes.kernels import plan_of
from gapsense.records import flat, names

RUNS, SAMPLES = 11, 40  # a number of runs that no vector divides
LARGE = 4000  # nodes of a graph whose C takes seconds to compile
ERRORS = (ZeroDivisionError, OverflowError, ValueError)  # of Python, where C goes on with inf or NaN


def cases(name: str, degenerate: bool) -> tuple[list[Any], list[list[Any]], Any, list[Any]]:
    """Parameters and inputs of each run, and the same as arrays."""
    rngs = [random.Random(100 + run) for run in range(RUNS)]
    pars = [parameters(name, rng) for rng in rngs]
    inputs = [[*input_sequence(name, rng, SAMPLES, degenerate)] for rng in rngs]
    par = [v[0] if isinstance(v[0], list) else np.array(v) for v in zip(*map(flat, pars))]
    return pars, inputs, np.array([[flat(given) for given in run] for run in inputs]).transpose(1, 2, 0), par


def alone(name: str, inputs: list[Any], par: Any) -> list[Any]:
    """Outputs of one run by scalar Python, as far as it comes: it has errors where C has infinity."""
    k, found = kernel(name), []
    try:
        state, outputs = k.initial(inputs[0], par)
        found.append(flat(outputs))
        for given in inputs[1:]:
            state, outputs = k.step(state, given, par)
            found.append(flat(outputs))
    except ERRORS:
        pass
    return found


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[pytest.mark.slow] * (kernel(name).graphs[1].tape.count > LARGE))
        for name in kernel_modules()
    ],
)
def test_every_run_has_the_bits_that_it_has_alone(name, compiler):
    """Also where inputs are zero, tiny or huge."""
    pars, inputs, columns, par = cases(name, degenerate=True)
    assert plan_of(kernel(name), SAMPLES, ()).library
    found, compared = stepped(kernel(name), columns, par), 0
    for run, (given, own) in enumerate(zip(inputs, pars)):
        expected = alone(name, given, own)
        np.testing.assert_array_equal(found[: len(expected), :, run], expected, f"run {run}")
        compared += len(expected)
    assert compared >= 0.75 * RUNS * SAMPLES


@pytest.mark.parametrize("name", ["estimators.integral", "actuators.solenoid_valve", "sensor.sensor"])
def test_numpy_gives_the_same_but_for_rounding(name, monkeypatch):
    k = kernel(f"gapsense.{name}")
    _, _, columns, par = cases(f"gapsense.{name}", degenerate=False)
    by_numpy = plan_of.__wrapped__(k, SAMPLES, ())
    by_numpy.__dict__["library"] = None
    found = stepped(k, columns, par)
    monkeypatch.setattr("gapsense.lanes.kernels.plan_of", lambda *_: by_numpy)
    expected = stepped(k, columns, par)
    scale = np.maximum(np.abs(expected), 1e-3 * np.abs(expected).max(axis=(0, 2), keepdims=True))
    assert np.all(np.abs(found - expected) <= 1e-9 * scale)


def test_chosen_outputs_and_shared_inputs_and_parameters():
    name = "gapsense.estimators.semera"
    k, (_, _, columns, par) = kernel(name), cases(name, degenerate=False)
    every = names(k.module.Outputs)
    par = [np.mean(v) if i else v for i, v in enumerate(par)]
    whole = stepped(k, columns[:, :, :1], par)
    np.testing.assert_array_equal(stepped(k, columns[:, :, :1], par, every[2:0:-1]), whole[:, 2:0:-1])
    assert whole.shape == (SAMPLES, len(every), RUNS)
