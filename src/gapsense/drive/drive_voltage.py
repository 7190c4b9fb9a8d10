"""Drive voltage: square wave, step, table, PWM, pulse profile, soft landing, bridge; edges anywhere in a step.

`voltage` is the value at the end of the step; on an edge it is the value just before it. `voltage_mean` is the exact
mean over the step. An actuator driven by the mean gets the volt-seconds of an edge inside the step.

An edge counts as on a communication point if it is closer to it than 1e-9 of the step plus 1e-11 of the time. Hosts
that add up their steps know their time only to accumulated rounding. The step before ends on the edge and the step
after starts on it, so its volt-seconds are neither lost nor counted twice.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from gapsense.kernels.interface import COLUMN, choice, fixed, input_, output, parameter, ports, table
from gapsense.kernels.layout import Array, Choice, Scalar, Table
from gapsense.kernels.trace import clip, cond, fabs, floor, load, locate, not_, where, where_each


class Curve(NamedTuple):
    """Table of the voltage, and the part of it that repeats."""

    time: Array
    voltage: Array
    integral: Array
    period: Scalar
    repeat_from: Scalar


def interpolate_table(time: Scalar, dt: Scalar, tolerance: Scalar, curve: Curve) -> tuple[Scalar, Scalar]:
    """Interpolate a table: end value and mean; `n` and `m` periods before end and start lie in its repeated part."""
    period, tol = positive(curve.period), tolerance / positive(curve.period)
    start = time - dt
    n = _repeats(-floor(tol - (time - curve.repeat_from) / period) - 1.0, curve)  # the left limit at the end
    m = _repeats(floor((start - curve.repeat_from) / period + tol), curve)  # the right limit at the start
    end, start = time - n * period, start - m * period
    k = locate(curve.time, end - tolerance)  # the piece before a jump at the end
    t0, t1 = load(curve.time, k), load(curve.time, k, 1)
    u0, u1 = load(curve.voltage, k), load(curve.voltage, k, 1)
    is_before, is_after = end <= t0 + tolerance, start >= t1 - tolerance  # then `k` is the first or the last piece
    is_inside = (start >= t0 - tolerance) & (end <= t1 + tolerance)
    u_end = where(is_before, u0, _value(curve, k, end))
    u_start = where(is_after, u1, _value(curve, k, start))

    def over_pieces() -> Scalar:
        repeated = _integral(curve, curve.repeat_from + period, 0.0) - _integral(curve, curve.repeat_from, 0.0)
        here = _integral(curve, end, tolerance) - _integral(curve, start, tolerance)
        return (here + (n - m) * repeated) / positive(dt)

    mean = cond(
        (n == m) & (is_inside | is_before | is_after),
        lambda: (u_start + u_end) / 2.0,  # one piece: a constant voltage comes out exactly
        over_pieces,
    )
    return u_end, where(dt > 0.0, mean, u_end)


def _repeats(count: Scalar, curve: Curve) -> Scalar:
    return where((curve.period > 0.0) & (count > 0.0), count, 0.0)


def _value(curve: Curve, k: Scalar, t: Scalar) -> Scalar:
    """Voltage at time `t` from piece `k` of the table, its ends held."""
    t0, t1 = load(curve.time, k), load(curve.time, k, 1)
    u0, u1 = load(curve.voltage, k), load(curve.voltage, k, 1)
    w = (t - t0) / positive(t1 - t0)
    return where(t < t0, u0, where(t >= t1, u1, u0 + (u1 - u0) * w))


def _integral(curve: Curve, t: Scalar, tolerance: Scalar) -> Scalar:
    """Integral of the voltage from the first row to time `t`."""
    k = locate(curve.time, t - tolerance)
    t0, t1 = load(curve.time, k), load(curve.time, k, 1)
    inside = clip(t, t0, t1)
    u0, u = load(curve.voltage, k), _value(curve, k, t)
    return load(curve.integral, k) + (inside - t0) * (u0 + u) / 2.0 + (t - inside) * u


def positive(x: Scalar) -> Scalar:
    """`x`, or 1 in place of what cannot be divided by."""
    return where(x > 0.0, x, 1.0)


ALWAYS = -1e30  # phase at which a wave without a beginning begins


class Kind(Choice):
    """Full bridge: both directions; half bridge: one, and zero by the freewheeling path."""

    full, half = range(2)


class Bridge(NamedTuple):
    """What it is made of."""

    kind: Scalar
    supply: Scalar  # positive [V]
    frequency: Scalar  # of the carrier, 0 for an output that is steady during the step [Hz]
    levels: Scalar  # of the mean between zero and the supply, 0 for any


def wave(reference: Scalar, bridge: Bridge) -> Wave:
    """Pulses between zero and the supply, in the direction of the mean voltage that is wanted."""
    share = limit_to_bridge(reference, bridge)
    rail = where(share < 0.0, -bridge.supply, bridge.supply)
    has_carrier, duty = bridge.frequency > 0.0, fabs(share)
    steady = rail * duty
    period = 1.0 / positive(bridge.frequency)
    low, high = where(has_carrier, 0.0, steady), where(has_carrier, rail, steady)
    return Wave(low, high, Pulse(period, duty, delay=0.0, first=ALWAYS))


def limit_to_bridge(reference: Scalar, bridge: Bridge) -> Scalar:
    """Limit the mean voltage to what the bridge gives, as a share of its supply."""
    least = where(bridge.kind == Kind.half, 0.0, -1.0)
    share = clip(reference / bridge.supply, least, 1.0)
    levels = positive(bridge.levels)
    return where(bridge.levels > 0.0, floor(share * levels + 0.5) / levels, share)


class Waveform(Choice):
    """What is generated."""

    square, step, table, pwm, profile, soft_landing, bridge = range(7)


@ports()
class Parameters(NamedTuple):
    """The waveform and the numbers of each; only those of the chosen one matter."""

    waveform: Annotated[Scalar, Waveform] = choice("What is generated")
    square_amplitude: Scalar = parameter("V", "Height above square.low", 30.0)
    square_low: Scalar = parameter("V", "Low level, also before the delay", 0.0)
    square_period: Scalar = fixed("s", "Period", 20e-3, min=1e-9)
    square_duty: Scalar = parameter("1", "Share of the period that is high and comes first", 0.5, min=0.0, max=1.0)
    square_delay: Scalar = fixed("s", "Time of the first rising edge", 0.0)
    step_initial: Scalar = parameter("V", "Voltage before the step", 0.0)
    step_final: Scalar = parameter("V", "Voltage after the step", 30.0)
    step_time: Scalar = fixed("s", "Time of the step", 0.0)
    table_file_time: Annotated[Array, Table()] = table(
        "Table: CSV file with the columns time [s], voltage [V]; a repeated time is a jump, the ends are held",
        ("time [s]", "voltage [V]", "integral:voltage"),
        "voltage.csv",
    )
    table_file_voltage: Annotated[Array, Table()] = COLUMN
    table_file_integral: Annotated[Array, Table()] = COLUMN
    table_period: Scalar = fixed("s", "Period with which the table repeats; 0: it does not", 0.0, min=0.0)
    table_repeat_from: Scalar = fixed("s", "Start of the part that repeats; what is before comes once", 0.0)
    pwm_high: Scalar = parameter("V", "High level", 30.0)  # above `pwm_low`
    pwm_low: Scalar = parameter("V", "Low level", 0.0)
    pwm_frequency: Scalar = fixed("Hz", "Carrier frequency; the carrier starts at time 0", 20e3, min=1e-3)
    profile_amplitude: Scalar = parameter("V", "Height above profile.low", 30.0)
    profile_low: Scalar = parameter("V", "Low level, also before the delay", 0.0)
    profile_first: Scalar = parameter("s", "dt1: high first, in the second half low", 4.5e-3, min=0.0)
    profile_second: Scalar = parameter("s", "dt2: then low, in the second half high", 1.5e-3, min=0.0)
    profile_half_period: Scalar = fixed("s", "Half of the period: making, then breaking", 20e-3, min=1e-9)
    profile_delay: Scalar = fixed("s", "Time of the first rising edge", 0.0)
    soft_landing_file_time: Annotated[Array, Table()] = table(
        "Voltage of soft-landing cycles, a table like table.file; `gapsense soft-landing` makes others",
        ("time [s]", "voltage [V]", "integral:voltage"),
        "soft_landing.csv",
        name="soft_landing.file",
    )
    soft_landing_file_voltage: Annotated[Array, Table()] = COLUMN
    soft_landing_file_integral: Annotated[Array, Table()] = COLUMN
    soft_landing_period: Scalar = fixed("s", "Period of the cycles", 20e-3, min=0.0, name="soft_landing.period")
    soft_landing_repeat_from: Scalar = fixed(
        "s", "Start of the cycle that repeats, as table.repeat_from", 20e-3, name="soft_landing.repeat_from"
    )
    bridge_kind: Annotated[Scalar, Kind] = choice("Bridge: both directions, or one and zero")
    bridge_supply: Scalar = parameter("V", "Bridge: largest voltage", 30.0, min=1e-9)
    bridge_frequency: Scalar = fixed("Hz", "Bridge: carrier from time 0; 0: steady during the step", 20e3, min=0.0)
    bridge_levels: Scalar = fixed("1", "Bridge: steps of the mean between 0 and the supply; 0: any", 0.0, min=0.0)


class State(NamedTuple):
    """Nothing is carried on but the clock: the voltage is a function of time and inputs."""

    time: Scalar  # end of the last step [s]


@ports()
class Inputs(NamedTuple):
    """The step, from the shell, and the signals that hold during it."""

    time: Scalar  # end of the step [s]
    dt: Scalar  # its length, 0 at the start [s]
    enable: Scalar = input_("1", "0.5 or less: both outputs are 0 V", start=1.0)
    reference: Scalar = input_("V", "Mean voltage that PWM or bridge gives, held during the step", nominal=30.0)


@ports(feedthrough=Inputs._fields[2:])
class Outputs(NamedTuple):
    """Voltage at the end of the step and its mean over the step."""

    voltage: Scalar = output("V", "At the end of the step; on an edge, just before it", nominal=30.0)
    voltage_mean: Scalar = output("V", "Mean over the step, exact", nominal=30.0)


def initial(inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """Voltage at the start, where there is no step yet to take a mean over."""
    return step(State(inputs.time), inputs._replace(dt=0.0), par)


def step(state: State, inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """Outputs of one communication step."""
    tolerance = 1e-9 * inputs.dt + 1e-11 * fabs(inputs.time)
    voltage, mean = cond(
        (par.waveform == Waveform.table) | (par.waveform == Waveform.soft_landing),
        lambda: cond(
            par.waveform == Waveform.table,
            lambda: interpolate_table(inputs.time, inputs.dt, tolerance, _curve("table", par)),
            lambda: interpolate_table(inputs.time, inputs.dt, tolerance, _curve("soft_landing", par)),
        ),
        lambda: cond(
            par.waveform == Waveform.profile,
            lambda: _profile(inputs, tolerance, par),
            lambda: _one_pulse(inputs, tolerance, par),
        ),
    )
    is_on = inputs.enable > 0.5
    return State(inputs.time), Outputs(where(is_on, voltage, 0.0), where(is_on, mean, 0.0))


def _one_pulse(inputs: Inputs, tolerance: Scalar, par: Parameters) -> tuple[Scalar, Scalar]:
    """Square wave, step, PWM or bridge; a step is a pulse that stays high: its period only sets the scale of phases."""
    pulse = Pulse(par.square_period, par.square_duty, par.square_delay, first=0.0)
    square = Wave(par.square_low, par.square_low + par.square_amplitude, pulse)
    edge = Wave(par.step_initial, par.step_final, Pulse(positive(inputs.dt), 1.0, par.step_time, first=0.0))
    duty = clip((inputs.reference - par.pwm_low) / positive(par.pwm_high - par.pwm_low), 0.0, 1.0)
    pwm = Wave(par.pwm_low, par.pwm_high, Pulse(1.0 / par.pwm_frequency, duty, delay=0.0, first=ALWAYS))
    output = wave(inputs.reference, Bridge(par.bridge_kind, par.bridge_supply, par.bridge_frequency, par.bridge_levels))
    chosen = where_each(par.waveform == Waveform.step, edge, square)
    chosen = where_each(par.waveform == Waveform.pwm, pwm, chosen)
    chosen = where_each(par.waveform == Waveform.bridge, output, chosen)
    return levels(chosen.low, chosen.high, *evaluate_pulse(inputs.time, inputs.dt, tolerance, chosen.pulse))


def _profile(inputs: Inputs, tolerance: Scalar, par: Parameters) -> tuple[Scalar, Scalar]:
    """[RTS] Fig. 13: high for dt1, low for dt2, high until half of the period, then the mirror image.

    That is a square wave with a notch in its high half, and the same pulse in its low half.
    """
    half, delay = par.profile_half_period, par.profile_delay
    period, first = 2.0 * half, clip(par.profile_first, 0.0, half)
    duty = clip(par.profile_second, 0.0, half - first) / period

    def part(share: Scalar, start: Scalar) -> tuple[Scalar, Scalar]:
        return evaluate_pulse(inputs.time, inputs.dt, tolerance, Pulse(period, share, start, 0.0))

    is_made, made = part(0.5, delay)
    is_notched, notched = part(duty, delay + first)
    is_pulsed, pulse = part(duty, delay + half + first)
    is_high = (is_made & not_(is_notched)) | is_pulsed
    return levels(par.profile_low, par.profile_low + par.profile_amplitude, is_high, made - notched + pulse)


def _curve(name: str, par: Parameters) -> Curve:
    """The curve of one of the waveforms with a table."""
    fields = ("file_time", "file_voltage", "file_integral", "period", "repeat_from")
    return Curve(*(getattr(par, f"{name}_{field}") for field in fields))


# Voltages of two levels: where a step lies among the edges of a pulse that repeats.


class Pulse(NamedTuple):
    """High for `duty` of each period from `delay` on; low before phase `first`."""

    period: Scalar
    duty: Scalar
    delay: Scalar
    first: Scalar


class Wave(NamedTuple):
    """Two levels [V], and when the voltage is at the upper one."""

    low: Scalar
    high: Scalar
    pulse: Pulse


def levels(low: Scalar, high: Scalar, is_high: Scalar, fraction: Scalar) -> tuple[Scalar, Scalar]:
    """Voltage at the end and mean; in this form 0 and 1 give the levels exactly."""
    return where(is_high, high, low), low * (1.0 - fraction) + high * fraction


def evaluate_pulse(time: Scalar, dt: Scalar, tolerance: Scalar, pulse: Pulse) -> tuple[Scalar, Scalar]:
    """Tell whether the pulse is high at the end of the step, and for which fraction of the step.

    Phases are counted from the start of the period in which the step ends, so the rounding of their difference is that
    of the step, not of the time. The mean follows from the phase that is high, I(p) = floor(p) D + min(p - floor(p),
    D).
    """
    D, tol = pulse.duty, tolerance / pulse.period
    p = (time - pulse.delay) / pulse.period
    n = -floor(tol - p) - 1.0  # periods before this one: the end lies in (0, 1], as its left limit is wanted
    end = _on_edge(p - n, D, tol)
    start = p - n - dt / pulse.period
    m = floor(start + tol)
    phase = start - m
    phase = where(phase <= tol, 0.0, _on_edge(phase, D, tol))
    start = m + phase

    is_begun = n > pulse.first - 0.5
    is_high = is_begun & (end <= D) & (D > 0.0)
    first = pulse.first - n
    I_end = where(end < D, end, D)
    I_start = where(start < first, first * D, m * D + where(phase < D, phase, D))
    is_long = end > start  # else there is no step, or all of it is on an edge
    fraction = where(is_begun, I_end - I_start, 0.0) / positive(end - start)
    return is_high, where(is_long, fraction, where(is_high, 1.0, 0.0))


def _on_edge(phase: Scalar, D: Scalar, tol: Scalar) -> Scalar:
    """Phase, moved onto the edge at D or the one at 1 if that is closer than `tol`."""
    return where(fabs(phase - D) <= tol, D, where(phase >= 1.0 - tol, 1.0, phase))
