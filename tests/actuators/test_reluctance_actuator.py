"""The reluctance actuator by itself: energy, order through switches, loops of the core, options, one source for all."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from gapsense.actuators import hysteresis, solenoid_valve
from gapsense.actuators import reluctance_actuator as actuator
from gapsense.actuators.magnetics import MU_0
from gapsense.kernels.kernel import Kernel
from gapsense.kernels.layout import flat
from gapsense.studies.devices import RTS_VALVE, VALVE

STEP = 0.1e-3
VOLTAGES = st.lists(st.floats(-60.0, 60.0), min_size=1, max_size=30)
LOCKED = RTS_VALVE._replace(spring_rest=100.0)  # the spring holds it open
ANHYSTERETIC = RTS_VALVE._replace(hysteresis=0.0)
LINEAR = ANHYSTERETIC._replace(saturation=0.0, eddy_currents=0.0)
VOLUME = RTS_VALVE.core_area * RTS_VALVE.core_length
few = settings(max_examples=30)


@pytest.fixture(scope="module")
def kernel():
    return Kernel(actuator)


def drive(kernel, par, voltages, step=STEP, state=None):
    """States and outputs at the ends of steps of the given voltages."""
    inputs = kernel.module.Inputs
    found = [kernel.initial(inputs(0.0, 0.0, 0.0), par)]
    if state is not None:
        found = [kernel.step(state, inputs(0.0, 0.0, 0.0), par)]
    for u in voltages:
        found.append(kernel.step(found[-1][0], inputs(0.0, step, u), par))
    return found


def imbalance(found):
    """Supplied minus dissipated minus newly stored energy, over the supplied one."""
    first, last = found[0][1], found[-1][1]
    supplied, dissipated = (
        getattr(last, key) - getattr(first, key) for key in ("supplied_energy", "dissipated_energy")
    )
    return abs(supplied - dissipated - last.stored_energy + first.stored_energy) / supplied


def sine(amplitude, periods, count=400):
    return (amplitude * np.sin(2 * np.pi * (np.arange(periods * count) + 0.5) / count)).tolist()


def test_langevin_function_and_its_relatives():
    for a in (-30.0, -1.3, -0.11, -0.09, 1e-3, 0.05, 0.0999, 0.1001, 0.7, 5.0, 80.0):
        work, _ = quad(
            lambda x: hysteresis.langevin(x)[0], 0.0, a, points=[np.copysign(0.1, a)] if abs(a) > 0.1 else None
        )
        assert hysteresis.langevin_integral(a) == pytest.approx(work, rel=1e-10)
        d = 1e-4 * abs(a)
        slope = (hysteresis.langevin(a + d)[0] - hysteresis.langevin(a - d)[0]) / (2 * d)
        assert hysteresis.langevin(a)[1] == pytest.approx(slope, rel=1e-6)
        assert hysteresis.inverse_langevin(hysteresis.langevin(a)[0]) == pytest.approx(a, rel=1e-4)


def test_series_and_closed_form_meet():
    below, above = (hysteresis.langevin(hysteresis.SMALL * (1 + d)) for d in (-1e-12, 1e-12))
    assert below == pytest.approx(above, rel=3e-12)


@pytest.mark.parametrize(
    "par",
    [RTS_VALVE, RTS_VALVE._replace(friction=0.1), ANHYSTERETIC, LINEAR],
    ids=["complete", "friction", "anhysteretic", "linear"],
)
def test_energy_balance_closes_through_impacts(kernel, par):
    found = drive(kernel, par, 2 * ([30.0] * 100 + [0.0] * 100))
    assert {s.mode for s, _ in found} == {1.0, 2.0, 3.0}
    assert imbalance(found) < 2e-9


def test_friction_holds_a_mover_that_the_force_does_not_overcome(kernel):
    """The spring holds it open with 1.10 N: 18 V close it, but not against 0.1 N more."""
    without, held = (drive(kernel, RTS_VALVE._replace(friction=f), [18.0] * 800) for f in (0.0, 0.1))
    assert {s.mode for s, _ in without} == {1.0, 2.0, 3.0}
    assert {s.mode for s, _ in held} == {3.0} and 1.1 < -held[-1][1].force < 1.2


@few
@given(VOLTAGES)
def test_losses_never_fall_and_bounds_are_kept(kernel, voltages):
    for (_, before), (state, outputs) in pairwise(drive(kernel, RTS_VALVE, voltages)):
        for name in ("dissipated_energy", "eddy_energy", "hysteresis_energy"):
            assert getattr(outputs, name) >= getattr(before, name) - 1e-11
        assert 0.4e-3 <= state.position <= 1.4e-3
        assert state.mode == 2.0 or state.velocity == 0.0
        assert outputs.stored_energy >= 0.0 >= outputs.force
        assert np.isfinite(flat(outputs)).all()


def loop_area(found):
    H, B = np.array([[o.core_field, o.flux_density] for _, o in found]).T
    return np.sum((H[1:] + H[:-1]) / 2 * np.diff(B))


@pytest.mark.parametrize("amplitude", [5.0, 30.0])
def test_hysteresis_loss_is_the_area_of_the_closed_loop(kernel, amplitude):
    settled = drive(kernel, LOCKED, sine(amplitude, 6, 800), 25e-6)[-1][0]
    cycle = drive(kernel, LOCKED, sine(amplitude, 1, 8000), 2.5e-6, settled)
    loss = cycle[-1][1].hysteresis_energy - cycle[0][1].hysteresis_energy
    assert loss > 0.0
    assert loop_area(cycle) * VOLUME == pytest.approx(loss, rel=1e-5)
    assert imbalance(cycle) < 1e-6


def test_core_keeps_a_remanence(kernel):
    state, outputs = drive(kernel, RTS_VALVE, [30.0] * 100 + [0.0] * 600)[-1]
    assert abs(outputs.current) < 1e-6
    assert outputs.flux_density > 0.02
    assert outputs.core_field < -100.0
    assert drive(kernel, ANHYSTERETIC, [30.0] * 100 + [0.0] * 600)[-1][1].flux_density < 1e-6
    assert state.mode == 3.0


def test_minor_loops_close_after_some_cycles(kernel):
    """The drift from cycle to cycle, as the model has it, dies out."""
    found = drive(kernel, LOCKED, [15.0 + u for u in sine(3.0, 60)], 25e-6)
    ends = np.array([o.flux_density for _, o in found[::400]])
    drift = np.abs(np.diff(ends))
    assert drift[-1] < 1e-6 < drift[2]
    assert loop_area(found[-401:]) > 0.0


def test_order_is_four_through_all_switches(monkeypatch, run):
    monkeypatch.setattr(actuator, "FLUX_FINENESS", 1e9)  # or the steps of the saturated core would not be halved
    monkeypatch.setattr(actuator, "FIELD_FINENESS", 1e9)
    fixed, times = Kernel(actuator), np.array([0.9e-3, 2e-3, 2.5e-3, 4e-3, 6e-3, 9e-3])
    segments = [(0.0, 2.2e-3, 20.0), (2.2e-3, 3e-3, 0.0), (3e-3, 9e-3, 12.0)]

    def states(micro_step):
        found = run(fixed, RTS_VALVE._replace(micro_step=micro_step), segments, times, 50e-6)
        return np.array([state[:4] for state, _ in found]) / [2e-5, 1e3, 1e-3, 0.5]

    exact = states(0.625e-6)
    errors = [np.abs(states(h) - exact).max() for h in (10e-6, 5e-6, 2.5e-6)]
    assert np.log2(np.divide(errors[:-1], errors[1:])) == pytest.approx(4.0, abs=0.5)


def test_linear_core_is_that_of_the_solenoid_valve(kernel):
    """Without eddy currents, hysteresis and saturation the core is a constant reluctance."""
    p, chi = RTS_VALVE, RTS_VALVE.core_magnetization / (3 * RTS_VALVE.core_shape)
    mu = MU_0 * (1 + (1 - p.core_coupling) * chi) / (1 - p.core_coupling * chi)
    area = 1 / p.gap_fringing**2
    simple = VALVE._replace(
        coil_resistance=p.coil_resistance, coil_turns=p.coil_turns, gap_law=1.0, gap_area=area,
        gap_window=p.gap_window / 2, core_reluctance=p.core_length / (p.core_area * mu), core_saturation=1e9,
        mover_mass=p.mover_mass, spring_stiffness=p.spring_stiffness, spring_rest=p.spring_rest, damping=p.damping,
        stop_lower=p.stop_lower, stop_upper=p.stop_upper, initial_position=p.initial_position, micro_step=10e-6,
    )  # fmt: skip
    linear = LINEAR._replace(gap_slope=1 / (MU_0 * area))
    voltages = [10.0] * 60 + [0.0] * 60
    for (_, a), (_, b) in zip(drive(kernel, linear, voltages), drive(Kernel(solenoid_valve), simple, voltages)):
        # the valve's formula for the stored energy loses its digits in a core that does not saturate
        for name in set(a._fields) & set(b._fields) - {"stored_energy"}:
            assert getattr(a, name) == pytest.approx(getattr(b, name), rel=1e-7, abs=1e-9), name


def test_options_equal_their_limits(kernel):
    voltages = [30.0] * 60 + [0.0] * 60
    without = drive(kernel, RTS_VALVE._replace(eddy_currents=0.0), voltages)
    assert without == drive(kernel, RTS_VALVE._replace(core_eddy_conductance=0.0), voltages)
    assert without[-1][1].eddy_energy == 0.0
    off = drive(kernel, ANHYSTERETIC, voltages)
    on = drive(kernel, RTS_VALVE._replace(core_reversibility=0.999), voltages)
    assert off[-1][1].hysteresis_energy == 0.0
    assert np.array([o.current for _, o in on]) == pytest.approx([o.current for _, o in off], abs=2e-3)


def test_anhysteretic_core_stays_on_its_curve(kernel):
    core = actuator.make_actuator(actuator.Inputs(0.0, 0.0, 0.0), ANHYSTERETIC).core
    for state, _ in drive(kernel, ANHYSTERETIC, sine(40.0, 2)):
        M_an, _ = hysteresis.anhysteretic(state.effective_field, core)
        assert hysteresis.magnetization(state.flux, state.effective_field, core) == pytest.approx(M_an, abs=1e-3)


@few
@given(VOLTAGES)
def test_reversed_voltage_reverses_the_core_and_nothing_else(kernel, voltages):
    mirrored = drive(kernel, RTS_VALVE, [-u for u in voltages])
    for (state, _), (mirror, _) in zip(drive(kernel, RTS_VALVE, voltages), mirrored):
        expected = state._replace(flux=-state.flux, effective_field=-state.effective_field)
        assert mirror == pytest.approx(expected, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("voltage", [1e3, -1e4, 1e6])
def test_absurd_voltage_stays_finite(kernel, voltage):
    for state, outputs in drive(kernel, RTS_VALVE, [voltage] * 5 + [-voltage] * 5):
        assert np.isfinite(flat(outputs)).all()
        assert 0.4e-3 <= state.position <= 1.4e-3


def test_step_of_no_length_changes_no_state(kernel):
    for state, _ in drive(kernel, RTS_VALVE, [30.0] * 30):
        assert kernel.step(state, actuator.Inputs(0.0, 0.0, -5.0), RTS_VALVE)[0] == state


def test_settled_coil_costs_no_more_than_a_moving_one(kernel):
    """Rounding errors turn round the flux of a settled coil all the time; nobody looks for these instants."""
    settled = drive(kernel, RTS_VALVE, [12.0], 0.1)[-1][0]
    after = drive(kernel, RTS_VALVE, [12.0], 0.1, settled)[-1][0]
    assert after.flux == pytest.approx(settled.flux, rel=1e-12)
