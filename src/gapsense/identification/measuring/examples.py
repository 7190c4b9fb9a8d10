"""Records of the valve on the bench, good ones and bad ones, and how wrong `identify` is with each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from gapsense._os.workers import Progress
from gapsense.identification.measurements.conventions import CONVENTIONS
from gapsense.identification.measurements.record import Record, to_record
from gapsense.identification.measurements.rest import without_offsets
from gapsense.identification.measuring.bench import Drive, Instruments, measured
from gapsense.identification.valve import fit
from gapsense.identification.valve.identified import Identified
from gapsense.identification.valve.scales import VALVE

GOOD = Drive(rest=2.513e-3, period=16.0137e-3), Instruments(period=20e-6)  # edges anywhere between two samples
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


def record(drive: Drive, instruments: Instruments, name: str = "good") -> Record:
    """What `gapsense inspect` reads from the file of such a record."""
    return without_offsets(to_record(measured(drive, instruments)))._replace(name=name)


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
    runs = [identified(condition, seed) for seed in range(1, seeds + 1)]
    names = runs[0].names
    errors = [[getattr(r.parameters, name) / getattr(VALVE, name) - 1.0 for name in names] for r in runs]
    stated = [r.uncertainty.relative for r in runs]
    return Outcome(
        condition=condition,
        errors=dict(zip(names, np.abs(errors).max(axis=0).tolist())),
        stated=dict(zip(names, np.max(stated, axis=0).tolist())),
        is_explained=all(r.is_explained for r in runs),
    )


def identified(condition: Condition, seed: int) -> Identified:
    """What `identify` makes of records of one seed."""
    drive = GOOD[0]._replace(**(condition.drive or {}))
    instruments = GOOD[1]._replace(**(condition.instruments or {}))
    volts = [drive.volts, LOWER * drive.volts][: condition.records]
    records = [
        record(drive._replace(volts=v), instruments._replace(seed=10 * seed + k), f"{v:g} V")
        for k, v in enumerate(volts)
    ]
    return fit.identify(records, GUESS, starts=6, conventions=CONVENTIONS)
