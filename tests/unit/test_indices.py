"""Indices of array memory: which numbers of a state they are made of, and that these are known and kept."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Annotated, NamedTuple

import pytest

from gapsense.kernels.emit import indexing
from gapsense.kernels.kernel import Kernel
from gapsense.kernels.layout import Array, Memory, Scalar, Whole, zeros
from gapsense.kernels.trace import TraceError, load, loop, store, where

SIZE = 8


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
