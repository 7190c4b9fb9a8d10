"""All kernels over runs, in C and in Python: each run has the numbers that it has alone."""

from __future__ import annotations

import random
from typing import Any

import numpy as np
import pytest
from kernel_cases import input_sequence, kernel, kernel_modules, parameters
from traced import graph

from gapsense.kernels.lanes import Code, over_runs, plan, step_runs
from gapsense.kernels.lanes.kernels import plan_of
from gapsense.kernels.layout import flat, names
from gapsense.kernels.trace import where

RUNS, SAMPLES = 11, 40  # a number of runs that no vector divides
LARGE = {  # their C takes seconds to compile
    *("gapsense.actuators.reluctance_actuator", "gapsense.control.run_to_run", "gapsense.estimators.ekf"),
    *("gapsense.estimators.ertss", "gapsense.estimators.mhe.mhe", "gapsense.estimators.ukf"),
    *(
        "gapsense.actuators.table_actuator",
        "gapsense.actuators.play_actuator",
        "gapsense.drive.power_stage",
        "gapsense.estimators.monitor.monitor",
    ),
}
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
    "name", [pytest.param(name, marks=[pytest.mark.slow] * (name in LARGE)) for name in kernel_modules()]
)
def test_every_run_has_the_bits_that_it_has_alone(name, compiler):
    """Also where inputs are zero, tiny or huge."""
    pars, inputs, columns, par = cases(name, degenerate=True)
    assert plan_of(kernel(name), SAMPLES, ()).library
    found, compared = step_runs(kernel(name), columns, par), 0
    for run, (given, own) in enumerate(zip(inputs, pars)):
        expected = alone(name, given, own)
        np.testing.assert_array_equal(found[: len(expected), :, run], expected, f"run {run}")
        compared += len(expected)
    assert compared >= 0.75 * RUNS * SAMPLES


@pytest.mark.parametrize("degenerate", [False, True])
@pytest.mark.parametrize("name", ["drive.drive_voltage", "estimators.ertss", "sensor.sensor"])
def test_without_c_every_run_has_its_bits_too_and_is_nan_after_an_error(name, degenerate, monkeypatch):
    """Tables, memory, and numbers alone."""
    k = kernel(f"gapsense.{name}")
    pars, inputs, columns, par = cases(f"gapsense.{name}", degenerate)
    in_python = plan_of.__wrapped__(k, SAMPLES, ())
    in_python.__dict__["library"] = None
    monkeypatch.setattr("gapsense.kernels.lanes.kernels.plan_of", lambda *_: in_python)
    found = step_runs(k, columns, par)
    for run, (given, own) in enumerate(zip(inputs, pars)):
        expected = alone(f"gapsense.{name}", given, own)
        np.testing.assert_array_equal(found[: len(expected), :, run], expected)
        assert np.isnan(found[len(expected) :, :, run]).all()


@pytest.mark.parametrize("in_c", [True, False])
def test_runs_may_have_tables_of_their_own(in_c, compiler, monkeypatch):
    name = "gapsense.actuators.solenoid_valve"
    pars, inputs, columns, par = cases(name, degenerate=False)
    factors = 1.0 + 0.01 * np.arange(RUNS)
    names_, place = names(kernel(name).module.Parameters), next(k for k, v in enumerate(par) if isinstance(v, list))
    plans = plan_of.__wrapped__(kernel(name), SAMPLES, ())
    monkeypatch.setattr("gapsense.kernels.lanes.kernels.plan_of", lambda *_: plans)
    if not in_c:
        plans.__dict__["library"] = None
    values = np.array(par[place])
    par[place] = values[:, None] * factors
    found = step_runs(kernel(name), columns, par)
    for run in (0, 3, RUNS - 1):
        own = pars[run]._replace(**{names_[place]: (values * factors[run]).tolist()})
        np.testing.assert_array_equal(found[:, :, run], alone(name, inputs[run], own))


def test_kernels_in_a_loop_are_a_plan_of_their_own(compiler):
    """A valve, an estimator of its flux linkage, and a law that switches the voltage by it: as each run does alone."""
    valve, semera = kernel("gapsense.actuators.solenoid_valve"), kernel("gapsense.estimators.semera")
    law = Code(graph(lambda wanted, flux, current: where(flux < wanted, 24.0, 0.0) - current))
    current, flux = (k.module.Outputs._fields.index(n) for k, n in ((valve, "current"), (semera, "flux_linkage")))

    def walk(of_valve, of_semera, wanted):
        numbers = iter(of_valve)
        of_valve = [tables.get(k) or next(numbers) for k in range(len(valve.module.Parameters._fields))]
        dt, first, second = 50e-6, over_runs(valve), over_runs(semera)
        constants = first.constants(of_valve), second.constants(of_semera)
        state, outputs = first.initial((0.0, 0.0, 24.0), of_valve)
        known, seen = second.initial((24.0, outputs[current]), of_semera)
        for k in range(1, SAMPLES):
            (voltage,) = law((*wanted, seen[flux], outputs[current]))
            state, outputs = first.advance(state, (k * dt, dt, voltage), constants[0])
            known, seen = second.advance(known, (voltage, outputs[current]), constants[1])
        return *outputs, *seen

    pars = [[flat(parameters(k.module.__name__, random.Random(run))) for run in range(RUNS)] for k in (valve, semera)]
    tables = {k: value for k, value in enumerate(pars[0][0]) if isinstance(value, list)}
    numbers = [[v for k, v in enumerate(par) if k not in tables] for par in pars[0]]
    columns = {
        "of_valve": np.array(numbers).T,
        "of_semera": np.array(pars[1]).T,
        "wanted": np.linspace(0, 0.05, RUNS)[None],
    }
    recorded = plan(walk, **{name: len(column) for name, column in columns.items()})
    assert recorded.library
    found = recorded.run(RUNS, **columns)
    for run in range(RUNS):
        expected = walk(**{name: tuple(column[:, run].tolist()) for name, column in columns.items()})
        np.testing.assert_array_equal(found[:, run], expected)


def test_chosen_outputs_and_shared_inputs_and_parameters():
    name = "gapsense.estimators.semera"
    k, (_, _, columns, par) = kernel(name), cases(name, degenerate=False)
    every = names(k.module.Outputs)
    par = [np.mean(v) if i else v for i, v in enumerate(par)]
    whole = step_runs(k, columns[:, :, :1], par)
    np.testing.assert_array_equal(step_runs(k, columns[:, :, :1], par, every[2:0:-1]), whole[:, 2:0:-1])
    assert whole.shape == (SAMPLES, len(every), RUNS)
