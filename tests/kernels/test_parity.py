"""One source, four uses: source on floats, generated Python, C and numpy compute the same."""

from __future__ import annotations

import random
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from c_code import CKernel
from kernel_cases import (
    components,
    covariance_diagonal,
    disturbed,
    input_sequence,
    is_estimator,
    kernel,
    kernel_modules,
    parameters,
)

from gapsense.embedded.design import prune_graphs
from gapsense.fmi.components import kernel_parameters, own
from gapsense.kernels.emit import Graph, Python, indexing, namespace
from gapsense.kernels.kernel import Kernel
from gapsense.kernels.layout import flat, names, record

RUNS = 8
FEW, MANY = (3, 20), (8, 50)  # random sequences, and their lengths
SLOW = "gapsense.actuators.play_actuator"  # whose source takes 50 ms per step: a third of them
LONG = ("gapsense.estimators.mhe.mhe", "gapsense.control.run_to_run")  # whose code takes a second to generate
SMALL = ("gapsense.estimators.integral", "gapsense.sensor.sensor", "gapsense.actuators.pot_magnet")
MODULES = kernel_modules()
ERRORS = (ZeroDivisionError, OverflowError, ValueError)  # of Python, where C goes on with inf or NaN


def scalars(record: Any) -> list[float]:
    """Flat entries without array memory."""
    return [float(v) for v in flat(record) if not isinstance(v, list)]


def memory(record: Any) -> list[list[float]]:
    return [v for v in flat(record) if isinstance(v, list)]


def same(a: Any, b: Any) -> bool:
    """Equal bits but for the sign of a zero; NaN equals NaN."""
    return bool(np.array_equal(np.asarray(a, float), np.asarray(b, float), equal_nan=True))


def differing(record: Any, found: Any) -> list[str]:
    return [f"{v!r} != {w!r}" for v, w in zip(scalars(record), found) if not same(v, w)]


def attempt(function: Any, *args: Any) -> Any:
    try:
        return function(*args)
    except ERRORS as error:
        return error


def test_kernels_are_found() -> None:
    assert {"gapsense.estimators.semera", "gapsense.estimators.integral"} <= set(MODULES)


@pytest.fixture(params=MODULES)
def name(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.mark.parametrize(("sequences", "length"), [FEW, pytest.param(*MANY, marks=pytest.mark.slow)])
def test_source_python_and_c_agree_bit_for_bit(name: str, sequences: int, length: int, tmp_path: Path) -> None:
    k, c = kernel(name), CKernel(kernel(name), tmp_path)
    length = length // 3 if name == SLOW and sequences == MANY[0] else length
    compared = 0
    for seed in range(sequences):
        rng = random.Random(seed)
        par = parameters(name, rng)
        inputs = list(input_sequence(name, rng, length + 1))
        state, outputs = k.module.initial(inputs[0], par)
        state_py, outputs_py = k.initial(inputs[0], par)
        c.call("initial", inputs[0], par)
        assert same(scalars(state), scalars(state_py)) and same(scalars(state), c.state)
        assert same(scalars(outputs), scalars(outputs_py)) and same(scalars(outputs), c.outputs)
        for given in inputs[1:]:
            if rng.random() < 0.1:
                state = disturbed(state, rng)
                state_py = _copied(state, state_py)
                c.state[:] = scalars(state)
            found = attempt(k.module.step, state, given, par)
            found_py = attempt(k.step, state_py, given, par)
            if isinstance(found, Exception) or isinstance(found_py, Exception):
                assert type(found) is type(found_py), f"source: {found!r}, generated Python: {found_py!r}"
                break
            c.call("step", given, par)
            (state, outputs), (state_py, outputs_py) = found, found_py
            assert same(scalars(outputs), scalars(outputs_py)), differing(outputs, scalars(outputs_py))
            assert same(scalars(state), scalars(state_py)), differing(state, scalars(state_py))
            assert same(scalars(outputs), c.outputs), differing(outputs, c.outputs)
            assert same(scalars(state), c.state), differing(state, c.state)
            compared += 1
        else:  # after an error nothing goes on from the memory
            for a, b, d in zip(memory(state), memory(state_py), c.memory):
                assert same(a, b) and same(a, d)
    assert compared >= 0.75 * sequences * length, f"only {compared} steps could be compared"


def _copied(state: Any, own: Any) -> Any:
    """`state`, with the array memory of `own`."""
    return record(type(state), [kept if isinstance(kept, list) else new for new, kept in zip(flat(state), flat(own))])


def test_scalar_python_has_plain_floats_only(name: str) -> None:
    rng = random.Random(1)
    k, par = kernel(name), parameters(name, rng)
    inputs = list(input_sequence(name, rng, 5, degenerate=False))
    state, outputs = k.initial(inputs[0], par)
    for given in inputs[1:]:
        state, outputs = k.step(state, given, par)
        kinds = {type(v) for v in [*flat(state), *flat(outputs)] if not isinstance(v, list)}
        assert kinds <= {float, int, bool}, kinds


def test_a_record_in_one_call_equals_its_steps(name: str, tmp_path: Path) -> None:
    """By scalar Python, and by C where it is compiled at once."""
    rng, k = random.Random(2), kernel(name)
    par, inputs = parameters(name, rng), list(input_sequence(name, rng, 20, degenerate=False))
    state, outputs = k.initial(inputs[0], par)
    expected = [flat(outputs)]
    for given in inputs[1:]:
        state, outputs = k.step(state, given, par)
        expected.append(flat(outputs))
    last, found = k.run(inputs, par)
    assert same(found, expected) and same(scalars(last), scalars(state))
    if name in SMALL:
        assert same(CKernel(k, tmp_path).run(np.array(inputs), par), expected)


def test_kernels_need_no_thousand_names(name: str) -> None:
    """What a step needs beside its arguments: a frame that fits the rest of a piece of CPython's stack."""
    step = kernel(name).scalar["step"]
    temporaries = [v for v in step.__code__.co_varnames if v[0] == "t" and v[1:].isdigit()]
    assert len(temporaries) <= 200


@pytest.mark.parametrize("sequences", [FEW[0], pytest.param(MANY[0], marks=pytest.mark.slow)])
def test_single_precision_c_stays_finite(name: str, sequences: int, tmp_path: Path) -> None:
    c = CKernel(kernel(name), tmp_path, single=True)
    for seed in range(sequences):
        rng = random.Random(200 + seed)
        par = parameters(name, rng)
        inputs = list(input_sequence(name, rng, 201, degenerate=False))
        c.call("initial", inputs[0], par)
        for given in inputs[1:]:
            c.call("step", given, par)
            assert np.all(np.isfinite(c.state)) and np.all(np.isfinite(c.outputs)), (given, c.state, c.outputs)
            if is_estimator(name):
                assert np.all(c.state[covariance_diagonal(name)] >= 0.0), c.state


@pytest.mark.parametrize("small", SMALL)
def test_generated_code_names_its_source(small: str) -> None:
    k = kernel(small)
    for text in (k.python(), k.c()):
        assert k.module.__name__ in text.splitlines()[0]


@pytest.mark.parametrize(
    ("name", "seeds"),
    [
        pytest.param(name, seeds, marks=[pytest.mark.slow] if name in LONG or len(seeds) > 1 else [])
        for name in MODULES
        for seeds in (range(1), range(1, 12))
    ],
    ids=lambda value: value if isinstance(value, str) else "more" if len(value) > 1 else "one",
)
def test_any_choice_of_outputs_has_the_bits_of_all(name: str, seeds: range) -> None:
    k = kernel(name)
    for seed in seeds:
        rng = random.Random(f"{name} {seed}")
        every = names(k.module.Outputs)
        chosen = set(rng.sample(every, rng.randrange(1, len(every))))
        space = pruned_code(*prune_graphs(*k.graphs, chosen, Python))
        par = parameters(name, rng)
        inputs = [*input_sequence(name, rng, 20, degenerate=False)]
        state, outputs = k.scalar["initial"](flat(inputs[0]), flat(par))
        few, found = space["initial"](inputs[0], par)
        for given in inputs[1:]:
            assert found == tuple(value for n, value in zip(every, outputs) if n in chosen)
            state, outputs = k.scalar["step"](state, flat(given), flat(par))
            few, found = space["step"](few, given, par)


def pruned_code(initial: Graph, step: Graph, kept: dict[str, list[str]]) -> dict[str, Any]:
    """The functions as Python on records that hold more than they need."""
    space = namespace(Python.module(Python(initial).source(), Python(step).source()), "needed")

    def few(record: Any, name: str) -> tuple[Any, ...]:
        values = dict(zip(names(type(record)), flat(record)))
        return tuple(values[entry] for entry in kept[name])

    return {
        "initial": lambda inputs, par: space["initial"](few(inputs, "inputs"), few(par, "par")),
        "step": lambda state, inputs, par: space["step"](state, few(inputs, "inputs"), few(par, "par")),
    }


@pytest.mark.parametrize("samples", [1000, pytest.param(3000, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", [name for name, (component, _) in components().items() if component.kernel == name])
def test_states_of_random_runs_are_such_states(name: str, samples: int) -> None:
    """What a run makes is never refused."""
    (component, folder), k = components()[name], kernel(name)
    par, rng = kernel_parameters(own(folder.name), {}), random.Random(folder.name)
    if not k.wholes:
        assert not indexing(k.graphs[1])
        return
    every_input = names(k.module.Inputs)
    fields_of = [entry for entry in every_input if entry != "time"]
    clock = ["time"] if "time" in every_input else []
    ports = {port.field: port for port in component.of("input")}
    given = dict.fromkeys(fields_of, 0.0)
    period = dict(zip(names(k.module.Parameters), flat(par)))["sample_time"]
    state, _ = k.initial(k.module.Inputs(**given, **dict.fromkeys(clock, 0.0)), par)
    for n in range(1, samples):
        for field in fields_of:
            if rng.random() < 0.02:
                port = ports[field]
                low = -port.nominal if port.min is None else port.min
                high = port.nominal if port.max is None else port.max
                given[field] = float(rng.randint(0, 3)) if "mode" in field else rng.choice((low, high, 0.0))
        state, _ = k.step(state, k.module.Inputs(**given, **dict.fromkeys(clock, n * period)), par)
        assert fit(flat(state), k), n


def fit(entries: list[Any], k: Kernel) -> bool:
    for entry, first, every, least, most in k.wholes:
        found = entries[entry] if isinstance(entries[entry], list) else [entries[entry]]
        if not all(least <= x <= most and x % 1.0 == 0.0 for x in found[first::every]):
            return False
    return True
