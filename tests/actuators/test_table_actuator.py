"""The actuator from a table: as the model that its table is from, by closed forms, and its energies."""

from __future__ import annotations

import numpy as np
import pytest
from c_code import driven
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline
from static_table import FILE, FLUX_LINKAGES, GAPS, current, write

from gapsense import TableActuator
from gapsense.actuators import reluctance_actuator, table_actuator
from gapsense.actuators.surface import surface, surface_patch
from gapsense.fmi.components import kernel_parameters, load_component, own
from gapsense.studies.devices import RTS_VALVE, drive

TABLE = kernel_parameters(own("table_actuator"), {})
STEP = 20e-6
FREE = {"spring_stiffness": 0.0, "damping": 0.0, "spring_preload": 0.0}
ENERGIES = ("supplied_energy", "dissipated_energy", "stored_energy")
ELASTIC = {"stop_law": 1.0, "stop_stiffness": 1e6}


PORTS = {port.field: port for port in load_component(own("table_actuator")).of("parameter")}


def run(voltage, *names, **given):
    """As `driven`, by the class of the component: in C where there is a compiler, with the same bits."""
    values = {PORTS[name].name.replace(".", "_"): as_told(PORTS[name], x) for name, x in given.items()}
    made = TableActuator(**values)
    return np.array([*made.run(np.r_[0.0, voltage[:-1]], sample_time=STEP, outputs=names).outputs.values()])


def as_told(port, number):
    """A number of the kernel as the component takes it."""
    return port.choices[int(number)] if port.choices else bool(number) if port.kind == "Boolean" else number


@pytest.mark.slow
def test_class_has_the_bits_of_the_kernel():
    """What most tests here rely on."""
    voltage, given = square_wave()[450:600], {"hysteresis": 1.0, "stop_law": 1.0, "initial_position": 0.5e-3}
    expected = drive(table_actuator, TABLE._replace(**given), voltage, STEP, *ENERGIES, "position").T
    assert run(voltage, *ENERGIES, "position", **given).tobytes() == np.ascontiguousarray(expected).tobytes()


def square_wave(cycles=1, high=30.0):
    return np.where(np.arange(1000 * cycles) % 1000 < 500, high, 0.0)


def with_table(file):
    return kernel_parameters(own("table_actuator"), {"map.file": str(file)})


def test_table_that_is_shipped_is_the_reluctance_actuator_without_losses(tmp_path):
    made = write(tmp_path / "map.csv", 1e-3 * GAPS, 1e-3 * FLUX_LINKAGES, lambda h, lam: current(h, lam, RTS_VALVE))
    found, expected = (np.loadtxt(file, delimiter=",", skiprows=1) for file in (FILE, made))
    np.testing.assert_allclose(found, expected, rtol=2e-9)


@given(st.floats(0.25e-3, 1.6e-3), st.floats(0.0, 30e-3))
@settings(max_examples=60, deadline=None)
def test_current_and_force_are_slopes_of_one_energy(h, lam):
    """Inside the table it is SciPy's tensor spline; everywhere its differences are current and force."""
    of = table_actuator.device(table_actuator.Inputs(0.0, 0.0, 0.0), TABLE).map
    level, dh, dlam = surface(h, lam, surface_patch(h, lam, of)), 1e-9, 1e-8

    def energy(h, lam):
        return surface(h, lam, surface_patch(h, lam, of)).integral

    assert (energy(h + dh, lam) - energy(h - dh, lam)) / (2.0 * dh) == pytest.approx(level.tilt, abs=1e-5)
    assert (energy(h, lam + dlam) - energy(h, max(lam - dlam, 0.0))) / (
        lam + dlam - max(lam - dlam, 0.0)
    ) == pytest.approx(level.value, abs=1e-5)
    gaps, columns = 1e-3 * GAPS, len(FLUX_LINKAGES)
    rows = np.reshape(of.values, (len(gaps), columns))
    at = CubicSpline(gaps, np.hstack([-rows[:, :0:-1], rows]))(h)
    axis = np.array(of.axis[:columns])
    along = CubicSpline([*-axis[:0:-1], *axis], at)
    last = axis[-1]
    straight = along(last) + along(last, 1) * (lam - last)
    if gaps[0] <= h <= gaps[-1]:
        assert level.value == pytest.approx(float(along(lam) if lam <= last else straight), abs=1e-10)


@pytest.mark.parametrize("hysteresis", [pytest.param(0.0, marks=pytest.mark.slow), 1.0])
def test_it_is_the_reluctance_actuator(hysteresis, tmp_path):
    """To what 11 gaps and 29 flux linkages tell; four times as many of both tell a hundred times more."""
    names, voltage = ("position", "current", "force", "hysteresis_energy", "eddy_energy", "mode"), square_wave()
    other = driven(reluctance_actuator, RTS_VALVE._replace(hysteresis=hysteresis), voltage, STEP, *names).T
    finer = [np.interp(np.arange(0.0, len(x) - 0.9, 0.25), np.arange(len(x)), x) for x in (GAPS, FLUX_LINKAGES)]
    file = write(tmp_path / "fine.csv", *(1e-3 * x for x in finer), lambda h, lam: current(h, lam, RTS_VALVE))
    for par, part in ((TABLE, 1.0), (with_table(file), 0.01)):
        found = driven(table_actuator, par._replace(hysteresis=hysteresis), voltage, STEP, *names).T
        assert np.abs(found[0] - other[0]).max() < part * 0.3e-6
        assert np.abs(found[1] - other[1]).max() < part * 15e-6
        assert np.abs(found[2] - other[2]).max() < part * 3e-3
        np.testing.assert_allclose(found[3:5], other[3:5], atol=part * 2e-8)
        np.testing.assert_array_equal(found[5], other[5])
    assert (other[3][-1] > 3e-4) == bool(hysteresis)


def test_three_flux_linkages_are_a_law_without_saturation(tmp_path):
    """i = lambda R(h) with R of degree 3 is met exactly, and so is the force -lambda^2 R'/2."""
    file = write(
        tmp_path / "linear.csv",
        np.linspace(0.2e-3, 2e-3, 4),
        np.array([0.0, 0.01, 0.02]),
        lambda h, lam: lam * (5.0 + 2e4 * h + 1e6 * h * h),
    )
    par = with_table(file)._replace(eddy_currents=0.0)
    i, h, lam, force, L = driven(
        table_actuator, par, square_wave(), STEP, "current", "position", "flux_linkage", "force", "inductance"
    ).T
    R, slope = 5.0 + 2e4 * h + 1e6 * h * h, 2e4 + 2e6 * h
    assert np.ptp(h) == pytest.approx(1e-3) and lam.max() > 0.02  # beyond the table too
    np.testing.assert_allclose(i, lam * R, atol=1e-9)
    np.testing.assert_allclose(force, -0.5 * lam**2 * slope, atol=1e-8)
    np.testing.assert_allclose(L, 1.0 / R, rtol=1e-7)


LEVELS = st.lists(st.sampled_from([30.0, 45.0, 12.0, 0.0, -20.0]), min_size=3, max_size=5)
MORE = st.fixed_dictionaries(
    {
        "hysteresis": st.sampled_from([0.0, 1.0]),
        "eddy_currents": st.sampled_from([0.0, 1.0]),
        "mover_load": st.floats(0.0, 5e-3),
        "gravity": st.sampled_from([-9.81, 0.0, 9.81]),
        "spring_law": st.sampled_from([0.0, 1.0]),
        "spring_preload": st.floats(-0.3, 0.3),
        "damping": st.floats(0.0, 1.0),
        "friction": st.sampled_from([0.0, 0.05, 0.4]),
        "stop_law": st.sampled_from([0.0, 1.0]),
        "stop_restitution": st.floats(0.0, 0.9),
        "stop_stiffness": st.sampled_from([3e4, 1e6]),
        "stop_damping": st.floats(0.0, 5.0),
        "initial_position": st.floats(0.4e-3, 1.4e-3),
    }
)


@example([30.0], {"gravity": -9.81, "damping": 0.0, "stop_law": 1.0, "stop_stiffness": 1e6, "stop_damping": 4.0})
@example([0.0, 30.0], {"hysteresis": 1.0, "eddy_currents": 0.0, "initial_position": 0.85e-3, "damping": 0.0})  # no flux
@given(LEVELS, MORE)
@settings(max_examples=25, deadline=None)
def test_energy_balance_closes_over_whole_operations(levels, more):
    voltage = np.repeat([*levels, 0.0], 250)
    supplied, lost, stored = run(voltage, *ENERGIES, **more)
    assert np.abs(supplied - lost - (stored - stored[0])).max() < 3e-7 * max(1e-2, np.abs(supplied).max())
    assert np.diff(lost).min() > -1e-12


@pytest.mark.parametrize("more", [{"stop_restitution": 0.6}, ELASTIC], ids=["hard", "elastic"])
def test_free_fall_does_not_ask_for_the_mass(more):
    """From the upper stop over 1 mm: speed sqrt(2 g s), and after it what the stop leaves of it."""
    voltage = np.zeros(1500)
    for load in (0.0, 20e-3):
        h, v, impact = run(
            voltage, "position", "velocity", "impact_speed", gravity=-9.81, mover_load=load, **FREE, **more
        )
        t = STEP * np.arange(1500)
        falling = 0.5 * 9.81 * t**2 < 0.999e-3
        np.testing.assert_allclose(h[falling], 1.4e-3 - 0.5 * 9.81 * t[falling] ** 2, atol=1e-12)
        assert impact.max() == pytest.approx(np.sqrt(2.0 * 9.81 * 1e-3), rel=1e-9)
        if more != ELASTIC:
            assert v.max() == pytest.approx(0.6 * impact.max(), abs=STEP * 9.81)


@pytest.mark.parametrize(("damping", "rest"), [(0.0, 1.0), (0.5, 0.7484), (5.0, 0.1970)])
def test_elastic_stop_leaves_a_part_of_the_speed_whatever_mass_and_stiffness(damping, rest):
    """A mover that gravity of 500 m/s2 has brought to 1 m/s; the numbers are on the page."""
    for stiffness, load in ((1e8, 0.0), (1e9, 8e-3)):
        v = run(
            np.zeros(220), "velocity", stop_law=1.0, stop_stiffness=stiffness, stop_damping=damping, mover_load=load,
            gravity=-500.0, **FREE,
        )[0]  # fmt: skip
        assert v.min() == pytest.approx(-1.0, abs=500.0 * STEP)
        assert v.max() == pytest.approx(rest, abs=500.0 * STEP)


def test_friction_holds_without_a_creep_and_lets_go_at_its_force():
    """A mover without a spring stays where it was for a second; gravity of a load of just more moves it."""
    voltage, held = np.zeros(1000), {"initial_position": 0.9e-3, "friction": 0.1, **FREE}
    mass = 0.1 / 9.81 - TABLE.mover_mass
    for load, stays in ((0.999 * mass, True), (1.001 * mass, False)):
        h, v, mode = run(voltage, "position", "velocity", "mode", mover_load=load, gravity=9.81, **held)
        assert (np.ptp(h) == 0.0 and np.ptp(v) == 0.0 and set(mode) == {2.0}) == stays
    with_spring = {**held, "spring_stiffness": 1000.0, "spring_rest": 0.7e-3}
    h, v = run(voltage, "position", "velocity", **with_spring)
    assert v.min() < -0.03 and v[-1] == 0.0 and 1000.0 * abs(h[-1] - 0.7e-3) < 0.1


def test_spring_by_table_is_that_by_numbers(tmp_path):
    file = tmp_path / "spring.csv"
    force = [TABLE.spring_stiffness * (TABLE.spring_rest - h) for h in (0.2e-3, 0.7e-3, 1e-3)]
    file.write_text("gap [m],force [N]\n" + "".join(f"{h},{f!r}\n" for h, f in zip((0.2e-3, 0.7e-3, 1e-3), force)))
    by_table = kernel_parameters(own("table_actuator"), {"spring.file": str(file), "spring.law": "table"})
    names = ("position", "current", "spring_force")
    found = driven(table_actuator, by_table, square_wave(), STEP, *names).T
    np.testing.assert_allclose(found, run(square_wave(), *names), atol=1e-9)


def test_elastic_stops_are_entered_at_rest_and_impacts_are_those_of_hard_ones():
    h, mode, v = run(np.zeros(100), "position", "mode", "velocity", **ELASTIC)
    depth = TABLE.spring_stiffness * (TABLE.spring_rest - TABLE.stop_upper) / 1e6
    np.testing.assert_allclose(h, TABLE.stop_upper + depth, atol=1e-3 * depth)
    assert set(mode) == {3.0} and np.abs(v).max() < 3e-6
    hard, soft = (run(square_wave(), "impact_speed", **more)[0] for more in ({}, ELASTIC))
    assert soft[499] == pytest.approx(hard[499], rel=1e-3)
    assert soft[-1] == pytest.approx(hard[-1], rel=2e-2)
