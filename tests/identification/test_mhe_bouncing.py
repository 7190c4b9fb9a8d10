"""`Mhe` on a mover that bounces: a magnet of 1 or 4.75 mm on stops that give way or turn it round.

The plant is a `TableActuator` with the magnetic law of `Mhe`, so that all errors come from stops.  Constants were
chosen on stops of 4 MN/m; the others here chose nothing.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pytest
from c_code import driven, run
from network_records import FINE, LONG, NOISE, SHORT, TURNS, Magnet, write

from gapsense.actuators import table_actuator
from gapsense.estimators.mhe import mhe
from gapsense.fmi.components import kernel_parameters, own
from gapsense.kernels.layout import names

DT = 50e-6
KNEE, SATURATION, CORE, EDDY, FRINGING, WINDOW = 3e5, 0.142, 4.6e6, 4.4e-3, 130.0, 10e-3
LAW = {"core_reluctance": CORE, "core_saturation": SATURATION, "core_bend": KNEE, "core_eddy": EDDY}
LAW |= {"core_hysteresis": 1e-9, "gap_fringing": FRINGING, "gap_window": WINDOW, "damping": 0.2}


def law(h: float, lam: float) -> float:
    """Static current of the model of `Mhe` [A]."""
    x = lam / SATURATION
    gap = SHORT.set["gap.slope"] * h / (1.0 + FRINGING * h * np.log(WINDOW / h))
    return lam / TURNS**2 * (gap + CORE + KNEE * x * x / (1.0 - x * x))


@pytest.fixture(scope="module")
def table(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    gaps, fluxes = np.linspace(0.05e-3, 5.2e-3, 80), np.r_[0.0:0.1:15j, 0.102:0.136:30j]
    file = write(tmp_path_factory.mktemp("map") / "map.csv", gaps, fluxes, law)
    par = kernel_parameters(own("table_actuator"), {"map.file": str(file)})
    return {name: value for name, value in par._asdict().items() if name.startswith("map")}


class Operated(NamedTuple):
    """Pulses, and what `Mhe` says of them."""

    magnet: Magnet
    position: np.ndarray
    found: dict[str, np.ndarray]

    def operation(self, n: int) -> slice:
        """Samples of the n-th closing or opening, in turn from 0."""
        half, lead = round(self.magnet.half / DT), round(2e-3 / DT)
        return slice(lead + n * half, lead + (n + 1) * half)

    def until_landing(self, n: int) -> float:
        """RMS error of the position until the first landing, but for its last sample [m]."""
        at, plant = self.operation(n), self.magnet.plant
        z = self.position[at]
        last = np.flatnonzero(z <= plant.stop_lower + 1e-6 if n % 2 == 0 else z >= plant.stop_upper - 1e-6)
        landed = last[last > 40][0] - 1
        return float(np.sqrt(np.mean((self.found["position"][at] - z)[:landed] ** 2)))


def operate(magnet: Magnet, table: dict[str, Any], stops: dict[str, float], pulses: int = 5, **told: float) -> Operated:
    """`Mhe` knows the magnet, and of its stops what is told; R is 3 %, mass and spring are 3 and 2 % off."""
    plant = magnet.plant._replace(**table, **stops, core_eddy_conductance=EDDY * TURNS**2)
    half, each = round(magnet.half / FINE), round(DT / FINE)
    u = np.r_[np.zeros(200), np.tile(np.repeat([magnet.volts, 0.0], half), pulses)]
    i, z = driven(table_actuator, plant, u, FINE, "current", "position")[each // 2 :: each].T
    u, rng = u[each // 2 :: each], np.random.default_rng(5)
    rows = np.column_stack((DT * np.arange(u.size), u, i, np.zeros(u.size)))
    rows[:, 1] += 5e-3 * rng.standard_normal(u.size)
    rows[:, 2] += NOISE * rng.standard_normal(u.size)
    par = magnet.known._replace(
        **LAW, coil_resistance=10.3, mover_mass=1.03 * plant.mover_mass, spring_stiffness=0.98 * magnet.stiffness,
        noise_current=NOISE, noise_voltage=5e-3, model_error=2e-3, window_longest=60e-3, window_tail=4e-3, **told,
    )  # fmt: skip
    return Operated(magnet, z, dict(zip(names(mhe.Outputs), run(mhe, rows, par).T)))


SOFT = {"stop_law": 1.0, "stop_stiffness": 2e6, "stop_damping": 1.0}
FIRM = {"stop_law": 1.0, "stop_stiffness": 1e8, "stop_damping": 1.0}
HARD = {"stop_law": 0.0, "stop_restitution": 0.4}


@pytest.mark.parametrize("stops", [SOFT, FIRM, HARD], ids=["soft", "firm", "hard"])
def test_with_its_stops_told_a_magnet_that_bounces_is_followed(stops, table):
    """Without, no window was explained, and `health` was 0 for ever."""
    s = operate(SHORT, table, stops, **stops)
    for n in range(4, 10):
        at = s.operation(n)
        assert s.until_landing(n) < 25e-6
        assert np.all(s.found["health"][at] == 1.0) and np.all(s.found["misfit"][at] < 1.5)
    assert s.found["bounces"][s.operation(8)][-1] >= 3.0
    blind = operate(SHORT, table, stops)
    assert np.mean(blind.found["health"][blind.operation(8)]) < (0.5 if stops != HARD else 1.1)


def test_a_pressed_stop_gives_way(table):
    """At rest the magnet presses the stop, and the gap is that much smaller."""
    s = operate(SHORT, table, SOFT, **SOFT)
    held = s.operation(4).stop - 1
    deep = SHORT.plant.stop_lower - s.position[held]
    assert deep > 10e-6
    assert SHORT.plant.stop_lower - s.found["position"][held] == pytest.approx(deep, abs=2e-6)


def test_an_operation_that_begins_while_it_still_bounces_is_told(table):
    """Nobody knows where the mover is; nothing is learnt of that, and the next rest is right again."""
    s = operate(LONG, table, SOFT | {"stop_damping": 0.3}, **SOFT | {"stop_damping": 0.3})
    for n in (2, 4):
        at = s.operation(n)
        assert abs(s.position[at][0] - LONG.plant.stop_upper) > 1e-4, "it rests"
        assert np.all(s.found["health"][at] == 0.0)
        assert abs(s.found["position"][at.stop - 1] - s.position[at.stop - 1]) < 5e-6
