"""Integral estimator: flux linkage by integration, resistance recalculated at the start of each operation.

Algorithm 2 of [SEMERA], with the reset before the first energised sample is added: in the printed order that sample
would fall into the old operation.  With `offline` the resistance of an operation is known when it has ended. Its
samples are then published during the next operation, each with its own time: at most `LENGTH` of them, and no more than
the next operation has.  For a lost reading the last good one stands in.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from gapsense.estimators import readings
from gapsense.kernels.interface import option, output, parameter, ports, sample_time
from gapsense.kernels.layout import Array, Count, Memory, Scalar, Whole, blank
from gapsense.kernels.trace import fabs, load, not_, sqrt, store, where, where_each

EDGE = 0.25  # of the highest voltage of late: more begins an operation
AGAIN = 0.5  # of that level: the next one begins only after less
CLEAR = 10.0  # noises of a voltage that drives something
LENGTH = 4096  # samples of one operation that can be replayed; later ones are not
SPARE = 2 * LENGTH  # element that takes the writes after that


@ports()
class Parameters(NamedTuple):
    """Tuning, Tables II and V."""

    sample_time: Scalar = sample_time(50e-6)  # Delta
    prior_resistance: Scalar = parameter("Ohm", "Resistance until the first operation has ended", 77.5, min=1e-9)  # r_0
    prior_inductance: Scalar = parameter("H", "Inductance at rest", 50e-3, min=0.0)  # l_0
    prior_flux_linkage: Scalar = parameter("Wb", "Flux linkage at the start of every operation", 0.0)  # lambda_0
    noise_current: Scalar = parameter("A", "Standard deviation of the current noise", 1e-3, min=0.0)  # sigma_i
    gate_sigmas: Scalar = parameter(
        "1", "Half width of the noise band, in standard deviations (3.29: 99.9 %)", 3.29, min=0.0
    )  # n_sigma
    noise_voltage: Scalar = parameter("V", "Standard deviation of the voltage noise", 15e-3, min=0.0)  # sigma_v
    edge_voltage: Scalar = parameter(
        "V", "An operation starts when the voltage rises above it; 0: a quarter of the highest of late", 0.0, min=0.0
    )
    offline: Scalar = option("Publish an operation after it has ended, with the resistance that it gave", False)
    range_voltage: Scalar = readings.RANGE_VOLTAGE
    range_current: Scalar = readings.RANGE_CURRENT


class State(NamedTuple):
    """Sums of the current operation, and the samples of this operation and the previous one."""

    resistance: Scalar  # mean resistance in use [ohm]
    voltage_sum: Scalar  # S_u [V]
    current_sum: Scalar  # S_iota [A]
    count: Annotated[Scalar, Count]  # samples in the running operation
    current: Scalar  # previous current measurement that was not lost [A]
    voltage: Scalar  # previous voltage measurement that was not lost [V]
    highest: Scalar  # highest of late: of the last LENGTH or so that drove something [V]
    is_on: Scalar  # 1 from the sample that begins an operation until a voltage of much less
    is_lost: Scalar  # 1 if a reading of the previous sample was lost
    losses: Scalar  # samples with lost readings in the running operation
    kept: Scalar  # how many operations in a row had some, and left the resistance as it was
    start: Scalar  # time of the sample before the running operation [s]
    half: Annotated[Scalar, Whole(0, 1)]  # half of the memory that is written: 0 or 1
    last_count: Annotated[Scalar, Whole(0, LENGTH)]  # samples of the operation being replayed
    last_start: Scalar  # time of the sample before it [s]
    before: Scalar  # current of the sample before the running operation [A]
    last_before: Scalar  # current of the sample before the one being replayed [A]
    voltage_sums: Annotated[Array, Memory(2 * LENGTH + 1)]
    current_sums: Annotated[Array, Memory(2 * LENGTH + 1)]
    currents: Annotated[Array, Memory(2 * LENGTH + 1)]


@ports()
class Inputs(NamedTuple):
    """Measurements; `time` is that of the sample, and a lost one is not a number."""

    time: Scalar
    voltage: Scalar = readings.VOLTAGE
    current: Scalar = readings.CURRENT


@ports(feedthrough=("voltage", "current"))
class Outputs(NamedTuple):
    """Estimates at `published_time`."""

    resistance: Scalar = output("Ohm", "Mean resistance of the last operation", nominal=76.0)
    inductance: Scalar = output("H", "Estimated apparent inductance", nominal=0.1)
    flux_linkage: Scalar = output("Wb", "Estimated flux linkage", nominal=0.02)
    quality: Scalar = output("1", "1: current outside the noise band; 0: inductance at rest", min=0.0, max=1.0)
    published: Scalar = output(
        "1", "1: the estimates belong to published_time; 0: no operation to replay", min=0.0, max=1.0
    )
    published_time: Scalar = output("s", "Time of the sample that the estimates belong to", nominal=0.01)
    health: Scalar = readings.HEALTH
    health_causes: Scalar = readings.HEALTH


class Sample(NamedTuple):
    """One sample, as far as its estimates need it."""

    voltage_sum: Scalar
    current_sum: Scalar
    current: Scalar
    previous: Scalar  # current of the sample before
    time: Scalar
    published: Scalar


def initial(inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """Sums zero, iota_0 registered."""
    u, i, found = _readings(0.0, 0.0, inputs, par)
    state = blank(
        State,
        resistance=par.prior_resistance,
        current=i,
        voltage=u,
        highest=u,
        is_on=where(u > _level(u, par), 1.0, 0.0),
        is_lost=1.0 - found.health,
        start=inputs.time,
        last_start=inputs.time,
        before=i,
        last_before=i,
    )
    return state, Outputs(
        resistance=par.prior_resistance,
        inductance=par.prior_inductance,
        flux_linkage=par.prior_flux_linkage,
        quality=0.0,
        published=1.0 - par.offline,
        published_time=inputs.time,
        **readings.worse(found, readings.UNLEARNT, 1.0)._asdict(),
    )


def step(state: State, inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """One sample, lines 4 to 12."""
    previous = state.current
    u, i, found = _readings(state.voltage, state.current, inputs, par)
    state = _add_sample(_open_operation(state, inputs.time, u, par), u, i, 1.0 - found.health)
    now = Sample(
        voltage_sum=state.voltage_sum,
        current_sum=state.current_sum,
        current=i,
        previous=previous,
        time=inputs.time,
        published=1.0,
    )
    online = _estimates(now, state.resistance, par)
    offline = _estimates(_replay_sample(state, par), state.resistance, par)
    is_offline = par.offline > 0.0
    outputs = where_each(is_offline, offline, online)
    is_unlearnt = state.resistance == par.prior_resistance
    return state, outputs._replace(**readings.worse(found, readings.UNLEARNT, where(is_unlearnt, 1.0, 0.0))._asdict())


def _readings(u: Scalar, i: Scalar, inputs: Inputs, par: Parameters) -> tuple[Scalar, Scalar, readings.Health]:
    """Voltage and current, with the last good ones for lost ones, and the resulting health."""
    limit = readings.most_current(par.range_current, par.range_voltage, par.prior_resistance)
    has_voltage = readings.can_be_read(inputs.voltage, par.range_voltage)
    has_current = readings.can_be_read(inputs.current, limit)
    found = readings.health({readings.LOST: not_(has_voltage & has_current)})
    return where(has_voltage, inputs.voltage, u), where(has_current, inputs.current, i), found


def _open_operation(state: State, time: Scalar, u: Scalar, par: Parameters) -> State:
    """Begin a new operation at a rising edge of the voltage, with the resistance of the one that has ended.

    An operation with lost readings leaves the resistance as it is, but the third in a row does not: it would go on
    being out of date.  A reading lost just before the edge counts for both, because the edge may have been there.
    """
    faded = where(u > CLEAR * par.noise_voltage, (1.0 - 1.0 / LENGTH) * state.highest, state.highest)
    highest = where(u > faded, u, faded)
    level = _level(highest, par)
    is_edge = (u > level) & (state.is_on == 0.0)
    is_kept = (state.losses > 0.0) & (state.kept < 2.0)
    r = where(is_kept, state.resistance, _mean_resistance(state, par))  # line 11, (47)
    return state._replace(
        highest=highest,
        is_on=where(is_edge, 1.0, where(u > AGAIN * level, state.is_on, 0.0)),
        resistance=where(is_edge, r, state.resistance),
        losses=where(is_edge, state.is_lost, state.losses),
        kept=where(is_edge, where(is_kept, state.kept + 1.0, 0.0), state.kept),
        voltage_sum=where(is_edge, 0.0, state.voltage_sum),
        current_sum=where(is_edge, 0.0, state.current_sum),
        count=where(is_edge, 0.0, state.count),
        start=where(is_edge, time - par.sample_time, state.start),
        half=where(is_edge, 1.0 - state.half, state.half),
        last_count=where(is_edge, where(state.count < LENGTH, state.count, LENGTH), state.last_count),
        last_start=where(is_edge, state.start, state.last_start),
        before=where(is_edge, state.current, state.before),
        last_before=where(is_edge, state.before, state.last_before),
    )


def _level(highest: Scalar, par: Parameters) -> Scalar:
    """Voltage that begins an operation: a part of the highest of late, and clear of the noise."""
    part, least = EDGE * highest, CLEAR * par.noise_voltage
    return where(par.edge_voltage > 0.0, par.edge_voltage, where(part > least, part, least))


def _add_sample(state: State, u: Scalar, i: Scalar, is_lost: Scalar) -> State:
    """Add the sample to the sums (line 5), and keep it."""
    su, si, count = state.voltage_sum + u, state.current_sum + i, state.count + 1.0
    slot = where(count <= LENGTH, state.half * LENGTH + count - 1.0, SPARE)
    return state._replace(
        voltage_sum=su,
        current_sum=si,
        count=count,
        current=i,
        voltage=u,
        is_lost=is_lost,
        losses=state.losses + is_lost,
        voltage_sums=store(state.voltage_sums, slot, su),
        current_sums=store(state.current_sums, slot, si),
        currents=store(state.currents, slot, i),
    )


def _replay_sample(state: State, par: Parameters) -> Sample:
    """Sample of the previous operation that corresponds to this one."""
    count = state.count
    is_replayed = count <= state.last_count
    k = where(is_replayed, (1.0 - state.half) * LENGTH + count - 1.0, SPARE)
    k_prev = where(is_replayed & (count > 1.0), k - 1.0, SPARE)
    return Sample(
        voltage_sum=where(is_replayed, load(state.voltage_sums, k), 0.0),
        current_sum=where(is_replayed, load(state.current_sums, k), 0.0),
        current=load(state.currents, k),
        previous=where(count > 1.0, load(state.currents, k_prev), state.last_before),
        time=state.last_start + where(is_replayed, count, state.last_count) * par.sample_time,
        published=where(is_replayed, 1.0, 0.0),
    )


def _mean_resistance(state: State, par: Parameters) -> Scalar:
    """Ratio (47) of the ended operation; the previous value if voltage or current is only noise: a ratio of nothing."""
    band, su, si = par.gate_sigmas * sqrt(state.count), fabs(state.voltage_sum), fabs(state.current_sum)
    is_known = (si > band * par.noise_current) & (su > band * par.noise_voltage)
    return where(is_known, state.voltage_sum / where(is_known, state.current_sum, 1.0), state.resistance)


def _estimates(at: Sample, r: Scalar, par: Parameters) -> Outputs:
    """Lines 6 to 9 and 12."""
    flux_linkage = par.prior_flux_linkage + par.sample_time * (at.voltage_sum - r * at.current_sum)  # (46)
    band = par.gate_sigmas * par.noise_current
    is_high = (fabs(at.current) > band) & (fabs(at.previous) > band) & (at.published > 0.0)  # line 7
    l = where(is_high, flux_linkage / where(is_high, at.current, 1.0), par.prior_inductance)  # (48)
    return Outputs(
        resistance=r,
        inductance=l,
        flux_linkage=flux_linkage,
        quality=where(is_high, 1.0, 0.0),
        published=at.published,
        published_time=at.time,
        health=1.0,
        health_causes=0.0,
    )
