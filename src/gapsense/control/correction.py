"""Error of the loop's flux linkage over an operation, learnt from what an estimator says afterwards."""

from __future__ import annotations

from gapsense.control import laws
from gapsense.control.records import LONGEST, Inputs, Parameters, State
from gapsense.kernels.layout import Array, Scalar
from gapsense.kernels.linalg import total
from gapsense.kernels.trace import clip, floor, load, not_, store, where

GAIN = 0.3  # part of an error that is corrected at once
LARGEST = 0.3e-3  # what counts of it [Wb]
AROUND = 5  # samples before and behind, over which it is smooth


def at_sample(errors: Array, half: Scalar, sample: Scalar) -> Scalar:
    """The error at a sample, smooth [Wb]."""
    inside = LONGEST - 1.0
    places = [half * LONGEST + clip(sample + k, 0.0, inside) for k in range(-AROUND, AROUND + 1)]
    return total(load(errors, place) for place in places) / (2 * AROUND + 1)


def correct_flux(state: State, inputs: Inputs, par: Parameters) -> State:
    """Correct the flux linkage by the smoothed one of a sample that an estimator has published."""
    half, sample, is_known = _find_sample(state, inputs, par)
    place = half * LONGEST + sample
    wanted, error = load(state.profiles, place), load(state.errors, place)
    new = error + GAIN * clip(wanted - inputs.smoothed_flux_linkage, -LARGEST, LARGEST)
    return state._replace(errors=store(state.errors, place, where(is_known & (wanted > 0.0), new, error)))


def _find_sample(state: State, inputs: Inputs, par: Parameters) -> tuple[Scalar, Scalar, Scalar]:
    """Operation and sample that the smoothed values belong to, and whether it is still in memory."""
    age = floor((inputs.time - inputs.smoothed_time) / par.sample_time + 0.5)
    now = state.running
    other = 1.0 - now.command
    last, older = (laws.read(state.laws, half).length for half in (other, now.command))
    in_last, in_older = now.age + last - age, now.age + last + older - age
    is_now, is_last = age <= now.age, in_last >= 0.0
    half = where(is_now | not_(is_last), now.command, other)
    sample = where(is_now, now.age - age, where(is_last, in_last, in_older))
    is_known = (sample >= 0.0) & (sample < LONGEST) & (is_now | is_last | (in_older > now.age))
    return half, clip(sample, 0.0, LONGEST - 1.0), is_known
