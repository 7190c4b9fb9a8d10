"""Sensor: voltage and current as a data-acquisition system sees them, and the mode from a contact.

Each sample of voltage and current gets gain and offset error, noise, saturation and quantisation, in this order. Errors
and noise arise in the analogue part. The converter then clips and codes, so that every output is a code of the
converter. (If the range is no multiple of the resolution, the outermost code lies up to half a step outside it.) A lost
sample leaves all outputs as they were.

A contact that bounces opens again after the sample with which it closes, for `contact_bounce` samples. It then closes
for one sample, opens for one sample less than before, and so on until it stays closed.

Every sample draws the same random numbers: voltage noise, current noise, loss. If you switch one of them on or off, or
change its size, the others stay the same bit for bit.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from gapsense.kernels.interface import choice, fixed, input_, output, parameter, ports, sample_time, seed
from gapsense.kernels.layout import Array, Choice, Scalar, Vector
from gapsense.kernels.random import normal, seed_state, uniform
from gapsense.kernels.trace import clip, floor, not_, where, where_each

LOWER, MOVING, UPPER = 1.0, 2.0, 3.0  # modes: lower stop (minimum gap), between the stops, upper stop


class ContactSource(Choice):
    """Where the measured mode comes from: the input, or thresholds of the position."""

    mode, position = range(2)


@ports()
class Parameters(NamedTuple):
    """Errors of the two channels and the source of the mode."""

    sample_time: Scalar = sample_time(50e-6)
    seed: Scalar = seed()
    gain_error_voltage: Scalar = parameter("1", "Relative: 0.01 reads 1 % too much", 0.0, name="gain_error.voltage")
    gain_error_current: Scalar = parameter("1", "Relative: 0.01 reads 1 % too much", 0.0, name="gain_error.current")
    offset_voltage: Scalar = parameter("V", "Reading at 0 V", 0.0)  # reading at 0 V
    offset_current: Scalar = parameter("A", "Reading at 0 A", 0.0)  # reading at 0 A
    noise_voltage: Scalar = parameter("V", "Standard deviation of the voltage noise", 15e-3, min=0.0)
    noise_current: Scalar = parameter("A", "Standard deviation of the current noise", 1e-3, min=0.0)
    resolution_voltage: Scalar = parameter("V", "Step of the converter; 0: none", 0.0, min=0.0)
    resolution_current: Scalar = parameter("A", "Step of the converter; 0: none", 0.0, min=0.0)
    range_voltage: Scalar = parameter("V", "Readings saturate at plus and minus this; 0: never", 0.0, min=0.0)
    range_current: Scalar = parameter("A", "Readings saturate at plus and minus this; 0: never", 0.0, min=0.0)
    dropout_probability: Scalar = parameter("1", "Probability that a sample is lost", 0.0, min=0.0, max=1.0)
    contact_source: Annotated[Scalar, ContactSource] = choice("Where the measured mode comes from")
    contact_lower: Scalar = fixed("m", "Lower stop below this position", 50e-6)
    contact_upper: Scalar = fixed("m", "Upper stop above this position", 0.85e-3)
    contact_hysteresis: Scalar = fixed("m", "Way back past a threshold before the contact opens", 0.01e-3, min=0.0)
    contact_bounce: Scalar = fixed("1", "Samples for which a contact opens again after it has closed", 0.0, min=0.0)


class Reading(NamedTuple):
    """What a sample reads."""

    voltage: Scalar  # [V]
    current: Scalar  # [A]
    mode: Scalar


class Contact(NamedTuple):
    """The contact, and how it bounces."""

    closed: Scalar  # mode that it has, or would have if it did not bounce
    opening: Scalar  # samples of the present opening, or of the next one
    open_left: Scalar  # how many of them are to come


class State(NamedTuple):
    """The generator, the contact and the last reading."""

    generator: Annotated[Array, Vector(6)]
    contact: Contact
    reading: Reading


@ports()
class Inputs(NamedTuple):
    """True values at the sample."""

    voltage: Scalar = input_("V", "True coil voltage", source="drive.voltage", nominal=30.0)
    current: Scalar = input_("A", "True coil current", source="plant.current", nominal=0.4)
    position: Scalar = input_("m", "True position", source="plant.position", nominal=1e-3)
    mode: Scalar = input_(
        "1",
        "True mode: 1 lower stop, 2 moving, 3 upper stop; 0, not known, counts as moving; others are refused",
        source="plant.mode",
        start=2.0,
        min=0.0,
        max=3.0,
    )


@ports()
class Outputs(NamedTuple):
    """Reading, held until the next sample."""

    voltage_measured: Scalar = output("V", "Measured voltage", nominal=30.0, feedthrough=("voltage",))
    current_measured: Scalar = output("A", "Measured current", nominal=0.4, feedthrough=("current",))
    mode_measured: Scalar = output("1", "Measured mode", min=1.0, max=3.0, feedthrough=("position", "mode"))
    dropout: Scalar = output("1", "1: this sample was lost, and the outputs hold the one before", min=0.0, max=1.0)


def initial(inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """First sample at once; it is never lost, since there is no earlier reading to hold."""
    start = State(seed_state(par.seed), Contact(MOVING, 0.0, 0.0), Reading(0.0, 0.0, MOVING))
    state = _take_sample(start, inputs, par._replace(contact_bounce=0.0))
    return state, _outputs(state.reading, 0.0)


def step(state: State, inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """One sample."""
    new = _take_sample(state, inputs, par)
    generator, u = uniform(new.generator)
    is_lost = u < par.dropout_probability
    contact = where_each(is_lost, state.contact, new.contact)
    reading = where_each(is_lost, state.reading, new.reading)
    return State(generator, contact, reading), _outputs(reading, where(is_lost, 1.0, 0.0))


def _outputs(reading: Reading, dropout: Scalar) -> Outputs:
    return Outputs(reading.voltage, reading.current, reading.mode, dropout)


def _take_sample(state: State, inputs: Inputs, par: Parameters) -> State:
    """Take a new reading into the state."""
    generator, z_voltage = normal(state.generator)
    generator, z_current = normal(generator)
    voltage = inputs.voltage * (1.0 + par.gain_error_voltage) + par.offset_voltage + par.noise_voltage * z_voltage
    current = inputs.current * (1.0 + par.gain_error_current) + par.offset_current + par.noise_current * z_current
    by_position = _mode(inputs.position, state.contact.closed, par)
    is_by_position = par.contact_source == ContactSource.position
    told = where(inputs.mode < LOWER / 2.0, MOVING, inputs.mode)  # 0: a host that knows none yet
    contact, mode = _bounce_contact(state.contact, where(is_by_position, by_position, told), par.contact_bounce)
    reading = Reading(
        voltage=_quantise(voltage, par.range_voltage, par.resolution_voltage),
        current=_quantise(current, par.range_current, par.resolution_current),
        mode=mode,
    )
    return State(generator, contact, reading)


def _bounce_contact(before: Contact, mode: Scalar, longest: Scalar) -> tuple[Contact, Scalar]:
    """Let the contact bounce, and tell the mode it shows. Each opening is one sample shorter than the one before."""
    is_closed = (mode == LOWER) | (mode == UPPER)
    closes, is_open = is_closed & (before.closed == MOVING), before.open_left > 0.0
    following = where(before.opening > 0.0, before.opening - 1.0, 0.0)
    opening = where(closes, longest, where(is_open, before.opening, following))
    left = where(closes, longest, where(is_open, before.open_left - 1.0, following))
    shown = where(is_open & is_closed & not_(closes), MOVING, mode)
    return Contact(mode, where(is_closed, opening, 0.0), where(is_closed, left, 0.0)), shown


def _quantise(x: Scalar, limit: Scalar, q: Scalar) -> Scalar:
    """Saturate at +-`limit`, then round mid-tread to a multiple of `q`: zero is a code, ties go up."""
    x = where(limit > 0.0, clip(x, -limit, limit), x)
    has_steps = q > 0.0
    q = where(has_steps, q, 1.0)
    return where(has_steps, floor(x / q + 0.5) * q, x)


def _mode(position: Scalar, mode: Scalar, par: Parameters) -> Scalar:
    """Mode by thresholds: a contact closes past its threshold and opens `contact_hysteresis` beyond; the lower wins."""
    lower = par.contact_lower + where(mode == LOWER, par.contact_hysteresis, 0.0)
    upper = par.contact_upper - where(mode == UPPER, par.contact_hysteresis, 0.0)
    # an open contact closes only past its threshold, a closed one stays closed on its opening point
    is_lower = (position < lower) | ((mode == LOWER) & (position <= lower))
    is_upper = (position > upper) | ((mode == UPPER) & (position >= upper))
    return where(is_lower, LOWER, where(is_upper, UPPER, MOVING))
