"""Drive voltage: square wave, step, table or PWM, with edges anywhere in a communication step.

`voltage` is the value at the end of the step, and on an edge the value just before it; `voltage_mean` is the exact mean
over the step, so that an actuator driven by it gets the volt-seconds of an edge inside the step.

An edge counts as on a communication point if it is closer to it than 1e-9 of the step plus 1e-11 of the time, because
hosts that add up their steps know their time only to accumulated rounding.  The step before then ends on it and the
step after starts on it, so that its volt-seconds are neither lost nor counted twice.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from gapsense.records import Array, Scalar, Table
from gapsense.trace import clip, cond, fabs, floor, load, locate, where

SQUARE, STEP, TABLE, PWM = 0.0, 1.0, 2.0, 3.0
ALWAYS = -1e30  # phase at which a wave without a beginning begins


class Parameters(NamedTuple):
    """The waveform and the numbers of each; only those of the chosen one matter."""

    waveform: Scalar  # 0 square, 1 step, 2 table, 3 PWM
    square_amplitude: Scalar  # height above `square_low` [V]
    square_low: Scalar  # low level, also before the delay [V]
    square_period: Scalar  # positive [s]
    square_duty: Scalar  # fraction of the period that is high, and comes first, 0 to 1 [1]
    square_delay: Scalar  # time of the first rising edge [s]
    step_initial: Scalar  # [V]
    step_final: Scalar  # [V]
    step_time: Scalar  # [s]
    table_file_time: Annotated[Array, Table()]  # not decreasing, a repeated time is a jump; at least two rows [s]
    table_file_voltage: Annotated[Array, Table()]  # linear in between, the ends are held [V]
    table_file_integral: Annotated[Array, Table()]  # its running integral, made by the shell [V s]
    pwm_high: Scalar  # above `pwm_low` [V]
    pwm_low: Scalar  # [V]
    pwm_frequency: Scalar  # of the carrier, positive [Hz]


class State(NamedTuple):
    """Nothing is carried on but the clock: the voltage is a function of time and inputs."""

    time: Scalar  # end of the last step [s]


class Inputs(NamedTuple):
    """The step, from the shell, and the signals that hold during it."""

    time: Scalar  # end of the step [s]
    dt: Scalar  # its length, 0 at the start [s]
    enable: Scalar  # 0.5 or below: both outputs are 0 V
    reference: Scalar  # mean voltage that the PWM is to give [V]


class Outputs(NamedTuple):
    """Voltage at the end of the step and its mean over the step."""

    voltage: Scalar  # [V]
    voltage_mean: Scalar  # [V]


class _Wave(NamedTuple):
    """Two levels in turn: high for `duty` of each period from `delay` on; low before phase `first`."""

    low: Scalar
    high: Scalar
    period: Scalar
    duty: Scalar
    delay: Scalar
    first: Scalar


def initial(inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """Voltage at the start, where there is no step yet to take a mean over."""
    return step(State(inputs.time), inputs._replace(dt=0.0), par)


def step(state: State, inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """Outputs of one communication step."""
    tolerance = 1e-9 * inputs.dt + 1e-11 * fabs(inputs.time)
    voltage, mean = cond(
        par.waveform == TABLE,
        lambda: _tabulated(inputs, tolerance, par),
        lambda: _two_levels(inputs, tolerance, _wave(inputs, par)),
    )
    is_on = inputs.enable > 0.5
    return State(inputs.time), Outputs(where(is_on, voltage, 0.0), where(is_on, mean, 0.0))


def _wave(inputs: Inputs, par: Parameters) -> _Wave:
    """The chosen wave; a step is a wave that stays high, and its period then only sets the scale of the phase."""
    square = _Wave(
        par.square_low,
        par.square_low + par.square_amplitude,
        par.square_period,
        par.square_duty,
        par.square_delay,
        0.0,
    )
    edge = _Wave(par.step_initial, par.step_final, _positive(inputs.dt), 1.0, par.step_time, 0.0)
    duty = clip((inputs.reference - par.pwm_low) / _positive(par.pwm_high - par.pwm_low), 0.0, 1.0)
    pwm = _Wave(par.pwm_low, par.pwm_high, 1.0 / par.pwm_frequency, duty, 0.0, ALWAYS)
    is_pwm, is_step = par.waveform == PWM, par.waveform == STEP
    return _Wave(*(where(is_pwm, p, where(is_step, e, s)) for p, e, s in zip(pwm, edge, square)))


def _two_levels(inputs: Inputs, tolerance: Scalar, wave: _Wave) -> tuple[Scalar, Scalar]:
    """Value at the end and mean of a wave of two levels.

    Phases count from the start of the period in which the step ends, so that their difference is exact to rounding of
    the step, not of the time.  The mean follows from the phase that is high, I(p) = floor(p) D + min(p - floor(p), D).
    """
    D, tol = wave.duty, tolerance / wave.period
    p = (inputs.time - wave.delay) / wave.period
    n = -floor(tol - p) - 1.0  # periods before this one: the end lies in (0, 1], as its left limit is wanted
    end = _on_edge(p - n, D, tol)
    start = p - n - inputs.dt / wave.period
    m = floor(start + tol)
    phase = start - m
    phase = where(phase <= tol, 0.0, _on_edge(phase, D, tol))
    start = m + phase

    is_begun = n > wave.first - 0.5
    is_high = is_begun & (end <= D) & (D > 0.0)
    first = wave.first - n
    I_end = where(end < D, end, D)
    I_start = where(start < first, first * D, m * D + where(phase < D, phase, D))
    is_long = end > start  # else there is no step, or all of it is on an edge
    fraction = where(is_begun, I_end - I_start, 0.0) / _positive(end - start)
    fraction = where(is_long, fraction, where(is_high, 1.0, 0.0))
    # in this form 0 and 1 give the levels exactly
    return where(is_high, wave.high, wave.low), wave.low * (1.0 - fraction) + wave.high * fraction


def _on_edge(phase: Scalar, D: Scalar, tol: Scalar) -> Scalar:
    """Phase, moved onto the edge at D or the one at 1 if that is closer than `tol`."""
    return where(fabs(phase - D) <= tol, D, where(phase >= 1.0 - tol, 1.0, phase))


def _tabulated(inputs: Inputs, tolerance: Scalar, par: Parameters) -> tuple[Scalar, Scalar]:
    """Value at the end and mean of the table."""
    end, start = inputs.time, inputs.time - inputs.dt
    k = locate(par.table_file_time, end - tolerance)  # the piece before a jump at the end
    t0, t1 = load(par.table_file_time, k), load(par.table_file_time, k, 1)
    u0, u1 = load(par.table_file_voltage, k), load(par.table_file_voltage, k, 1)
    is_before, is_after = end <= t0 + tolerance, start >= t1 - tolerance  # then `k` is the first or the last piece
    is_inside = (start >= t0 - tolerance) & (end <= t1 + tolerance)
    u_end = where(is_before, u0, _value(par, k, end))
    u_start = where(is_after, u1, _value(par, k, start))
    mean = cond(
        is_inside | is_before | is_after,
        lambda: (u_start + u_end) / 2.0,  # one piece: a constant voltage comes out exactly
        lambda: (_integral(par, end, tolerance) - _integral(par, start, tolerance)) / _positive(inputs.dt),
    )
    return u_end, where(inputs.dt > 0.0, mean, u_end)


def _positive(x: Scalar) -> Scalar:
    """`x`, or 1 in place of what cannot be divided by."""
    return where(x > 0.0, x, 1.0)


def _value(par: Parameters, k: Scalar, t: Scalar) -> Scalar:
    """Voltage at time `t` from piece `k` of the table, its ends held."""
    t0, t1 = load(par.table_file_time, k), load(par.table_file_time, k, 1)
    u0, u1 = load(par.table_file_voltage, k), load(par.table_file_voltage, k, 1)
    w = (t - t0) / _positive(t1 - t0)
    return where(t < t0, u0, where(t >= t1, u1, u0 + (u1 - u0) * w))


def _integral(par: Parameters, t: Scalar, tolerance: Scalar) -> Scalar:
    """Integral of the voltage from the first row to time `t`."""
    k = locate(par.table_file_time, t - tolerance)
    t0, t1 = load(par.table_file_time, k), load(par.table_file_time, k, 1)
    inside = clip(t, t0, t1)
    u0, u = load(par.table_file_voltage, k), _value(par, k, t)
    return load(par.table_file_integral, k) + (inside - t0) * (u0 + u) / 2.0 + (t - inside) * u
