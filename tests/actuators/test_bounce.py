"""Movers that bounce: against the closed form of a ball, energy, and what is reported of impacts, in every plant."""

import numpy as np
import pytest
from c_code import run
from hypothesis import given, settings
from hypothesis import strategies as st

from gapsense.actuators import motion, play_actuator, pot_magnet, reluctance_actuator, solenoid_valve, table_actuator
from gapsense.fmi.components import kernel_parameters, own
from gapsense.kernels.kernel import Kernel

PLANTS = {
    "solenoid_valve": (solenoid_valve, 30.0, 20e-3),
    "reluctance_actuator": (reluctance_actuator, 30.0, 20e-3),
    "play_actuator": (play_actuator, 30.0, 20e-3),
    "table_actuator": (table_actuator, 30.0, 20e-3),
    "pot_magnet": (pot_magnet, 12.0, 120e-3),
}
STEP = 50e-6
plants = pytest.mark.parametrize("name", PLANTS)
few = settings(max_examples=8)


def operation(name, restitution, step=STEP, high=None, share=1.0):
    """Outputs of one operation, or a share of it: the voltage on, then off."""
    module, voltage, period = PLANTS[name]
    par = kernel_parameters(own(name), {"stop.restitution": restitution})
    times = step * np.arange(round(share * period / step))
    volts = np.where(times < 0.5 * period, voltage if high is None else high, 0.0)
    rows = np.vstack([np.zeros(3), np.c_[times, np.full(times.size, step), volts]])
    return [module.Outputs(*row) for row in run(module, rows, par).tolist()]


def impacts(found):
    """Positions of the samples at which a harder impact is reported than before."""
    speeds = np.array([o.impact_speed for o in found])
    return np.flatnonzero(np.diff(speeds) > 0.0)


@plants
def test_without_restitution_the_mover_stays_and_its_impact_is_that_of_a_bouncing_one(name):
    dead, alive = operation(name, 0.0), operation(name, 0.5)
    k = impacts(dead)[0]
    assert dead[k + 1].contact == 1.0 and dead[k + 1].velocity == 0.0
    assert alive[k + 1].impact_speed == dead[k + 1].impact_speed > 0.05
    assert [o.position for o in dead[: k + 1]] == [o.position for o in alive[: k + 1]]
    rises = [abs(o.position - dead[k + 1].position) for o in alive[k + 1 : k + 40]]
    assert max(rises) > 1e-6
    assert alive[len(alive) // 2].contact == 1.0  # it rests in the end
    assert dead[-1].contact == alive[-1].contact == 1.0


@plants
def test_speed_after_an_impact_is_its_part_of_that_before(name):
    fine = operation(name, 0.5, 2e-6, share=0.25)
    k = impacts(fine)[0]
    assert abs(fine[k + 1].velocity) == pytest.approx(0.5 * fine[k + 1].impact_speed, rel=0.05)


@plants
@few
@given(restitution=st.floats(0.0, 0.95), scale=st.floats(0.5, 1.5))
def test_position_keeps_the_stops_and_the_energy_balance_closes(name, restitution, scale):
    found = operation(name, restitution, high=scale * PLANTS[name][1])
    par = kernel_parameters(own(name), {})
    lower = getattr(par, "stop_lower", 0.0)
    assert all(lower <= o.position <= par.stop_upper for o in found)
    if "supplied_energy" in found[0]._fields:
        first, last = found[0], found[-1]
        stored = last.stored_energy - first.stored_energy
        assert abs(last.supplied_energy - last.dissipated_energy - stored) < 2e-6 * last.supplied_energy


@few
@given(st.floats(0.1, 0.9))
def test_valve_without_flux_bounces_like_a_ball(restitution):
    """Under its spring alone, almost constant over the stroke: flights last 2 v / a, and heights fall with e^2."""
    force = 37.0 * 22.5e-3
    par = kernel_parameters(
        own("solenoid_valve"),
        {
            "stop.restitution": restitution,
            "initial.position": 0.8e-3,
            "damping": 0.0,
            "spring.stiffness": 37.0 * 1e-3,
            "spring.rest": 22.5,
        },
    )
    kernel, a = Kernel(solenoid_valve), force / 1.6e-3
    state, outputs = kernel.initial(solenoid_valve.Inputs(0.0, 0.0, 0.0), par)
    v = np.sqrt(2.0 * a * 0.1e-3)
    landing, end = v / a, v / a + 2.0 * restitution * v / a / (1.0 - restitution)
    found = []
    for _ in range(round(1.2 * end / 10e-6)):
        state, outputs = kernel.step(state, solenoid_valve.Inputs(0.0, 10e-6, 0.0), par)
        found.append(outputs)
    times = (np.arange(len(found)) + 1) * 10e-6
    position = np.array([o.position for o in found])
    after = times > landing + 10e-6
    assert found[-1].impact_speed == pytest.approx(v, rel=1e-4)
    assert 0.9e-3 - position[after].min() <= restitution**2 * 0.1e-3 * 1.001
    rest = np.flatnonzero([o.contact == 1.0 for o in found])[0]
    assert times[rest] == pytest.approx(end, abs=2.0 * 1e-3 / a / (1.0 - restitution) + 20e-6)


@few
@given(st.floats(-2.0, 2.0), st.floats(0.0, 0.95))
def test_rebound_is_reversed_and_no_faster(v, restitution):
    after = motion.rebound(v, restitution)
    assert after * v <= 0.0 and abs(after) <= restitution * abs(v)
    assert after == 0.0 or abs(after) >= motion.SLOWEST
