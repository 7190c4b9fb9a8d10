"""The reluctance actuator against an independent model, integrated by DOP853 with events."""

from pathlib import Path

import numpy as np
import pytest
from reluctance_dop853 import Oracle

from gapsense.actuators import reluctance_actuator
from gapsense.fmi.tables import read_table
from gapsense.kernels.kernel import Kernel
from gapsense.studies.devices import RTS_VALVE

SLOW = pytest.mark.slow  # parts of what the quick ones have
TIME = 1e-7  # contact and release [s]
LEVELS = [30.0, 12.0, 20.0, 8.0, 0.0, -6.0, 3.0, 0.0, 40.0, 0.0]
STEPS = [(k * 5e-3, (k + 1) * 5e-3, u) for k, u in enumerate(LEVELS)]
FILE = Path(__file__).parents[2] / "fmus" / "reluctance_actuator" / "fringing_29.csv"
COLUMNS = read_table(FILE, ("rising:gap", "rising:reluctance", "spline:reluctance"))
TABLE = RTS_VALVE._replace(
    gap_law=1.0, gap_file_gap=COLUMNS[0], gap_file_reluctance=COLUMNS[1], gap_file_spline=COLUMNS[2]
)


@pytest.fixture(scope="module")
def actuator():
    return Kernel(reluctance_actuator)


@pytest.mark.parametrize(
    ("par", "levels"),
    [
        pytest.param(RTS_VALVE, False, id="complete", marks=SLOW),
        pytest.param(RTS_VALVE, True, id="minor loops"),
        pytest.param(TABLE, False, id="table"),
        pytest.param(RTS_VALVE._replace(friction=0.1), False, id="friction"),
        pytest.param(RTS_VALVE._replace(eddy_currents=0.0), False, id="no eddy currents", marks=SLOW),
        pytest.param(RTS_VALVE._replace(hysteresis=0.0), False, id="no hysteresis", marks=SLOW),
        pytest.param(RTS_VALVE._replace(saturation=0.0), False, id="no saturation", marks=SLOW),
    ],
)
def test_actuator_equals_dop853(actuator, square, run, par, levels):
    segments = STEPS if levels else square(20e-3, 2)
    times = np.arange(round(segments[-1][1] / 100e-6) + 1) * 100e-6
    expected, events, switches = Oracle(par).run(segments, times)
    assert len(events) >= 6
    assert switches >= (7 if levels else 3) or not par.hysteresis

    found = run(actuator, par, segments, times, step=50e-6)
    states = np.array([[s.flux, o.core_field, s.position, s.velocity] for s, o in found], dtype=float)
    errors = np.abs(states - expected).max(axis=0)
    assert errors[0] < 3e-8 * expected[:, 0].max()
    assert errors[1] < 3e-7 * expected[:, 1].max()
    assert errors[2] < 1e-9
    assert errors[3] < 1e-5

    instants = np.array([t for t, _, _ in events])
    before = [s.mode for s, _ in run(actuator, par, segments, instants - TIME, step=50e-6)]
    after = [s.mode for s, _ in run(actuator, par, segments, instants + TIME, step=50e-6)]
    assert (before, after) == ([e[1] for e in events], [e[2] for e in events])
