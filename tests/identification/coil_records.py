"""Records of a coil without motion, made by its kernel on a finer grid, with edges half-way between two samples."""

from __future__ import annotations

import numpy as np

from gapsense.identification.coil.fit import simulate
from gapsense.identification.coil.kernel import NO_SATURATION, Parameters
from gapsense.identification.measurements.prepare import subtract_offsets
from gapsense.identification.measurements.record import Columns, Record, to_record

DT, FINER = 20e-6, 4
PLAIN = Parameters(DT, 2.0, 1.0 / 8e-3, 0.0, NO_SATURATION, 0.0, 0.0, 1.0)
PEAK = 0.04  # flux linkage of the stronger pulse, about [Wb]
EDDY, HYSTERESIS = {"eddy": 0.03}, {"hysteresis": 0.5, "turnover": 0.012}
CORE = {"air": 60.0, "core": 65.0, "saturation": 0.06}
REST, LENGTH = 100, 1200  # samples before the first pulse, and of each


def coil_record(par: Parameters = PLAIN, pulses=(12.0, 8.0), noise=2e-3, seed=1, step=0.0, floor=False) -> Record:
    """Pulses of some voltages, 5 ms each; `step` of an 8 bit converter of the current, which may round down."""
    dt, count = DT / FINER, FINER * (REST + LENGTH * len(pulses))
    t = (np.arange(count + 1) - FINER * REST) * dt
    middle = t - 0.5 * dt - 0.5 * DT
    on = (middle > 0.0) & (middle % (LENGTH * DT) < 5e-3)
    volts = np.where(on, np.array(pulses)[np.clip((middle // (LENGTH * DT)).astype(int), 0, len(pulses) - 1)], 0.0)
    current = simulate(par._replace(sample_time=dt), np.stack((volts, volts, volts), axis=1))[::FINER, 0]
    times = t[::FINER]
    voltage = volts[np.minimum(np.arange(times.size) * FINER, volts.size - 1)]
    rng = np.random.default_rng(seed)
    current = current + noise * rng.standard_normal(times.size)
    if step:
        current = step * (np.floor(current / step) if floor else np.round(current / step))
    values = {"time": times, "voltage": voltage, "current": current}
    return subtract_offsets(to_record(Columns("coil.csv", np.arange(times.size) + 2, values)))
