"""Indices of array memory: which numbers of a state they are made of, and that these are known and kept."""

from __future__ import annotations

import random
from types import SimpleNamespace
from typing import Annotated, NamedTuple

import pytest

from gapsense.fmi.components import find_components, kernel_of, kernel_parameters, load_component, own
from gapsense.kernels.emit import indexing
from gapsense.kernels.kernel import Kernel
from gapsense.kernels.layout import Array, Memory, Scalar, Whole, flat, names, zeros
from gapsense.kernels.trace import TraceError, load, loop, store, where
from gapsense.shipped import ROOT

SIZE = 8
KERNELS = {folder.name: folder for folder in find_components(ROOT / "fmus")}


class Inputs(NamedTuple):
    value: Scalar


class Parameters(NamedTuple):
    gain: Scalar


class Outputs(NamedTuple):
    sum: Scalar


class State(NamedTuple):
    place: Scalar
    level: Scalar
    values: Annotated[Array, Memory(SIZE)]


class Kept(NamedTuple):
    place: Annotated[Scalar, Whole(0, SIZE - 1)]
    level: Scalar
    values: Annotated[Array, Memory(SIZE, (None, (0, 3)))]


def module(state):
    def initial(inputs, par):
        return state(0.0, inputs.value, zeros(SIZE)), Outputs(0.0)

    def step(state, inputs, par):
        place = where(state.level > inputs.value, state.place, state.place + 1.0)
        place = where(place < SIZE, place, 0.0)
        far, _ = loop(3, lambda far, n: ((far + 1.0, n - 1.0), n < 0.0), (place, 2.0))
        values = store(state.values, place, inputs.value)
        total = load(values, load(values, far))
        return state._replace(place=place, level=inputs.value, values=values), Outputs(par.gain * total)

    records = {"Inputs": Inputs, "Parameters": Parameters, "State": state, "Outputs": Outputs}
    return SimpleNamespace(__name__="small", initial=initial, step=step, **records)


def test_numbers_that_indices_are_made_of_are_found():
    """Through branches, loops and memory; not what only conditions ask for."""
    assert indexing(Kernel(module(State)).graphs[1]) == {"place", "values"}


def test_a_state_that_does_not_say_what_indices_may_be_is_refused():
    with pytest.raises(TraceError, match=r"indices are made of `place` of the state\. Say what it may be"):
        _ = Kernel(module(State)).wholes
    assert Kernel(module(Kept)).wholes == [(0, 0, 1, 0, SIZE - 1), (2, 1, 2, 0, 3)]


def test_code_in_c_reaches_memory_through_a_check():
    text = Kernel(module(Kept)).c()
    assert f"state_values[within({'' if 'within(whole' not in text else 'whole'}" in text
    assert text.count("within(") == 4  # its definition, one store, two loads


@pytest.mark.parametrize("samples", [1000, pytest.param(3000, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", KERNELS)
def test_states_of_random_runs_are_such_states(name, samples):
    """What a run makes is never refused."""
    component = load_component(KERNELS[name])
    kernel, par, rng = kernel_of(component), kernel_parameters(own(name), {}), random.Random(name)
    if not kernel.wholes:
        assert not indexing(kernel.graphs[1])
        return
    every_input = names(kernel.module.Inputs)
    fields_of = [name for name in every_input if name != "time"]
    clock = ["time"] if "time" in every_input else []
    ports = {port.field: port for port in component.of("input")}
    given = dict.fromkeys(fields_of, 0.0)
    period = dict(zip(names(kernel.module.Parameters), flat(par)))["sample_time"]
    state, _ = kernel.initial(kernel.module.Inputs(**given, **dict.fromkeys(clock, 0.0)), par)
    for k in range(1, samples):
        for field in fields_of:
            if rng.random() < 0.02:
                port = ports[field]
                low = -port.nominal if port.min is None else port.min
                high = port.nominal if port.max is None else port.max
                given[field] = float(rng.randint(0, 3)) if "mode" in field else rng.choice((low, high, 0.0))
        state, _ = kernel.step(state, kernel.module.Inputs(**given, **dict.fromkeys(clock, k * period)), par)
        assert fit(flat(state), kernel), k


def fit(entries, kernel):
    for entry, first, every, least, most in kernel.wholes:
        found = entries[entry] if isinstance(entries[entry], list) else [entries[entry]]
        if not all(least <= x <= most and x % 1.0 == 0.0 for x in found[first::every]):
            return False
    return True
