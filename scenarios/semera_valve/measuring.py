"""Records of the valve as a bench gives them, good ones and bad ones, and how wrong `identify` is with each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from rich.table import Table

from gapsense._os.workers import Progress
from gapsense.actuators import solenoid_valve
from gapsense.actuators.solenoid_valve import Parameters
from gapsense.identification.measurements.prepare import subtract_offsets
from gapsense.identification.measurements.record import Columns, Record, Vector, to_record
from gapsense.identification.options import CONVENTIONS
from gapsense.identification.valve.fit import Identified, fit_valve
from gapsense.identification.valve.form import VALVE
from gapsense.kernels.kernel import Kernel
from gapsense.report.table import table

FINE = 5e-6  # s; step of the device, and where edges may lie
ENDED = 1e-5  # A; a clamp holds no smaller current
KERNEL = Kernel(solenoid_valve)


class Pulses(NamedTuple):
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


def measure(drive: Pulses = Pulses(), instruments: Instruments = Instruments(), par: Parameters = VALVE) -> Columns:  # noqa: B008
    """Columns of a file: what the instruments make of voltage and current."""
    t, v, i = run(drive, par)
    times = np.arange(instruments.start, t[-1] - instruments.delay, instruments.period)
    rng, values = np.random.default_rng(instruments.seed), {"time": times - instruments.start}
    signals = (("voltage", v, 0.0, 0.0), ("current", i, instruments.delay, instruments.offset))
    for (name, x, delay, offset), noise, largest in zip(signals, instruments.noise, instruments.range):
        seen = filter_signal(x, instruments.filter)
        sampled = seen[np.clip(np.round((times - delay) / FINE).astype(int), 0, t.size - 1)] + offset
        values[name] = convert(sampled + noise * rng.standard_normal(times.size), largest, instruments.bits)
    return Columns("record.csv", np.arange(times.size) + 2, values)


def run(drive: Pulses, par: Parameters) -> tuple[Vector, Vector, Vector]:
    """Time, voltage and current of the device, in fine steps."""
    step, constants = KERNEL.scalar["step"], tuple(par)
    count = round((drive.rest + drive.pulses * drive.period) / FINE)
    state, outputs = KERNEL.scalar["initial"]((0.0, 0.0, 0.0), constants)
    rows, at = [(0.0, 0.0)], solenoid_valve.Outputs._fields.index("current")
    for k in range(1, count):
        volts = apply_voltage(drive, (k - 0.5) * FINE - drive.rest, outputs[at])
        state, outputs = step(state, (k * FINE, FINE, volts), constants)
        rows.append((volts, outputs[at]))
    return np.arange(count) * FINE, *np.array(rows).T


def apply_voltage(drive: Pulses, time: float, current: float) -> float:
    """Voltage at the coil, at a time from the first edge on."""
    within = time % drive.period
    if time < 0.0 or within >= drive.on:
        return -drive.clamp if current > ENDED else 0.0
    if drive.carrier and within % drive.carrier >= drive.duty * drive.carrier:
        return 0.0
    return drive.volts - drive.source * current


def filter_signal(x: Vector, constant: float) -> Vector:
    """What a first-order filter leaves of a signal in fine steps."""
    if constant == 0.0:
        return x
    share, y, made = 1.0 - float(np.exp(-FINE / constant)), float(x[0]), []
    for value in x.tolist():
        y += share * (value - y)
        made.append(y)
    return np.array(made)


def convert(x: Vector, largest: float, bits: int) -> Vector:
    """What a converter of so many bits makes of a signal; nothing is cut where there are none."""
    if not bits:
        return x
    step = 2.0 * largest / 2**bits
    return np.asarray(np.clip(step * np.round(x / step), -largest, largest - step))


GOOD = Pulses(rest=2.513e-3, period=16.0137e-3), Instruments(period=20e-6)  # edges anywhere between two samples
PWM = {"volts": 48.0, "duty": 0.6, "carrier": 500e-6}
LOWER = 0.8  # of the voltage, in a second record
GUESS = VALVE._replace(coil_turns=1130.0, mover_mass=1.8e-3, damping=0.5, core_saturation=0.026)
BAD: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "PWM, sampled in step with it": (PWM, {"period": 100e-6}),
    "clipped": ({}, {"bits": 12, "range": (40.0, 0.3)}),
    "not from rest": ({}, {"start": 5e-3}),
}


class Condition(NamedTuple):
    """What differs from a good record."""

    name: str
    drive: dict[str, Any] | None = None
    instruments: dict[str, Any] | None = None
    records: int = 2  # the second one at a lower voltage


CONDITIONS = (
    Condition("every 10 us", {}, {"period": 10e-6}),
    Condition("every 20 us, as all below"),
    Condition("every 50 us", {}, {"period": 50e-6}),
    Condition("every 50 us, edges half-way", {"rest": 2.525e-3, "period": 16e-3}, {"period": 50e-6}),
    Condition("every 100 us", {}, {"period": 100e-6}),
    Condition("noise of 4 mA", {}, {"noise": (60e-3, 4e-3)}),
    Condition("8 bits, +-0.5 A", {}, {"bits": 8}),
    Condition("10 bits, +-0.5 A", {}, {"bits": 10}),
    Condition("10 bits, +-4 A", {}, {"bits": 10, "range": (320.0, 4.0)}),
    Condition("current 10 us late", {}, {"delay": 10e-6}),
    Condition("current 40 us late", {}, {"delay": 40e-6}),
    Condition("filter of 20 us", {}, {"filter": 20e-6}),
    Condition("filter of 100 us", {}, {"filter": 100e-6}),
    Condition("offset 5 mA, 100 samples at rest", {"rest": 2.013e-3}, {"offset": 5e-3}),
    Condition("offset 5 mA, 4 samples at rest", {"rest": 0.073e-3}, {"offset": 5e-3}),
    Condition("one voltage only", records=1),
    Condition("clamp of 40 V", {"clamp": 40.0}),
    Condition("PWM of 2 kHz", PWM),
    Condition("PWM of 2 kHz, every 100 us", PWM, {"period": 100e-6}),
)


class Outcome(NamedTuple):
    """Of one condition, over some seeds."""

    condition: Condition
    errors: Mapping[str, float]  # largest of each parameter, relative
    stated: Mapping[str, float]  # standard errors that came with them
    is_explained: bool  # in all runs; `identify` ends with exit code 0


def record(drive: Pulses, instruments: Instruments, name: str = "good") -> Record:
    """What `gapsense inspect` reads from the file of such a record."""
    return subtract_offsets(to_record(measure(drive, instruments)))._replace(name=name)


def bad() -> list[Record]:
    """Records of which little can be made."""
    drive, instruments = GOOD
    return [record(drive._replace(**d), instruments._replace(**i), name) for name, (d, i) in BAD.items()]


def outcomes(
    seeds: int = 2, conditions: Sequence[Condition] = CONDITIONS, progress: Progress = lambda done, total: None
) -> list[Outcome]:
    """How wrong `identify` is."""
    found = []
    for k, condition in enumerate(conditions):
        progress(k, len(conditions))
        found.append(outcome(condition, seeds))
    return found


def outcome(condition: Condition, seeds: int) -> Outcome:
    """Of one condition."""
    runs = [identify_one(condition, seed) for seed in range(1, seeds + 1)]
    names = runs[0].names
    errors = [[getattr(r.parameters, name) / getattr(VALVE, name) - 1.0 for name in names] for r in runs]
    stated = [r.uncertainty.relative for r in runs]
    return Outcome(
        condition=condition,
        errors=dict(zip(names, np.abs(errors).max(axis=0).tolist())),
        stated=dict(zip(names, np.max(stated, axis=0).tolist())),
        is_explained=all(r.is_explained for r in runs),
    )


def identify_one(condition: Condition, seed: int) -> Identified:
    """What `identify` makes of records of one seed."""
    drive = GOOD[0]._replace(**(condition.drive or {}))
    instruments = GOOD[1]._replace(**(condition.instruments or {}))
    volts = [drive.volts, LOWER * drive.volts][: condition.records]
    records = [
        record(drive._replace(volts=v), instruments._replace(seed=10 * seed + k), f"{v:g} V")
        for k, v in enumerate(volts)
    ]
    return fit_valve(records, GUESS, starts=6, conventions=CONVENTIONS)


SHOWN = (
    "coil_resistance",
    "coil_turns",
    "core_reluctance",
    "core_saturation",
    "spring_stiffness",
    "mover_mass",
    "damping",
)
HEADS = ("record", "R", "turns", "core", "saturation", "spring", "mass", "friction", "explained")


def rows(found: Sequence[Outcome]) -> list[tuple[str, ...]]:
    """Largest errors in percent, and whether `identify` calls the record explained."""
    return [
        (o.condition.name, *(percent(o.errors[name]) for name in SHOWN), "yes" if o.is_explained else "no")
        for o in found
    ]


def percent(share: float) -> str:
    """Two digits, without an exponent."""
    return f"{float(f'{100.0 * share:.2g}'):g}"


def outcome_table(found: Sequence[Outcome]) -> Table:
    """The same as a table."""
    return table("Errors of `gapsense identify`, percent", HEADS, rows(found))


def markdown(found: Sequence[Outcome]) -> str:
    """The same for a page."""
    lines = [HEADS, ("---",) * len(HEADS), *rows(found)]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)
