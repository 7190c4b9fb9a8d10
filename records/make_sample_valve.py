"""Makes the sample records of this folder: voltage and current of a simulated valve, as one measures them at 20 us.

Run it as `python records/make_sample_valve.py`.  The valve is not that of any paper; its own values are in `VALVE`.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from gapsense.actuators import solenoid_valve
from gapsense.studies import devices

Vector = npt.NDArray[np.float64]
HERE = Path(__file__).resolve().parent
VALVE = devices.VALVE._replace(
    coil_resistance=46.0,
    coil_turns=1050.0,
    gap_slope=2.2e10,
    core_reluctance=2.4e6,
    core_saturation=0.03,
    mover_mass=2e-3,
    spring_stiffness=180.0,
    spring_rest=8e-3,
    damping=0.5,
    stop_lower=0.05e-3,
    stop_upper=0.75e-3,
    initial_position=0.75e-3,
)
RECORDS = {"sample_valve": (24.0, 24.0, 20.0, 20.0), "sample_valve_22V": (22.0,)}  # height of each pulse [V]
DT, FINE = 20e-6, 4  # s; steps of the simulation in it
REST, ON, OFF = 3e-3, 10e-3, 15e-3  # s; before the first pulse, of each pulse, after each
OFFSET, NOISE = (0.05, 2e-3), (15e-3, 1e-3)  # of voltage and current [V, A]
STEPS = (50.0 / 2**11, 1.0 / 2**11)  # of converters with 12 bits, for 50 V and 1 A in both directions


def simulated(pulses: Sequence[float]) -> tuple[Vector, Vector]:
    """Current and position at each sample; the pulses begin and end half-way between two samples."""
    dt = DT / FINE
    count = FINE * round((REST + len(pulses) * (ON + OFF)) / DT) + 1
    middle = (np.arange(count) + 0.5) * dt  # of the step that each voltage is held for
    u = driven(middle, pulses)
    every = devices.drive(solenoid_valve, VALVE, u, dt, "current", "position")[::FINE]
    return every[:, 0], every[:, 1]


def driven(times: Vector, pulses: Sequence[float]) -> Vector:
    """Voltage at some times."""
    at = times - REST - 0.5 * DT
    number = np.clip(np.floor(at / (ON + OFF)), 0, len(pulses) - 1).astype(int)
    is_on = (at > 0.0) & (at - number * (ON + OFF) < ON)
    return np.where(is_on, np.asarray(pulses)[number], 0.0)


def measured(name: str) -> tuple[Vector, Vector, Vector]:
    """Time, voltage and current of a record: with offset and noise, by a converter."""
    rng = np.random.default_rng([*RECORDS].index(name) + 1)
    current, _ = simulated(RECORDS[name])
    times = DT * np.arange(current.size)
    signals = (driven(times, RECORDS[name]), current)
    noisy = [x + offset + noise * rng.standard_normal(x.size) for x, offset, noise in zip(signals, OFFSET, NOISE)]
    voltage, current = (step * np.round(x / step) for x, step in zip(noisy, STEPS))
    return times, voltage, current


def text(name: str) -> str:
    """A record as a CSV file."""
    rows = (f"{1e3 * t:.2f},{u:.4f},{i:.5f}" for t, u, i in zip(*(x.tolist() for x in measured(name))))
    return "\n".join(["time [ms],voltage [V],current [A]", *rows, ""])


if __name__ == "__main__":
    for name in RECORDS:
        (HERE / f"{name}.csv").write_text(text(name), encoding="utf-8", newline="\n")
