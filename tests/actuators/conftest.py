"""Square-wave runs of the generated scalar code of the valve; helpers and oracles can be imported."""

import sys
from pathlib import Path

import numpy as np
import pytest

from gapsense.actuators import solenoid_valve
from gapsense.kernels.kernel import Kernel

sys.path[:0] = [str(Path(__file__).parent), *(str(Path(__file__).parents[1] / name) for name in ("oracles", "kernels"))]


def square_wave(period, cycles, high=30.0):
    """Segments (start, end, voltage), half a period each."""
    return [(k * period / 2, (k + 1) * period / 2, high * (1 - k % 2)) for k in range(2 * cycles)]


def run_segments(kernel, par, segments, times, step=25e-6):
    """States and outputs at `times`; communication points are these, the multiples of `step` and the edges."""
    end = segments[-1][1]
    points = np.unique([*(np.arange(round(end / step) + 1) * step), *times, *(s[1] for s in segments)])
    points = points[np.concatenate([[True], np.diff(points) > 1e-13])]
    state, outputs = kernel.initial(kernel.module.Inputs(0.0, 0.0, 0.0), par)
    found = [(state, outputs)]
    for start, stop in zip(points[:-1].tolist(), points[1:].tolist()):
        voltage = next(u for a, b, u in segments if a < 0.5 * (start + stop) < b)
        state, outputs = kernel.step(state, kernel.module.Inputs(stop, stop - start, voltage), par)
        found.append((state, outputs))
    return [found[np.argmin(np.abs(points - t))] for t in times]


@pytest.fixture(scope="session")
def square():
    return square_wave


@pytest.fixture(scope="session")
def run():
    return run_segments


@pytest.fixture(scope="session")
def kernel():
    return Kernel(solenoid_valve)
