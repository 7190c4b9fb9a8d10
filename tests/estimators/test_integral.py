"""The integral estimator against the textbook, online and offline."""

from __future__ import annotations

import integral_textbook
import numpy as np
import pytest
from c_code import run as run_in_c
from signals import DT, REST, Signal, valve_like

from gapsense.estimators import integral
from gapsense.estimators.readings import LOST, UNLEARNT
from gapsense.kernels.kernel import Kernel

KERNEL = Kernel(integral)
PAR = integral.Parameters(
    sample_time=DT, prior_resistance=77.5, prior_inductance=50e-3, prior_flux_linkage=0.0, noise_current=1e-3,
    noise_voltage=15e-3, gate_sigmas=3.29, edge_voltage=15.0, offline=0.0,
    range_voltage=100.0, range_current=0.0,
)  # fmt: skip
ORACLE = (DT, 77.5, 50e-3, 0.0, 3.29e-3, 15.0)


def run(u: np.ndarray, iota: np.ndarray, par: integral.Parameters = PAR) -> dict[str, np.ndarray]:
    """Outputs of the samples from 1 on, by name."""
    found = run_in_c(integral, np.c_[np.arange(len(u)) * DT, u, iota], par)[1:]
    return dict(zip(integral.Outputs._fields, found.T))


def run_python(u: np.ndarray, iota: np.ndarray, par: integral.Parameters) -> np.ndarray:
    """The same from generated Python, which must not raise where C goes on."""
    _, rows = KERNEL.run(np.c_[np.arange(len(u)) * DT, u, iota].tolist(), par)
    return np.array(rows[1:], float)


def operations(*lengths: int, low: int = 60) -> Signal:
    """Coil switched on and off, operations of the given lengths; the current has not always decayed at the end."""
    v = np.concatenate(
        [np.zeros(12), *(np.where(np.arange(n) < n - low, 30.0, 0.0) for n in lengths), np.full(5, 30.0)]
    )
    i = np.zeros(v.size)
    for k in range(1, v.size):
        i[k] = (v[k] * DT + 0.06 * i[k - 1]) / (76.0 * DT + 0.06)
    rng = np.random.default_rng(5)
    u, iota = v + 15e-3 * rng.standard_normal(v.size), i + 1e-3 * rng.standard_normal(v.size)
    return Signal(u, iota, np.full(v.size, 0.06), 0.06 * i)


@pytest.mark.parametrize("signal", [valve_like(), operations(150, 90, 200), valve_like(noise=0.0)])
def test_online_equals_the_textbook(signal: Signal) -> None:
    found = run(signal.u, signal.iota)
    r, inductance, flux_linkage = integral_textbook.online(signal.u, signal.iota, *ORACLE)
    np.testing.assert_array_equal(found["resistance"], r)
    np.testing.assert_array_equal(found["inductance"], inductance)
    np.testing.assert_array_equal(found["flux_linkage"], flux_linkage)
    np.testing.assert_array_equal(found["published_time"], np.arange(1, signal.u.size) * DT)
    assert np.all(found["published"] == 1.0)


def test_constant_resistance_is_recovered_exactly_from_an_ideal_coil() -> None:
    signal = valve_like(noise=0.0)
    found = run(signal.u, signal.iota, PAR._replace(noise_current=0.0))
    np.testing.assert_allclose(found["resistance"][REST + 400 :], 76.0, rtol=1e-4)  # what has not decayed remains
    ended = operations(2000, 2000, low=1700)
    i = np.zeros(ended.u.size)
    v = np.where(ended.u > 15.0, 30.0, 0.0)
    for k in range(1, v.size):
        i[k] = (v[k] * DT + 0.06 * i[k - 1]) / (76.0 * DT + 0.06)
    found = run(v, i)
    np.testing.assert_allclose(found["resistance"][12 + 2000 :], 76.0, rtol=1e-12)
    np.testing.assert_allclose(found["flux_linkage"][12 + 2000 :], 0.06 * i[12 + 2001 :], atol=1e-12)


@pytest.mark.parametrize("noise_current", [0.0, 1e-3])
def test_first_event_without_any_current_keeps_the_prior(noise_current: float) -> None:
    u, iota = np.array([0.0, 0.0, 30.0, 30.0]), np.array([0.0, 0.0, 0.1, 0.2])
    found = run(u, iota, PAR._replace(noise_current=noise_current))
    assert np.all(found["resistance"] == 77.5)
    found = run(u[1:], iota[1:], PAR._replace(noise_current=noise_current))  # an edge on the very first step
    assert np.all(found["resistance"] == 77.5)


def test_event_after_noise_only_keeps_the_prior() -> None:
    rng = np.random.default_rng(2)
    found = run(np.r_[np.zeros(400), 30.0, 30.0], np.r_[1e-3 * rng.standard_normal(400), 0.1, 0.2])
    assert np.all(found["resistance"] == 77.5)


def check_offline(signal: Signal) -> None:
    """Every sample published belongs to the operation before, with the values of the non-causal computation."""
    found = run(signal.u, signal.iota, PAR._replace(offline=1.0))
    starts = [1, *integral_textbook.edges(signal.u, 15.0), signal.u.size]
    ended = integral_textbook.offline(signal.u, signal.iota, *ORACLE)
    assert np.all(found["published"][: starts[1] - 1] == 0.0)  # nothing has ended yet
    for begin, end, (k, r, inductance, flux_linkage) in zip(starts[1:], starts[2:], ended):
        count = min(end - begin, len(k), integral.LENGTH)
        now = slice(begin - 1, begin - 1 + count)  # `found` starts with sample 1
        assert np.all(found["published"][now] == 1.0)
        np.testing.assert_allclose(found["published_time"][now], k[:count] * DT, rtol=0.0, atol=1e-12)
        np.testing.assert_allclose(found["resistance"][now], r[:count], rtol=1e-13)
        np.testing.assert_allclose(found["inductance"][now], inductance[:count], rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(found["flux_linkage"][now], flux_linkage[:count], rtol=1e-9, atol=1e-12)
        rest = slice(begin - 1 + count, end - 1)
        assert np.all(found["published"][rest] == 0.0) and np.all(found["quality"][rest] == 0.0)
        assert np.all(found["flux_linkage"][rest] == PAR.prior_flux_linkage)
        assert np.all(np.diff(found["published_time"][now.start : rest.stop]) >= 0.0)


def test_offline_publishes_the_operation_before_with_its_own_resistance() -> None:
    check_offline(valve_like())


@pytest.mark.parametrize("lengths", [(150, 90, 200), (100, 250, 80, 80)], ids=["shorter", "longer"])
def test_offline_with_operations_of_different_length(lengths: tuple[int, ...]) -> None:
    check_offline(operations(*lengths))
    check_offline(operations(*lengths, low=3))  # the current has not decayed when the next operation starts


def test_offline_with_an_operation_longer_than_the_memory() -> None:
    check_offline(operations(integral.LENGTH + 300, integral.LENGTH + 50, 120))


def test_memory_of_one_operation_is_not_touched_by_the_next() -> None:
    signal = operations(80, 80, 80, 80)
    check_offline(signal)
    assert integral.SPARE == 2 * integral.LENGTH


@pytest.mark.parametrize("kind", [np.nan, np.inf, -np.inf, 10.0, -1e300])
@pytest.mark.parametrize("which", ["voltage", "current", "both"])
@pytest.mark.parametrize(("at", "length"), [(820, 1), (821, 1), (905, 1), (960, 100), (1025, 20), (870, 700)])
def test_lost_readings_are_bridged_and_forgotten(kind: float, which: str, at: int, length: int) -> None:
    """A spike is 10 A or 1 kV; sample 820 is the first of an operation.  From the next one on nothing is left."""
    signal = valve_like(cycles=7)
    u, iota, hole = signal.u.copy(), signal.iota.copy(), slice(at, at + length)
    if which != "current":
        u[hole] = 1e2 * kind
    if which != "voltage":
        iota[hole] = kind
    found, clean = run(u, iota), run(signal.u, signal.iota)
    assert all(np.all(np.isfinite(values)) for values in found.values())
    lost = np.zeros(u.size, bool)
    lost[hole] = True
    learnt = REST + 400  # the second operation begins there
    causes = np.where(lost, LOST, 0.0) + np.where(np.arange(u.size) < learnt, UNLEARNT, 0.0)
    np.testing.assert_array_equal(found["health"], np.where(causes, 0.0, 1.0)[1:])
    np.testing.assert_array_equal(found["health_causes"], causes[1:])
    back = REST + 400 * ((at + length - REST) // 400 + 1) - 1
    np.testing.assert_allclose(found["resistance"][back:], clean["resistance"][back:], rtol=0.0, atol=0.1)
    assert np.sqrt(np.mean((found["flux_linkage"][back:] - signal.flux_linkage[back + 1 :]) ** 2)) < 0.25e-3
    assert all(np.all(np.isfinite(v)) for v in run(u, iota, PAR._replace(offline=1.0)).values())


@pytest.mark.parametrize("offline", [0.0, 1.0])
@pytest.mark.parametrize("kind", [np.nan, np.inf, -np.inf, 10.0, -1e300])
def test_python_bridges_lost_readings_with_the_same_bits(kind: float, offline: float) -> None:
    signal, par = valve_like(cycles=4), PAR._replace(offline=offline)
    u, iota = signal.u.copy(), signal.iota.copy()
    u[905:925], iota[915:1100] = 1e2 * kind, kind
    iota[820] = kind
    expected = np.array([*run(u, iota, par).values()]).T
    np.testing.assert_array_equal(run_python(u, iota, par), expected)


def test_readings_lost_in_every_operation_do_not_leave_the_resistance_out_of_date() -> None:
    """One reading in a hundred, and a coil that is 1.5 ohm colder than the prior."""
    signal = valve_like(cycles=8)
    iota = np.where(np.random.default_rng(3).random(signal.u.size) < 0.01, np.nan, signal.iota)
    found = run(signal.u, iota)
    assert np.abs(found["resistance"][REST + 3 * 400 :] - 76.0).max() < 0.15


def test_nothing_but_lost_readings() -> None:
    found = run(np.full(50, np.nan), np.full(50, np.nan))
    assert all(np.all(np.isfinite(values)) for values in found.values())
    assert np.all(found["health"] == 0.0) and np.all(found["resistance"] == 77.5)


BY_ITSELF = PAR._replace(edge_voltage=0.0)


@pytest.mark.parametrize("supply", [0.2, 3.0, 12.0, 30.0, 90.0])
def test_operations_begin_by_what_the_voltage_does(supply: float) -> None:
    """Those of 30 V with all voltages and noises scaled: resistance as there, at any supply."""
    scale, signal = supply / 30.0, valve_like(cycles=6)
    par = BY_ITSELF._replace(noise_current=1e-3 * scale, noise_voltage=15e-3 * scale)
    found = run(signal.u * scale, signal.iota * scale, par)
    expected = run(signal.u, signal.iota, PAR)
    np.testing.assert_allclose(found["resistance"], expected["resistance"], rtol=1e-12)
    np.testing.assert_allclose(found["flux_linkage"], expected["flux_linkage"] * scale, rtol=0.0, atol=1e-12 * scale)


def test_a_sample_of_the_voltage_that_holds_a_part_of_the_edge_belongs_to_the_operation() -> None:
    """A converter that takes the mean over the sampling period: 3 V, then 30 V is one edge."""
    signal = valve_like(cycles=3, noise=0.0)
    u = signal.u.copy()
    first = np.flatnonzero(np.diff(u) > 15.0) + 1
    u[first[0]] = 3.0
    found = run(u, signal.iota, BY_ITSELF._replace(noise_current=0.0))
    sums = np.cumsum(u[first[0] : first[1]]) - 77.5 * np.cumsum(signal.iota[first[0] : first[1]])
    np.testing.assert_allclose(found["flux_linkage"][first[0] - 1 : first[1] - 1], DT * sums, atol=1e-12)


@pytest.mark.parametrize("wild", [False, True], ids=["a lower supply", "a spike"])
def test_a_lower_supply_is_learnt(wild: bool) -> None:
    """After 90 V, for an operation or a sample, come 12 V: a quarter of 90 V is forgotten in 4096 driven samples."""
    high, low = valve_like(cycles=1), valve_like(cycles=30, rest=0, seed=2)
    if wild:
        high = high._replace(u=np.where(np.arange(high.u.size) == 50, 90.0, 0.4 * high.u), iota=0.4 * high.iota)
    else:
        high = high._replace(u=3.0 * high.u, iota=3.0 * high.iota)
    found = run(np.r_[high.u, 0.4 * low.u], np.r_[high.iota, 0.4 * low.iota], BY_ITSELF)
    np.testing.assert_allclose(found["resistance"][-400:], 76.0, rtol=5e-3)


def test_a_capacitor_that_discharges_begins_one_operation() -> None:
    """Its voltage falls through the level in steps of a converter, up and down with the noise."""
    signal, n = operations(2000, 2000), 1000
    u = np.where(signal.u > 15.0, signal.u, 0.0)
    u[12 : 12 + n] = np.round(30.0 * np.exp(-np.arange(n) / 500.0) + 0.3 * np.random.default_rng(4).standard_normal(n))
    found = run(u, signal.iota, BY_ITSELF)
    np.testing.assert_array_equal(found["resistance"][: 12 + 1999], 77.5)


def test_noise_at_rest_begins_nothing() -> None:
    signal = valve_like(cycles=3, rest=20000)
    offset = 5e-3  # of the current: any operation of noise alone would have R = 0 V / 5 mA
    found = run(signal.u, signal.iota + np.where(np.arange(signal.u.size) < 15000, offset, 0.0), BY_ITSELF)
    assert np.all(found["resistance"][:20399] == 77.5)
