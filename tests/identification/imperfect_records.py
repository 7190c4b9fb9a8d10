"""Records of the solenoid valve as people bring them: each with one thing that identification does not know."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.signal import butter, lfilter

from gapsense.actuators.solenoid_valve import Parameters
from gapsense.identification.measurements.prepare import subtract_offsets
from gapsense.identification.measurements.record import Columns, Record, to_record
from gapsense.identification.valve.model import KERNELS, LOOKS
from gapsense.kernels.layout import flat
from gapsense.studies.devices import VALVE

KERNEL = KERNELS[Parameters]
PERIOD, ON = 16e-3, 5e-3  # s
FINE = 8  # steps of the valve in a sample
NOISE = {"voltage": 15e-3, "current": 1e-3}  # V, A


class Condition(NamedTuple):
    """A device, a drive and instruments; what is left out is as it should be."""

    par: Parameters = VALVE
    dt: float = 50e-6  # sampling period [s]
    rest: int = 30  # samples before the first edge
    edge: float = 0.5  # where the edges lie between two samples
    period: float = PERIOD  # of operations [s]
    on: float = ON  # how long the voltage is on in each [s]
    eddy: float = 0.0  # conductance of the core beside the coil [S]
    warming: float = 0.0  # of the resistance, relative, over the record
    series: float = 0.0  # resistance of supply and switch [Ohm]
    diode: float = 0.0  # drop while the current falls [V]
    clamp: float = 0.0  # the same, in the recorded voltage [V]
    duty: float = 1.0  # of PWM as fast as the samples, of which the voltage shows nothing, or of
    carrier: float = 0.0  # this period [s]
    peak: float = 0.0  # how long it has not begun [s]
    slew: float = 0.0  # how long the driver takes for an edge [s]
    lag: float = 0.0  # time constant of its output [s]
    only_command: bool = False  # recorded in place of the voltage
    offset: float = 0.0  # of the current [A]
    gain: float = 1.0  # of the current
    skew: float = 0.0  # the current is late [s]
    filtered: float = 0.0  # time constant of the current's filter [s]
    blurred: float = 0.0  # the same, of the filter of both channels [s]
    order: int = 1  # of that filter; a second order is that of Butterworth
    drift: float = 0.0  # of the current's zero over the record [A]
    hum: float = 0.0  # at 50 Hz [A]
    step: float = 0.0  # of the current's converter [A]
    noise: float = 1.0  # times `NOISE`
    convention: str = ""  # the voltage between samples, as the user gave it; none: found
    driver: str = ""  # likewise, what is known of the driver
    accuracy: str = ""  # likewise, of the scales
    told: str = ""  # one of these words is said where the records are refused


DROPS = {"series": 2.0, "diode": 0.8, "only_command": True}
CONDITIONS = {
    "sound": Condition(),
    "edges at the samples": Condition(edge=0.0),
    "the same, read as `trapezoid`": Condition(edge=0.0, convention="trapezoid"),
    "edges a quarter of a sample early": Condition(edge=0.25),
    "current 20 us late": Condition(skew=20e-6),
    "current filtered, 50 us": Condition(filtered=50e-6, told="late|edges"),
    "5 mA of offset": Condition(offset=5e-3),
    "8 bits": Condition(step=4e-3, told="offset|drop"),
    "8 bits, half a step of offset": Condition(offset=2e-3, step=4e-3, told="offset|drop"),
    "50 Hz, 3 mA": Condition(hum=3e-3, told="hum"),
    "noise of 1 %": Condition(noise=4.0),
    "noise of 3 %": Condition(noise=12.0),
    "100 us": Condition(dt=100e-6),
    "clamp of 40 V": Condition(clamp=40.0, told="drop|voltage"),
    "drops, recorded": Condition(series=2.0, diode=0.8),
    "drops, only the command": Condition(**DROPS, told="drop|series"),
    "the same, `--driver series=2,drop=0.8`": Condition(**DROPS, driver="series=2,drop=0.8"),
    "the same, `--driver fit`": Condition(**DROPS, driver="fit"),
    "PWM in step": Condition(duty=0.63, told="PWM"),
    "PWM in step, after 2 ms of peak": Condition(duty=0.63, peak=2e-3, told="PWM|voltage"),
    "eddy currents, 0.3 mS": Condition(eddy=3e-4),
    "eddy currents, 1 mS": Condition(eddy=1e-3),
    "coil 5 % warmer at the end": Condition(warming=0.05),
    "current 1 % too large": Condition(gain=1.01, accuracy="current=1"),
}


def records(c: Condition, seed: int) -> list[Record]:
    """Three operations at 30 V and two at 24 V."""
    rng = np.random.default_rng(seed)
    return [record(c, volts, count, rng) for volts, count in ((30.0, 3), (24.0, 2))]


def record(c: Condition, volts: float, count: int, rng: np.random.Generator) -> Record:
    """One of them."""
    samples = c.rest + round(count * c.period / c.dt) + 1
    fine = c.dt / FINE
    t = (np.arange(FINE * samples) + 1) * fine - (c.rest - 1 + c.edge) * c.dt
    middle = t - 0.5 * fine
    command = np.where((middle > 0.0) & (middle % c.period < c.on), volts, 0.0)
    if c.carrier:
        command *= (middle % c.period) % c.carrier < c.duty * c.carrier
    command = lowpass(command, fine, c.lag)
    if c.slew:
        steps = round(c.slew / fine)
        command = lfilter(np.full(steps, 1.0 / steps), [1.0], command)
    voltage, current = driven(c, middle, command)
    seen = command if c.only_command else voltage
    late = c.skew / fine
    current = np.interp(np.arange(t.size) - late, np.arange(t.size), lowpass(current, fine, c.filtered))
    v, i = (lowpass(x, fine, c.blurred, c.order)[FINE - 1 :: FINE] for x in (seen, current))
    hum = c.hum * np.sin(2.0 * np.pi * 50.0 * np.arange(i.size) * c.dt + 1.0)
    i = c.gain * i + c.offset + c.drift * np.linspace(0.0, 1.0, i.size) + hum
    v, i = (x + c.noise * NOISE[name] * rng.standard_normal(x.size) for name, x in (("voltage", v), ("current", i)))
    i = np.round(i / c.step) * c.step if c.step else i
    values = {"time": np.arange(samples) * c.dt, "voltage": v, "current": i}
    made = to_record(Columns(f"{volts:g}.csv", np.arange(samples) + 2, values), c.convention or "trapezoid")
    return subtract_offsets(made)


def driven(c: Condition, times: np.ndarray, command: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Voltage that is seen at the coil, and its current, at the end of each fine interval."""
    step, dt = KERNEL.scalar["step"], float(times[1] - times[0])
    constants, i, rows = flat(c.par)[1:], 0.0, []
    state, _ = KERNEL.scalar["initial"]((0.0, 0.0, 0.0), flat(c.par))
    for k, (t, wanted) in enumerate(zip(times.tolist(), command.tolist())):
        R = c.par.coil_resistance * (1.0 + c.warming * k / times.size)
        on = wanted > 0.0
        mean = wanted * (c.duty if t % c.period > c.peak and not c.carrier else 1.0) - (c.series * i if on else 0.0)
        v = mean if on or i < 1e-5 else -c.diode - c.clamp
        shared = 1.0 + R * c.eddy  # i = (g u + i_mag) / (1 + R g)
        state, outputs = step(state, (t, dt, v / shared), (R / shared, *constants))
        i = (c.eddy * v + LOOKS[Parameters](outputs)[0]) / shared
        rows.append((wanted if c.duty < 1.0 and on else v, i))
    voltage, current = np.array(rows).T
    return voltage, current


def lowpass(x: np.ndarray, dt: float, memory: float, order: int = 1) -> np.ndarray:
    """A filter of first order, with this time constant, or of second order with the same corner."""
    if not memory:
        return x
    if order == 2:
        return np.asarray(lfilter(*butter(2, 1.0 / (2.0 * np.pi * memory), fs=1.0 / dt), x))
    part = 1.0 - np.exp(-dt / memory)
    return np.asarray(lfilter([part], [1.0, part - 1.0], x))
