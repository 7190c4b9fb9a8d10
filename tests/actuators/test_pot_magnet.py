"""The pot magnet by itself: constants, energy in both orientations, properties under any voltage."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from magnets import POT_MAGNET, POT_MAGNET_PRINTED

from gapsense.actuators import pot_magnet
from gapsense.kernels.kernel import Kernel
from gapsense.kernels.layout import flat

KERNEL = Kernel(pot_magnet)
REST = pot_magnet.Inputs(0.0, 0.0, 0.0)
TINIEST = 1e-300  # J; products that are smaller have no digits
VOLTAGES = st.lists(st.one_of(st.just(0.0), st.floats(-100.0, 100.0)), min_size=1, max_size=30)
CYCLE = [24.0] * 50 + [0.0] * 50
few = settings(max_examples=40)
sets = pytest.mark.parametrize("par", [POT_MAGNET, POT_MAGNET_PRINTED], ids=["consistent", "printed"])


def drive(par, voltages, step=1e-3):
    """States and outputs at the ends of steps of the given voltages."""
    found = [KERNEL.initial(REST, par)]
    for u in voltages:
        found.append(KERNEL.step(found[-1][0], pot_magnet.Inputs(0.0, step, u), par))
    return found


def surplus(found):
    """Energy dissipated and newly stored above the supplied one [J]."""
    first, last = found[0][1], found[-1][1]
    return last.dissipated_energy + last.stored_energy - first.stored_energy - last.supplied_energy


def test_constants_are_those_of_the_notes():
    inductance = KERNEL.initial(REST, POT_MAGNET_PRINTED)[1].inductance
    assert inductance == pytest.approx(0.811, abs=5e-4)
    assert inductance / POT_MAGNET_PRINTED.coil_resistance == pytest.approx(7.09e-3, abs=5e-6)


def test_consistent_magnet_lifts_over_a_fifth_of_a_millimetre_and_not_over_half_a_millimetre():
    assert {s.mode for s, _ in drive(POT_MAGNET._replace(stop_upper=0.5e-3), [24.0] * 500)} == {0.0}
    assert drive(POT_MAGNET, [24.0] * 50)[-1][0].mode == 2.0


def test_energy_balance_closes_in_the_consistent_orientation():
    found = drive(POT_MAGNET, 2 * CYCLE)
    assert {s.mode for s, _ in found} == {0.0, 1.0, 2.0, 3.0, 4.0}
    assert abs(surplus(found)) < 1e-9 * found[-1][1].supplied_energy
    assert found[-1][1].created_energy == 0.0


def test_printed_orientation_creates_twice_the_work_of_its_force():
    found = drive(POT_MAGNET_PRINTED, CYCLE)
    assert surplus(found) == pytest.approx(0.05876, rel=1e-3)  # as the page says; supplied are 0.25 J
    assert found[-1][1].created_energy == pytest.approx(surplus(found), rel=1e-7)


def test_armature_falls_from_where_it_starts():
    found = drive(POT_MAGNET._replace(initial_position=0.1e-3), [0.0] * 40, 0.25e-3)
    landing = next(k for k, (s, _) in enumerate(found) if s.mode == 0.0) * 0.25e-3
    assert landing == pytest.approx(np.sqrt(2 * 0.1e-3 / 9.81), abs=0.25e-3)
    assert KERNEL.initial(REST, POT_MAGNET._replace(initial_position=1.0))[0][1:4] == (0.2e-3, 0.0, 3.0)
    assert KERNEL.initial(REST, POT_MAGNET._replace(initial_position=0.1e-3))[0].mode == 4.0


def test_released_armature_waits_for_the_net_force():
    """With a current i_off that still holds the weight the armature stays until the force is below it."""
    par = POT_MAGNET._replace(current_off=0.1)
    found = drive(par, [24.0] * 100 + [0.0] * 100, 0.2e-3)
    held = [(s, o) for s, o in found if s.mode == 3.0]
    assert min(o.force for _, o in held) < 1.06 * 0.34 * 9.81
    assert min(o.current for _, o in held) < 0.022


@few
@given(VOLTAGES, st.booleans())
def test_position_mode_and_losses_keep_their_bounds(voltages, is_printed):
    par = POT_MAGNET_PRINTED if is_printed else POT_MAGNET
    for (before, _), (state, outputs) in pairwise(drive(par, voltages)):
        assert 0.0 <= state.position <= par.stop_upper
        assert state.mode in (0.0, 1.0, 2.0, 3.0, 4.0)
        assert outputs.contact == (state.mode not in (1.0, 4.0))
        assert outputs.contact == 0.0 or state.velocity == 0.0
        assert outputs.contact == 0.0 or state.position == (0.0 if state.mode == 0.0 else par.stop_upper)
        assert state.dissipated_energy >= before.dissipated_energy
        assert outputs.inductance > 0.0 and outputs.force >= 0.0


@few
@given(VOLTAGES)
def test_energy_balance_closes_under_any_voltage(voltages):
    for par in (POT_MAGNET, POT_MAGNET_PRINTED):
        found = drive(par, voltages)
        outputs = found[-1][1]
        scale = abs(outputs.supplied_energy) + outputs.dissipated_energy + outputs.created_energy
        assert abs(surplus(found) - outputs.created_energy) <= 1e-6 * scale + TINIEST


@few
@given(VOLTAGES)
def test_reversed_voltage_reverses_the_flux_and_nothing_else(voltages):
    for (state, _), (mirror, _) in zip(drive(POT_MAGNET, voltages), drive(POT_MAGNET, [-u for u in voltages])):
        assert mirror == state._replace(flux_linkage=-state.flux_linkage)


@few
@given(st.floats(-60.0, 60.0), st.floats(0.1e-3, 20e-3))
def test_small_steps_compose_to_a_large_one(voltage, duration):
    large = drive(POT_MAGNET, [voltage], duration)[-1][0]
    small = drive(POT_MAGNET, [voltage] * 20, duration / 20)[-1][0]
    scale = np.array([0.1, 0.2e-3, 0.1, 1.0, 1e-2, 1e-2, 1.0, 0.5])
    assert np.abs(np.subtract(small, large) / scale).max() < 1e-6


@pytest.mark.parametrize("voltage", [1e3, -1e4, 1e6])
@sets
def test_absurd_voltage_stays_finite(par, voltage):
    for state, outputs in drive(par, [voltage] * 10 + [0.0] * 10):
        assert np.isfinite(flat(outputs)).all()
        assert 0.0 <= state.position <= par.stop_upper


@sets
def test_step_of_no_length_changes_nothing(par):
    for state, outputs in drive(par, CYCLE):
        assert KERNEL.step(state, pot_magnet.Inputs(0.0, 0.0, -5.0), par) == (state, outputs)
