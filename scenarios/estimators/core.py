"""The core of the valve with its losses, as a user would find it: from voltage and current of one run.

Known are the mechanics, the gap law and the resistance.  The open loop of `BoundedUkf` runs on the measured voltage.
The six numbers of the core are those with which its current comes nearest to the measured one, in least squares.
`python -m gapsense.scenarios.estimators.core scenarios/estimators` prints them.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import least_squares

from gapsense.cosim import load, run
from gapsense.estimators import ukf
from gapsense.fmi.components import kernel_parameters, own
from gapsense.kernels.kernel import Kernel

from .parameters import VALVE, Core

Floats = NDArray[np.float64]
START = Core(
    reluctance=VALVE.core,
    saturation=1.08 * VALVE.saturation,
    bend=0.15 * VALVE.turns**2 / VALVE.saturation,
    eddy=0.5e-3,
    hysteresis=5e-3,
    turnover=0.07 * VALVE.saturation,
)
SEED = 100  # added to those of the scenario: this run is none of the benchmark
KERNEL = Kernel(ukf)


def identified(voltage: ArrayLike, current: ArrayLike, known: ukf.Parameters, start: Core = START) -> Core:
    """Core with which the open loop explains a record from rest best; its numbers are sought by their logarithms."""
    given = [(float(u), float(i), 0.0) for u, i in zip(np.asarray(voltage), np.asarray(current))]

    def core(logs: Floats) -> Core:
        return Core(*(np.array(start) * np.exp(logs)).tolist())

    def residuals(logs: Floats) -> Floats:
        fields = {f"core_{name}": value for name, value in core(logs)._asdict().items()}
        return innovations(given, known._replace(**fields))

    return core(least_squares(residuals, np.zeros(len(start)), x_scale=0.1, max_nfev=40).x)


def innovations(given: list[tuple[float, float, float]], par: ukf.Parameters) -> Floats:
    """Measured minus predicted current, but for the first sample [A]."""
    place = ukf.Outputs._fields.index("innovation")
    return np.array([outputs[place] for outputs in KERNEL.run(given, par)[1][1:]])


def of_scenario(folder: Path) -> Core:
    """Core of the plain scenario, from a run with noise of its own."""
    known = kernel_parameters(own("bounded_ukf"), load(folder).components["open_loop"].values)
    measured = run(folder, seed_shift=SEED)
    return identified(measured["sensor.voltage_measured"], measured["sensor.current_measured"], known)


if __name__ == "__main__":
    print(of_scenario(Path(sys.argv[1])))
