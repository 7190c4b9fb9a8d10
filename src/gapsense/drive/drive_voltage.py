"""Drive voltage: square wave, step, table, PWM, pulse profile, soft landing, bridge; edges anywhere in a step.

`voltage` is the value at the end of the step, and on an edge the value just before it; `voltage_mean` is the exact mean
over the step, so that an actuator driven by it gets the volt-seconds of an edge inside the step.

An edge counts as on a communication point if it is closer to it than 1e-9 of the step plus 1e-11 of the time, because
hosts that add up their steps know their time only to accumulated rounding.  The step before then ends on it and the
step after starts on it, so that its volt-seconds are neither lost nor counted twice.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from gapsense.drive.bridge import Bridge, Kind, wave
from gapsense.drive.curve import Curve, positive, tabulated
from gapsense.drive.pulses import ALWAYS, Pulse, Wave, levels, pulsed
from gapsense.kernels.layout import Array, Choice, Scalar, Table, flat, record
from gapsense.kernels.trace import clip, cond, fabs, not_, where


class Waveform(Choice):
    """What is generated."""

    square, step, table, pwm, profile, soft_landing, bridge = range(7)


class Parameters(NamedTuple):
    """The waveform and the numbers of each; only those of the chosen one matter."""

    waveform: Annotated[Scalar, Waveform]
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
    table_period: Scalar  # with which it repeats, 0 for never [s]
    table_repeat_from: Scalar  # start of the part that repeats [s]
    pwm_high: Scalar  # above `pwm_low` [V]
    pwm_low: Scalar  # [V]
    pwm_frequency: Scalar  # of the carrier, positive [Hz]
    profile_amplitude: Scalar  # height above `profile_low` [V]
    profile_low: Scalar  # low level, also before the delay [V]
    profile_first: Scalar  # dt1, high [s]
    profile_second: Scalar  # dt2, low; high for the rest of the half period; then the mirror image [s]
    profile_half_period: Scalar  # positive [s]
    profile_delay: Scalar  # time of the first rising edge [s]
    soft_landing_file_time: Annotated[Array, Table()]  # as the table [s]
    soft_landing_file_voltage: Annotated[Array, Table()]  # [V]
    soft_landing_file_integral: Annotated[Array, Table()]  # [V s]
    soft_landing_period: Scalar  # [s]
    soft_landing_repeat_from: Scalar  # [s]
    bridge_kind: Annotated[Scalar, Kind]
    bridge_supply: Scalar  # positive [V]
    bridge_frequency: Scalar  # of the carrier, 0 for a steady voltage [Hz]
    bridge_levels: Scalar  # of the mean between zero and the supply, 0 for any [1]


class State(NamedTuple):
    """Nothing is carried on but the clock: the voltage is a function of time and inputs."""

    time: Scalar  # end of the last step [s]


class Inputs(NamedTuple):
    """The step, from the shell, and the signals that hold during it."""

    time: Scalar  # end of the step [s]
    dt: Scalar  # its length, 0 at the start [s]
    enable: Scalar  # 0.5 or below: both outputs are 0 V
    reference: Scalar  # mean voltage that the PWM or the bridge is to give [V]


class Outputs(NamedTuple):
    """Voltage at the end of the step and its mean over the step."""

    voltage: Scalar  # [V]
    voltage_mean: Scalar  # [V]


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
            lambda: tabulated(inputs.time, inputs.dt, tolerance, _table(par)),
            lambda: tabulated(inputs.time, inputs.dt, tolerance, _soft_landing(par)),
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
    chosen = _either(par.waveform == Waveform.step, edge, square)
    chosen = _either(par.waveform == Waveform.pwm, pwm, chosen)
    chosen = _either(par.waveform == Waveform.bridge, output, chosen)
    return levels(chosen.low, chosen.high, *pulsed(inputs.time, inputs.dt, tolerance, chosen.pulse))


def _either(condition: Scalar, a: Wave, b: Wave) -> Wave:
    chosen: Wave = record(Wave, (where(condition, x, y) for x, y in zip(flat(a), flat(b))))
    return chosen


def _profile(inputs: Inputs, tolerance: Scalar, par: Parameters) -> tuple[Scalar, Scalar]:
    """[RTS] Fig. 13: high for dt1, low for dt2, high until half of the period, then the mirror image.

    It is a square wave with a notch in its high half and the same as a pulse in its low half.
    """
    half, delay = par.profile_half_period, par.profile_delay
    period, first = 2.0 * half, clip(par.profile_first, 0.0, half)
    duty = clip(par.profile_second, 0.0, half - first) / period

    def part(share: Scalar, start: Scalar) -> tuple[Scalar, Scalar]:
        return pulsed(inputs.time, inputs.dt, tolerance, Pulse(period, share, start, 0.0))

    is_made, made = part(0.5, delay)
    is_notched, notched = part(duty, delay + first)
    is_pulsed, pulse = part(duty, delay + half + first)
    is_high = (is_made & not_(is_notched)) | is_pulsed
    return levels(par.profile_low, par.profile_low + par.profile_amplitude, is_high, made - notched + pulse)


def _table(par: Parameters) -> Curve:
    return Curve(
        time=par.table_file_time,
        voltage=par.table_file_voltage,
        integral=par.table_file_integral,
        period=par.table_period,
        repeat_from=par.table_repeat_from,
    )


def _soft_landing(par: Parameters) -> Curve:
    return Curve(
        time=par.soft_landing_file_time,
        voltage=par.soft_landing_file_voltage,
        integral=par.soft_landing_file_integral,
        period=par.soft_landing_period,
        repeat_from=par.soft_landing_repeat_from,
    )
