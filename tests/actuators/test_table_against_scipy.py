"""The actuator from a table against an independent model, integrated by DOP853 with events."""

import numpy as np
import pytest
from table_dop853 import Oracle

from gapsense.actuators import table_actuator
from gapsense.fmi.components import kernel_parameters, own
from gapsense.kernels.kernel import Kernel

TABLE = kernel_parameters(own("table_actuator"), {})
SLOW = pytest.mark.slow  # the quick ones have every force, if not alone
ELASTIC = {"stop_law": 1.0, "stop_stiffness": 2e5, "stop_damping": 0.3}
SEGMENTS = [(0.0, 8e-3, 30.0), (8e-3, 16e-3, 0.0), (16e-3, 21e-3, -30.0), (21e-3, 26e-3, 12.0), (26e-3, 30e-3, 0.0)]


@pytest.fixture(scope="module")
def actuator():
    return Kernel(table_actuator)


@pytest.mark.parametrize(
    ("given", "fewest"),
    [
        pytest.param({}, 4, id="plain", marks=SLOW),
        pytest.param(
            {"eddy_currents": 0.0, "mover_load": 1e-3, "gravity": -9.81}, 4, id="load and gravity", marks=SLOW
        ),
        pytest.param({"stop_restitution": 0.5}, 10, id="bounces"),
        pytest.param(ELASTIC, 10, id="elastic", marks=SLOW),
        pytest.param(ELASTIC | {"friction": 0.1}, 10, id="elastic with friction"),
        pytest.param({"friction": 0.3, "stop_restitution": 0.4, "damping": 0.1}, 6, id="friction", marks=SLOW),
        pytest.param({"spring_law": 1.0, "spring_preload": -0.2}, 4, id="spring by table"),
        pytest.param({"spring_stiffness": 0.0, "friction": 0.2, "initial_position": 0.9e-3}, 2, id="held by friction"),
    ],
)
def test_actuator_equals_dop853(actuator, run, given, fewest):
    par = TABLE._replace(**given)
    times = np.arange(301) * 100e-6
    expected, events = Oracle(par).run(SEGMENTS, times)
    assert len(events) >= fewest
    found = run(actuator, par, SEGMENTS, times, step=50e-6)
    states = np.array([[par.coil_turns * s.at.flux, s.at.position, s.at.velocity] for s, _ in found], dtype=float)
    errors = np.abs(states - expected).max(axis=0)
    coarser = 30.0 if par.stop_law else 1.0  # each touch of an elastic stop is some ten micro-steps
    assert errors[0] < 2e-7 * max(1.0, 0.2 * coarser) * expected[:, 0].max()
    assert errors[1] < 5e-10 * coarser
    assert errors[2] < 4e-6 * coarser
