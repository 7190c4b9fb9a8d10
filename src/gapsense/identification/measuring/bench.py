"""Records as a bench gives them: the solenoid valve, what drives it, and the instruments that look at it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gapsense.actuators import solenoid_valve
from gapsense.actuators.solenoid_valve import Parameters
from gapsense.identification.measurements.record import Columns, Vector
from gapsense.identification.valve.scales import VALVE
from gapsense.kernels.kernel import Kernel

FINE = 5e-6  # s; step of the device, and where edges may lie
ENDED = 1e-5  # A; a clamp holds no smaller current
KERNEL = Kernel(solenoid_valve)


class Drive(NamedTuple):
    """Pulses of voltage, and where the current goes when they end."""

    volts: float = 30.0  # of the supply [V]
    on: float = 5e-3  # length of a pulse [s]
    period: float = 16e-3  # from one to the next [s]
    pulses: int = 2
    rest: float = 2.5e-3  # before the first one [s]
    clamp: float = 0.0  # voltage against which the current falls [V]
    source: float = 0.0  # resistance of supply and leads [Ohm]
    carrier: float = 0.0  # period of PWM in a pulse; 0 for none [s]
    duty: float = 1.0  # of it


class Instruments(NamedTuple):
    """How voltage and current become numbers."""

    period: float = 50e-6  # between two samples [s]
    start: float = 0.0  # first sample [s]
    noise: tuple[float, float] = (15e-3, 1e-3)  # of voltage [V] and current [A]
    bits: int = 0  # of both converters; 0 for fine ones
    range: tuple[float, float] = (40.0, 0.5)  # largest voltage [V] and current [A], of both signs
    filter: float = 0.0  # time constant of a first-order filter in both channels [s]
    delay: float = 0.0  # of the current behind the voltage [s]
    offset: float = 0.0  # of the current [A]
    seed: int = 1


def measured(drive: Drive = Drive(), instruments: Instruments = Instruments(), par: Parameters = VALVE) -> Columns:  # noqa: B008
    """Columns of a file: what the instruments make of voltage and current."""
    t, v, i = run(drive, par)
    times = np.arange(instruments.start, t[-1] - instruments.delay, instruments.period)
    rng, values = np.random.default_rng(instruments.seed), {"time": times - instruments.start}
    signals = (("voltage", v, 0.0, 0.0), ("current", i, instruments.delay, instruments.offset))
    for (name, x, delay, offset), noise, largest in zip(signals, instruments.noise, instruments.range):
        seen = filtered(x, instruments.filter)
        sampled = seen[np.clip(np.round((times - delay) / FINE).astype(int), 0, t.size - 1)] + offset
        values[name] = converted(sampled + noise * rng.standard_normal(times.size), largest, instruments.bits)
    return Columns("record.csv", np.arange(times.size) + 2, values)


def run(drive: Drive, par: Parameters) -> tuple[Vector, Vector, Vector]:
    """Time, voltage and current of the device, in fine steps."""
    step, constants = KERNEL.scalar["step"], tuple(par)
    count = round((drive.rest + drive.pulses * drive.period) / FINE)
    state, outputs = KERNEL.scalar["initial"]((0.0, 0.0, 0.0), constants)
    rows, at = [(0.0, 0.0)], solenoid_valve.Outputs._fields.index("current")
    for k in range(1, count):
        volts = applied(drive, (k - 0.5) * FINE - drive.rest, outputs[at])
        state, outputs = step(state, (k * FINE, FINE, volts), constants)
        rows.append((volts, outputs[at]))
    return np.arange(count) * FINE, *np.array(rows).T


def applied(drive: Drive, time: float, current: float) -> float:
    """Voltage at the coil, at a time from the first edge on."""
    within = time % drive.period
    if time < 0.0 or within >= drive.on:
        return -drive.clamp if current > ENDED else 0.0
    if drive.carrier and within % drive.carrier >= drive.duty * drive.carrier:
        return 0.0
    return drive.volts - drive.source * current


def filtered(x: Vector, constant: float) -> Vector:
    """What a first-order filter leaves of a signal in fine steps."""
    if constant == 0.0:
        return x
    share, y, made = 1.0 - float(np.exp(-FINE / constant)), float(x[0]), []
    for value in x.tolist():
        y += share * (value - y)
        made.append(y)
    return np.array(made)


def converted(x: Vector, largest: float, bits: int) -> Vector:
    """What a converter of so many bits makes of a signal; nothing is cut where there are none."""
    if not bits:
        return x
    step = 2.0 * largest / 2**bits
    return np.asarray(np.clip(step * np.round(x / step), -largest, largest - step))
