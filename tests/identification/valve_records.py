"""Records of the solenoid valve, made by its kernel on a finer grid, with edges half-way between two samples."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from gapsense.identification.measurements.record import Columns, Record, to_record
from gapsense.identification.valve.model import simulate
from gapsense.studies.devices import VALVE

DT = 50e-6
ON, PERIOD, REST = 5e-3, 16e-3, 10  # s, s, samples before the first edge
GUESS = VALVE._replace(coil_turns=1130.0, mover_mass=1.8e-3, damping=0.5, core_saturation=0.026)


def columns(periods=2, volts=30.0, seed=None, noise=(15e-3, 1e-3), par=VALVE, dt=DT, gap_noise=None):
    """Time, voltage and current of square waves from rest on; `noise` of voltage and current, for a seed.

    With `gap_noise` the position too.
    """
    count = 2 * (round(periods * PERIOD / dt) + REST)
    t = (np.arange(count + 1) - 2 * REST - 1) * dt / 2.0
    middle = t - dt / 4.0
    on = np.where((middle > 0.0) & (middle % PERIOD < ON), volts, 0.0)
    model = simulate(par, np.stack((on, on), axis=1), dt / 2.0, np.full(t.size, par.coil_resistance))
    current = model.current[::2]
    times = t[::2]
    voltage = np.where((times > 0.0) & (times % PERIOD < ON), volts, 0.0)
    if seed is not None:
        rng = np.random.default_rng(seed)
        voltage = voltage + noise[0] * rng.standard_normal(times.size)
        current = current + noise[1] * rng.standard_normal(times.size)
    made = {"time": times, "voltage": voltage, "current": current}
    if gap_noise is not None:
        noises = np.random.default_rng((seed or 0) + 1000).standard_normal(times.size)
        made["position"] = model.position[::2] + gap_noise * noises
    return made


def record(**options) -> Record:
    """The same as a record."""
    values = columns(**options)
    return to_record(Columns("valve.csv", np.arange(values["time"].size) + 2, values))


def write(path: Path, values=None, header="time [s],voltage [V],current [A]", **options) -> Path:
    """The same as a CSV file."""
    values = columns(**options) if values is None else values
    rows = [",".join(map(repr, row)) for row in zip(*(values[name].tolist() for name in values))]
    path.write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
    return path
