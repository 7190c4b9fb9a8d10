"""Integral estimator: flux linkage by integration, resistance recalculated at the start of each operation.

Algorithm 2 of [SEMERA], with the reset before the first energised sample is added: in the printed order that sample
would fall into the old operation.  With `offline` the resistance of an operation is known when it has ended; its
samples are then published while the next operation goes on, each with its own time: at most `LENGTH` of them, and not
more than the next operation has.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from gapsense.records import Array, Memory, Scalar, zeros
from gapsense.trace import fabs, load, sqrt, store, where

LENGTH = 4096  # samples of one operation that can be replayed; what comes after them is not
SPARE = 2 * LENGTH  # element that takes the writes after that


class Parameters(NamedTuple):
    """Tuning, Tables II and V."""

    sample_time: Scalar  # Delta [s]
    prior_resistance: Scalar  # r_0 [ohm]
    prior_inductance: Scalar  # l_0, the resting device [H]
    prior_flux_linkage: Scalar  # lambda_0 [Wb]
    noise_current: Scalar  # sigma_i [A]
    gate_sigmas: Scalar  # n_sigma [1]
    edge_voltage: Scalar  # an operation starts when the voltage rises above it [V]
    offline: Scalar  # 1: publish an operation when it has ended


class State(NamedTuple):
    """Sums of the running operation, and the samples of this one and of the one before."""

    resistance: Scalar  # mean resistance in use [ohm]
    voltage_sum: Scalar  # S_u [V]
    current_sum: Scalar  # S_iota [A]
    count: Scalar  # samples in the running operation
    current: Scalar  # previous current measurement [A]
    voltage: Scalar  # previous voltage measurement [V]
    start: Scalar  # time of the sample before the running operation [s]
    half: Scalar  # half of the memory that is written: 0 or 1
    last_count: Scalar  # samples of the operation being replayed
    last_start: Scalar  # time of the sample before it [s]
    before: Scalar  # current of the sample before the running operation [A]
    last_before: Scalar  # current of the sample before the one being replayed [A]
    voltage_sums: Annotated[Array, Memory(2 * LENGTH + 1)]
    current_sums: Annotated[Array, Memory(2 * LENGTH + 1)]
    currents: Annotated[Array, Memory(2 * LENGTH + 1)]


class Inputs(NamedTuple):
    """Measurements; `time` is that of the sample."""

    time: Scalar
    voltage: Scalar
    current: Scalar


class Outputs(NamedTuple):
    """Estimates at `published_time`."""

    resistance: Scalar
    inductance: Scalar
    flux_linkage: Scalar
    quality: Scalar
    published: Scalar  # 1 if the values belong to a sample, 0 while there is none to replay
    published_time: Scalar


def initial(inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """Sums zero, iota_0 registered."""
    r, l, flux_linkage, i = par.prior_resistance, par.prior_inductance, par.prior_flux_linkage, inputs.current
    memory = (zeros(2 * LENGTH + 1), zeros(2 * LENGTH + 1), zeros(2 * LENGTH + 1))
    state = State(r, 0.0, 0.0, 0.0, i, inputs.voltage, inputs.time, 0.0, 0.0, inputs.time, i, i, *memory)
    return state, Outputs(r, l, flux_linkage, 0.0, 1.0 - par.offline, inputs.time)


def step(state: State, inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """One sample, lines 4 to 12."""
    u, i, dt = inputs.voltage, inputs.current, par.sample_time
    is_edge = (u > par.edge_voltage) & (state.voltage <= par.edge_voltage)
    r = where(is_edge, _mean_resistance(state, par), state.resistance)  # line 11, (47)
    su = where(is_edge, 0.0, state.voltage_sum) + u
    si = where(is_edge, 0.0, state.current_sum) + i  # line 5
    count = where(is_edge, 0.0, state.count) + 1.0
    start = where(is_edge, inputs.time - dt, state.start)
    half = where(is_edge, 1.0 - state.half, state.half)

    slot = where(count <= LENGTH, half * LENGTH + count - 1.0, SPARE)
    voltage_sums = store(state.voltage_sums, slot, su)
    current_sums = store(state.current_sums, slot, si)
    currents = store(state.currents, slot, i)
    last_count = where(is_edge, where(state.count < LENGTH, state.count, LENGTH), state.last_count)
    last_start = where(is_edge, state.start, state.last_start)
    before = where(is_edge, state.current, state.before)
    last_before = where(is_edge, state.before, state.last_before)

    online = _estimates(su, si, i, state.current, r, 1.0, inputs.time, par)
    is_replayed = count <= last_count
    k = where(is_replayed, (1.0 - half) * LENGTH + count - 1.0, SPARE)
    k_prev = where(is_replayed & (count > 1.0), k - 1.0, SPARE)
    then = last_start + where(is_replayed, count, last_count) * dt
    offline = _estimates(
        where(is_replayed, load(voltage_sums, k), 0.0),
        where(is_replayed, load(current_sums, k), 0.0),
        load(currents, k),
        where(count > 1.0, load(currents, k_prev), last_before),
        r,
        where(is_replayed, 1.0, 0.0),
        then,
        par,
    )

    is_offline = par.offline > 0.0
    outputs = Outputs(*(where(is_offline, b, a) for a, b in zip(online, offline)))
    scalars = (r, su, si, count, i, u, start, half, last_count, last_start, before, last_before)
    return State(*scalars, voltage_sums, current_sums, currents), outputs


def _mean_resistance(state: State, par: Parameters) -> Scalar:
    """Ratio (47) of the ended operation; the value before where the current is but noise: the ratio is 0/0 then."""
    band = par.gate_sigmas * par.noise_current * sqrt(state.count)
    is_known = fabs(state.current_sum) > band
    return where(is_known, state.voltage_sum / where(is_known, state.current_sum, 1.0), state.resistance)


def _estimates(
    su: Scalar, si: Scalar, i: Scalar, i_prev: Scalar, r: Scalar, published: Scalar, time: Scalar, par: Parameters
) -> Outputs:
    """Lines 6 to 9 and 12."""
    flux_linkage = par.prior_flux_linkage + par.sample_time * (su - r * si)  # (46)
    band = par.gate_sigmas * par.noise_current
    is_high = (fabs(i) > band) & (fabs(i_prev) > band) & (published > 0.0)  # line 7
    l = where(is_high, flux_linkage / where(is_high, i, 1.0), par.prior_inductance)  # (48)
    return Outputs(r, l, flux_linkage, where(is_high, 1.0, 0.0), published, time)
