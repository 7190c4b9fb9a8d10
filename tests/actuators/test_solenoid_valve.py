"""The valve by itself: energy, order through an impact, properties under any voltage, one source for all code."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from relay import RELAY

from gapsense.actuators import solenoid_valve as valve
from gapsense.kernels.kernel import Kernel
from gapsense.kernels.lanes import step_runs
from gapsense.kernels.layout import flat
from gapsense.studies.devices import VALVE

REST = valve.Inputs(0.0, 0.0, 0.0)
VOLTAGES = st.lists(st.floats(-100.0, 100.0), min_size=1, max_size=30)
STEP = 0.25e-3
few = settings(max_examples=40)
laws = pytest.mark.parametrize("law", [0.0, 1.0, 2.0], ids=["linear", "fringing", "table"])


def drive(kernel, par, voltages, step=STEP):
    """States and outputs at the ends of steps of the given voltages."""
    found = [kernel.initial(REST, par)]
    for u in voltages:
        found.append(kernel.step(found[-1][0], valve.Inputs(0.0, step, u), par))
    return found


def imbalance(found):
    """Supplied minus dissipated minus newly stored energy, over the supplied one."""
    first, last = found[0][1], found[-1][1]
    stored = last.stored_energy - first.stored_energy
    return abs(last.supplied_energy - last.dissipated_energy - stored) / last.supplied_energy


def test_inductance_at_rest_is_that_of_table_i(kernel):
    assert kernel.initial(REST, VALVE)[1].inductance == pytest.approx(52.27e-3, rel=1e-4)
    assert kernel.initial(REST, RELAY)[1].inductance == pytest.approx(1.0, rel=0.05)


def test_valve_rests_open_and_starts_inside_its_stops(kernel):
    assert kernel.initial(REST, VALVE)[0] == (0.0, 0.9e-3, 0.0, 3.0, 0.0, 0.0, 0.0)
    assert kernel.initial(REST, VALVE._replace(initial_position=1.0))[0].position == 0.9e-3
    assert kernel.initial(REST, VALVE._replace(initial_position=0.0))[0].mode == 2.0  # the spring pulls it off the stop


def test_relay_closes_at_30_volts_and_opens_at_0_volts(kernel):
    modes = [s.mode for s, _ in drive(kernel, RELAY, [*[30.0] * 100, *[0.0] * 100])]
    assert modes[4] == 2.0 and modes[100] == 1.0 and modes[-1] == 3.0
    assert 6e-3 < modes.index(1.0) * STEP < 8e-3  # pull-in
    assert 5e-3 < (modes.index(3.0, 100) - 100) * STEP < 6e-3  # drop-out


# The slope of the fringing law is steep at the closed gap.  The two columns of a table are interpolated each by itself:
# its force is not quite the derivative of its energy.
@pytest.mark.parametrize(
    ("law", "tolerance"), [(0.0, 1e-9), (1.0, 1e-8), (2.0, 1e-4)], ids=["linear", "fringing", "table"]
)
def test_energy_balance_closes_through_impacts(kernel, law, tolerance):
    found = drive(kernel, VALVE._replace(gap_law=law), 2 * ([30.0] * 40 + [0.0] * 40))
    assert {s.mode for s, _ in found} == {1.0, 2.0, 3.0}
    assert imbalance(found) < tolerance


def test_order_is_four_through_release_and_impact(monkeypatch, square, run):
    monkeypatch.setattr(valve, "FINENESS", 1e9)  # or the steps of the saturated coil would not be halved
    fixed, times = Kernel(valve), np.array([1.0e-3, 2.5e-3, 4e-3, 12.5e-3, 14e-3, 15.5e-3])

    def states(micro_step):
        found = run(fixed, VALVE._replace(micro_step=micro_step), square(20e-3, 1), times)
        return np.array([state[:3] for state, _ in found]) / [0.024, 0.9e-3, 0.5]

    exact = states(0.78125e-6)
    errors = [np.abs(states(h) - exact).max() for h in (12.5e-6, 6.25e-6, 3.125e-6)]
    assert np.log2(np.divide(errors[:-1], errors[1:])) == pytest.approx(4.0, abs=0.2)


@few
@given(VOLTAGES, st.sampled_from([0.0, 1.0, 2.0]))
def test_position_mode_and_losses_keep_their_bounds(kernel, voltages, law):
    found = drive(kernel, VALVE._replace(gap_law=law), voltages)
    for (before, _), (state, outputs) in pairwise(found):
        assert 0.0 <= state.position <= 0.9e-3
        assert state.mode in (1.0, 2.0, 3.0)
        assert outputs.contact == (state.mode != 2.0)
        assert state.mode == 2.0 or state.velocity == 0.0
        assert state.dissipated_energy >= before.dissipated_energy
        assert outputs.inductance > 0.0 >= outputs.force


@few
@given(VOLTAGES)
def test_reversed_voltage_reverses_the_flux_and_nothing_else(kernel, voltages):
    for (state, _), (mirror, _) in zip(drive(kernel, VALVE, voltages), drive(kernel, VALVE, [-u for u in voltages])):
        assert mirror == state._replace(flux_linkage=-state.flux_linkage)


@few
@given(st.floats(-60.0, 60.0), st.floats(0.1e-3, 6e-3))
def test_small_steps_compose_to_a_large_one(kernel, voltage, duration):
    large = drive(kernel, VALVE, [voltage], duration)[-1][0]
    small = drive(kernel, VALVE, [voltage] * 40, duration / 40)[-1][0]
    scale = np.array([0.024, 0.9e-3, 0.5, 1.0, 1e-3, 1e-3, 0.5])
    assert np.abs(np.subtract(small, large) / scale).max() < 1e-7


def test_micro_steps_of_a_settled_flux_are_those_of_single_steps(kernel):
    long, short = 2.0**-12, 2.0**-17  # one and 32 micro-steps: sums of them are exact
    par = VALVE._replace(micro_step=short)
    settled, _ = drive(kernel, par, [5.0] * 200, long)[-1]
    at_once, _ = kernel.step(settled, valve.Inputs(0.0, long, 5.0), par)
    one_by_one = settled
    for _ in range(32):
        one_by_one, _ = kernel.step(one_by_one, valve.Inputs(0.0, short, 5.0), par)
    assert at_once.flux_linkage == settled.flux_linkage
    assert at_once[:5] == one_by_one[:5]
    assert at_once.dissipated_energy > settled.dissipated_energy


@pytest.mark.parametrize("voltage", [1e3, -1e4, 1e6])
def test_absurd_voltage_stays_finite(kernel, voltage):
    for state, outputs in drive(kernel, VALVE, [voltage] * 10):
        assert np.isfinite(flat(outputs)).all()
        assert 0.0 <= state.position <= 0.9e-3


def test_overvoltage_settles_at_the_current_of_the_resistance(kernel):
    assert drive(kernel, VALVE, [300.0] * 20)[-1][1].current == pytest.approx(300.0 / 76.0, rel=1e-9)


@laws
def test_step_of_no_length_changes_nothing(kernel, law):
    par = VALVE._replace(gap_law=law)
    for state, outputs in drive(kernel, par, [30.0] * 12, 0.2e-3):
        assert kernel.step(state, valve.Inputs(0.0, 0.0, -5.0), par) == (state, outputs)


@laws
def test_source_and_generated_code_give_the_same_bits(kernel, law):
    par = VALVE._replace(gap_law=law)
    state, _ = valve.initial(REST, par)
    for k in range(160):
        inputs = valve.Inputs(0.0, 0.125e-3, 30.0 if k < 80 else 0.0)
        source, generated = valve.step(state, inputs, par), kernel.step(state, inputs, par)
        assert source == generated
        state = source[0]
    assert state.mode == 3.0


@pytest.mark.parametrize("law", [0.0, 2.0], ids=["linear", "table"])
def test_many_runs_at_once_equal_single_runs(kernel, law):
    par = VALVE._replace(gap_law=law, micro_step=50e-6)
    high = np.array([24.0, 20.0, 5.0, -22.0])
    inputs = [[np.zeros(4), np.full(4, 0.5e-3 if k else 0.0), high if 0 < k < 8 else np.zeros(4)] for k in range(19)]
    found = step_runs(kernel, np.array(inputs), flat(par))
    modes = set()
    for run in range(4):
        state, outputs = kernel.initial(REST, par)
        for k, sample in enumerate(found):
            if k:
                state, outputs = kernel.step(state, valve.Inputs(*(float(x[run]) for x in inputs[k])), par)
            assert sample[:, run].tolist() == flat(outputs)
            modes.add(state.mode)
    assert modes == {1.0, 2.0, 3.0}


def test_huge_step_ends_at_the_largest_number_of_micro_steps(kernel, monkeypatch):
    monkeypatch.setattr(valve, "MICRO_STEPS", 1000)
    few = Kernel(valve)
    settled, _ = drive(few, VALVE, [5.0] * 200, 1e-3)[-1]
    state, outputs = few.step(settled, valve.Inputs(0.0, 1e9, 5.0), VALVE)
    part = state.dissipated_energy - settled.dissipated_energy
    assert part == pytest.approx(1000 * VALVE.micro_step * 25.0 / VALVE.coil_resistance, rel=1e-2)
    assert np.isfinite(outputs).all()
