"""Eddy currents, hysteresis and the bend of saturation: against solutions of their equations, and in the estimators."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import pytest
from c_code import run as run_in_c
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from table_i import defaults
from test_ukf import record as ukf_record
from valve_signals import exact, valve

from gapsense.estimators import ekf, ertss, ukf
from gapsense.estimators.core_losses import advance_hysteresis, bent_reluctance, lossy
from gapsense.estimators.ekf import process_noise, tuning
from gapsense.estimators.ertss import backward
from gapsense.estimators.kalman import Gaussian, predict
from gapsense.estimators.motions import room_for
from gapsense.estimators.readings import believed_resistance
from gapsense.estimators.reduced_model import FLUX_LINKAGE, Held, after, normalise_model, transition
from gapsense.kernels.derivative import linearise
from gapsense.kernels.kernel import Kernel
from gapsense.kernels.layout import names
from gapsense.kernels.linalg import vector
from gapsense.scenarios.soft_landing.rts import smooth_record

LOSSES = {"core_eddy": 1e-3, "core_hysteresis": 10e-3, "core_turnover": 2e-3, "core_bend": 8e6}
KERNELS = {module: Kernel(module) for module in (ekf, ertss, ukf)}
numbers = st.floats(-1.0, 1.0)


class Core(NamedTuple):
    R: float = 48.0
    lam_sat: float = 25e-3
    eddy: float = 1e-3
    amplitude: float = 10e-3
    length: float = 2e-3


@given(numbers, numbers, numbers, numbers)
def test_current_closes_the_circuit(f: float, h: float, u: float, x: float) -> None:
    """i = f + h (1 + m^2) + g_e dlambda/dt, and dlambda/dt = u - R i."""
    core, u, h = Core(), 30.0 * u, 10e-3 * h
    i = lossy(f, x * core.lam_sat, Held(u, 2.0, h), core)
    assert i == pytest.approx(f + h * (1.0 + x * x) + core.eddy * (u - core.R * i), abs=1e-14)


@given(numbers, numbers, numbers)
def test_without_losses_nothing_changes_by_a_bit(f: float, h: float, u: float) -> None:
    none = Core(eddy=0.0, amplitude=0.0)
    assert lossy(f, 10e-3, Held(u, 2.0, h), none) is f
    assert advance_hysteresis(h, 10e-3, u, none) is h


@given(numbers, st.floats(-1.2, 1.2), numbers)
def test_hysteresis_is_the_solution_of_its_equation(h: float, x: float, change: float) -> None:
    core, h, change = Core(), 10e-3 * h, 4e-3 * change
    L = core.length * max(0.1, 1.0 - 0.9 * x * x)
    s = math.copysign(1.0, change)
    solved = solve_ivp(lambda _, y: (core.amplitude - s * y) / L, (0.0, change), [h], rtol=1e-10, atol=1e-14)
    assert advance_hysteresis(h, x * core.lam_sat, change, core) == pytest.approx(
        solved.y[0, -1], abs=1e-8 * core.amplitude
    )


@given(numbers, numbers, st.floats(0.0, 1.0))
def test_hysteresis_does_not_depend_on_how_a_change_is_cut(h: float, change: float, part: float) -> None:
    core, h, change = Core(lam_sat=1e9), 10e-3 * h, 4e-3 * change
    first = advance_hysteresis(h, 0.0, part * change, core)
    parts = advance_hysteresis(first, part * change, (1.0 - part) * change, core)
    assert parts == pytest.approx(advance_hysteresis(h, 0.0, change, core), abs=1e-12)
    assert abs(parts) <= core.amplitude


@pytest.mark.parametrize(("A", "n", "cycles"), [(0.5e-3, 500, 20), (3e-3, 500, 4), (20e-3, 2000, 2)])
def test_area_of_a_loop(A: float, n: int, cycles: int) -> None:
    """Between -A and A, after the first: h turns at +-I_h tanh(A/L), and loses 4 I_h (A - L tanh(A/L)) per cycle."""
    core = Core(lam_sat=1e9)
    up = np.linspace(-A, A, n + 1)
    lam = np.concatenate([*[up, up[-2:0:-1]] * cycles, up[:1]])
    h = [0.0]
    for a, b in zip(lam, lam[1:]):
        h.append(advance_hysteresis(h[-1], a, b - a, core))
    last = slice(-2 * n - 1, None)
    rest = core.length * math.tanh(A / core.length)
    assert max(h[last]) == pytest.approx(core.amplitude * rest / core.length, rel=1e-6)
    assert np.trapezoid(h[last], lam[last]) == pytest.approx(4.0 * core.amplitude * (A - rest), rel=1e-4)


@pytest.mark.parametrize("x", [0.0, 0.3, 0.9, 0.9499, 0.9501, 1.3])
def test_bend_is_smooth_and_has_its_derivative(x: float) -> None:
    found, rate = bent_reluctance(x, 1.5e6, 8e6)
    low, high = (bent_reluctance(x + d, 1.5e6, 8e6)[0] for d in (-1e-6, 1e-6))
    assert rate == pytest.approx((high - low) / 2e-6, rel=1e-6, abs=10.0)
    if x < 0.95:
        assert found == pytest.approx(1.5e6 + 8e6 * x**2 / (1.0 - x**2), rel=1e-12)


# In the estimators ----------------------------------------------------------------------------------------------------


def signals(module: Any, resistance: float) -> list[tuple[float, ...]]:
    """Inputs with 20 mA of noise, which no filter forgets at once."""
    if module is ukf:
        v, truth = ukf_record()
        i = truth["current"] + 20e-3 * np.sin(np.arange(v.size))
        return [(float(a), float(b), resistance) for a, b in zip(v, i)]
    s = valve()
    i = s.current + 20e-3 * np.sin(np.arange(s.time.size))
    rows = zip(s.time, s.voltage, i, s.mode)
    return [(*map(float, row[module is ekf :]), resistance) for row in rows]


def parameters(module: Any, **changes: float) -> Any:
    """Those of the models under test; every sample in motion is a motion."""
    if module is ertss:
        return ertss.Parameters(exact(**changes), contact_debounce=0.0)
    return defaults(ukf, **changes) if module is ukf else exact(**changes)


def outputs(module: Any, resistance: float, **changes: float) -> np.ndarray:
    """Outputs of all samples; at the first one the estimate is that of the prior."""
    return run_in_c(module, signals(module, resistance), parameters(module, **changes))


@pytest.mark.parametrize("module", KERNELS, ids=lambda m: m.__name__)
@pytest.mark.parametrize("losses", [{}, LOSSES], ids=["paper", "losses"])
def test_wired_resistance_is_the_parameter_bit_for_bit(module: Any, losses: dict[str, float]) -> None:
    R = 79.0
    by_parameter = outputs(module, 0.0, coil_resistance=R, **losses)
    by_input = outputs(module, R, coil_resistance=2.0 * R, **losses)
    assert by_parameter.tobytes() == by_input.tobytes()
    assert by_parameter.tobytes() != outputs(module, 1.01 * R, coil_resistance=R, **losses).tobytes()


@pytest.mark.parametrize("value", [0.0, -0.0, -48.0, math.nan, math.inf, -math.inf])
def test_parameter_counts_where_the_input_is_no_resistance(value: float) -> None:
    assert believed_resistance(value, 50.0) == 50.0
    assert believed_resistance(48.0, 50.0) == 48.0


@pytest.mark.parametrize("module", KERNELS, ids=lambda m: m.__name__)
def test_losses_at_zero_are_the_paper_whatever_the_turnover(module: Any) -> None:
    assert outputs(module, 0.0).tobytes() == outputs(module, 0.0, core_turnover=0.3e-3).tobytes()
    for name, value in LOSSES.items():
        if name != "core_turnover":
            assert outputs(module, 0.0).tobytes() != outputs(module, 0.0, **{name: value}).tobytes()


@pytest.mark.parametrize("noise", [ukf.Noise.additive, ukf.Noise.augmented])
def test_all_filters_carry_the_same_hysteresis_where_nothing_is_uncertain(noise: float) -> None:
    """Without noise the unscented filters are the open loop, and so is what they add to the current."""
    still = {"option_tuning": ukf.Tuned.own, "option_current_error": 0.0, "process_flux_linkage": 0.0}
    still |= {"process_position": 0.0, "noise_voltage": 0.0, **LOSSES}
    loop = outputs(ukf, 0.0, option_filter=ukf.Filter.open_loop, **still)
    np.testing.assert_allclose(
        outputs(ukf, 0.0, option_noise=noise, **still)[:, :3], loop[:, :3], rtol=1e-9, atol=1e-12
    )


def test_hysteresis_follows_the_model_and_not_its_corrections() -> None:
    par = exact(**LOSSES)
    m, x = normalise_model(par), vector([1.0, 1.0, 5e-3, 0.0, 0.0])
    state, _ = ekf.initial(ekf.Inputs(30.0, 0.0, 3.0), par)
    state = state._replace(x=x, P=np.diag([0.0, 0.0, 1e-8, 1e-6, 0.0]).astype(object), hysteresis=-4e-3)
    held = Held(30.0, 3.0, -4e-3)
    expected = after(held, x[FLUX_LINKAGE], linearise(transition, x, held, m)[0][FLUX_LINKAGE], m).hysteresis
    for measured in (-1.0, 0.1, 1.0):
        assert ekf.step(state, ekf.Inputs(30.0, measured, 3.0), par)[0].hysteresis == expected


def test_smoother_repeats_the_prediction_of_the_filter() -> None:
    """What the next sample is predicted to be teaches nothing, to the last bit."""
    par = exact(**LOSSES)
    m, held = normalise_model(par)._replace(R=81.0), Held(12.0, 2.0, 3e-3)
    x, P = vector([0.4, 0.42, 18e-3, 1e-3, -1e-4]), np.diag([1e-4, 1e-4, 1e-8, 1e-6, 1e-10]).astype(object)
    ahead, F = linearise(transition, x, held, m)
    later = Gaussian(ahead, predict(P, F, process_noise(m, tuning(par))))
    assert backward(Gaussian(x, P), held, later, m, tuning(par)).mean.tolist() == x.tolist()
    other = backward(Gaussian(x, P), held._replace(hysteresis=0.0), later, m, tuning(par))
    assert other.mean.tolist() != x.tolist()


def test_smoother_keeps_resistance_and_hysteresis_of_every_sample() -> None:
    par, given_ = parameters(ertss, **LOSSES), signals(ertss, 0.0)
    state, _ = KERNELS[ertss].initial(ertss.Inputs(*given_[0]), par)
    kept = {}
    for k, inputs in enumerate(given_[1:400]):
        R = 76.0 + 0.01 * k
        state, _ = KERNELS[ertss].step(state, ertss.Inputs(*inputs[:-1], R), par)
        if inputs[3] == 2.0:
            place = state.motion.place + state.motion.count - 1.0
            kept[place] = (state.filter.voltage, R, state.filter.hysteresis)
    assert len(kept) > 50
    for place, values in kept.items():
        assert ertss._load(state.samples, place, room_for(par.motion_memory))[1:] == values


def test_smoother_of_records_and_component_agree_with_losses() -> None:
    """As `test_rts` has it without."""
    s = valve()
    found = dict(zip(names(ertss.Outputs), outputs(ertss, 0.0, **LOSSES).T))
    i = s.current + 20e-3 * np.sin(np.arange(s.time.size))
    p = smooth_record(s.voltage, i, s.mode, exact(**LOSSES))
    np.testing.assert_array_equal(found["position"], p.filtered.position)
    shown = np.flatnonzero(found["smoothed_published"] == 1.0)
    about = np.rint(found["smoothed_time"][shown] / exact().sample_time).astype(int)
    assert len(shown) > 50
    np.testing.assert_allclose(found["smoothed_flux_linkage"][shown], p.smoothed.flux_linkage[about], rtol=1e-9)
