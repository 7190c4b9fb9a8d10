"""What the controller does with commands, contacts that never come, and readings; its state is all there is."""

import math
from copy import deepcopy

import numpy as np
import pytest
from c_code import fresh
from commanded import commanded, inputs, parameters

from gapsense.control import laws, run_to_run
from gapsense.control.coil import DRIVEN
from gapsense.control.judging import WARNINGS, judged_by_estimator
from gapsense.control.records import LawKind
from gapsense.estimators.mhe.model import gap, make_gap
from gapsense.kernels.interface import ports_of
from gapsense.kernels.kernel import Kernel
from gapsense.kernels.layout import flat, record

OFF, LEARNING, TRACKING, BACK, OPEN = 0.0, 1.0, 2.0, 4.0, 5.0  # as the port table says
PAR = parameters(sample_time=100e-6)  # few samples
HIGH, LOW = [1.0] * 98, [0.0] * 102
CYCLE = HIGH + LOW
KERNEL = Kernel(run_to_run)


def run(commands, par=PAR, since=None, first=1, **given):
    """Outputs of the generated C, and the last state; it may go on from a state, with sample `first`."""

    def now(k):
        return {name: value(k) if callable(value) else value for name, value in given.items()}

    c, start = fresh(run_to_run), inputs(**now(0))
    samples = [inputs(time=k * par.sample_time, command=x, **now(k)) for k, x in enumerate(commands, first)]
    state = flat(since or KERNEL.initial(start, par)[0])
    c.state[:] = [value for value in state if not isinstance(value, list)]
    c.memory = [np.array(value) for value in state if isinstance(value, list)]
    rows = c.run(np.array(samples), par, is_later=True).tolist()
    scalars, memory = iter(c.state.tolist()), iter(c.memory)
    last = [next(memory).tolist() if isinstance(value, list) else next(scalars) for value in state]
    return [record(run_to_run.Outputs, row) for row in rows], record(run_to_run.State, last)


def test_the_port_of_the_warnings_has_every_bit():
    (port,) = [port for port in ports_of(run_to_run) if port.name == "warnings"]
    assert port.max == sum(WARNINGS) and all(f"{bit:.0f}: " in port.description for bit in WARNINGS)


def test_without_a_command_there_is_no_voltage():
    rows, _ = run([0.0] * 300, voltage=0.0, current=0.01, mode=3.0)
    assert {(row.voltage_reference, row.state, row.cycle) for row in rows} == {(0.0, OFF, 0.0)}


def test_first_cycle_is_an_ordinary_one():
    rows, _ = run(CYCLE, voltage=24.0, current=0.4, mode=1.0)
    assert [row.voltage_reference for row in rows] == [PAR.voltage_hold * command for command in CYCLE]
    assert {row.state for row in rows} == {LEARNING} and rows[-1].cycle == 1.0


def landing(k):
    """A contact: 0.5 ms after each command the mover leaves, 3 ms after it it lands."""
    k = (k - 1) % 200
    age, ends = (k, (3.0, 1.0)) if k < 98 else (k - 98, (1.0, 3.0))
    return ends[0] if age < 5 else 2.0 if age < 30 else ends[1]


def test_second_cycle_is_soft_where_a_contact_was_heard():
    rows, _ = run(CYCLE * 2, voltage=10.0, current=0.2, mode=landing)
    soft = rows[200:]
    assert {row.state for row in soft[1:90]} == {TRACKING}
    assert {PAR.voltage_hold, 0.0} != {row.voltage_reference for row in soft}
    assert max(row.flux_reference for row in soft) > 5e-3 and soft[95].flux_reference == 0.0
    assert all(PAR.voltage_least <= row.voltage_reference <= PAR.voltage_most for row in soft)


def test_offset_that_the_first_opening_tells_asks_for_another_ordinary_cycle():
    """The first cycle was learnt with a zero that was wrong."""

    def current(k):
        return 0.2 * (0 < (k - 1) % 200 < 98) + 5e-3

    rows, state = run(CYCLE * 3, voltage=10.0, current=current, mode=landing)
    assert [rows[200 * c + 50].state for c in range(3)] == [LEARNING, LEARNING, TRACKING]
    assert state.coil.zero == pytest.approx(5e-3, rel=1e-3)
    rows, _ = run(CYCLE * 2, voltage=10.0, current=lambda k: current(k) - 4e-3, mode=landing)
    assert [rows[200 * c + 50].state for c in range(2)] == [LEARNING, TRACKING]


@pytest.mark.parametrize("enable", [0.0, 0.5, -1.0])
def test_disabled_cycles_are_ordinary_ones(enable):
    rows, _ = run(CYCLE * 3, voltage=10.0, current=0.2, mode=landing, enable=lambda k: 1.0 if k < 200 else enable)
    assert [row.voltage_reference for row in rows[200:]] == [PAR.voltage_hold * command for command in CYCLE * 2]
    assert rows[-1].state == BACK and rows[-1].cycle == 3.0


def test_enable_counts_where_a_closing_begins():
    """Not in the middle of a cycle."""
    on, _ = run(CYCLE * 2, voltage=10.0, current=0.2, mode=landing)
    off, _ = run(CYCLE * 2, voltage=10.0, current=0.2, mode=landing, enable=lambda k: 1.0 if k < 210 else 0.0)
    assert on == off


def test_a_miss_is_told_and_followed_by_ordinary_cycles_until_one_lands():
    """A mover that does not land in the cycles 1 to 5."""
    rows, _ = run(CYCLE * 9, voltage=10.0, current=0.2, mode=lambda k: 3.0 if 200 < k <= 1200 else landing(k))
    states = [rows[200 * c + 90].state for c in range(9)]
    assert states[0] == LEARNING and states[1] != BACK
    assert states[2:6] == [BACK, OPEN, OPEN, OPEN]
    assert {row.voltage_reference for row in rows[400:498]} == {PAR.voltage_hold}
    hold = {row.voltage_reference for row in rows[600:698]}
    assert hold == {PAR.voltage_most}  # more than usual, as usual was not enough
    assert rows[297].warnings < 128.0 <= rows[310].warnings  # in the next operation
    assert states[8] != BACK  # and then it tries again


@pytest.mark.parametrize("law", LawKind)
def test_ordinary_closings_that_leave_the_mover_open_are_told_and_get_more_voltage(law):
    """By the current alone, without a contact that says so, and without an estimator that explains anything."""
    par = PAR._replace(law=float(law), voltage_hold=16.0)
    R_g, *_ = gap(par.stop_upper, make_gap(par), 1.0, 0.0)
    reluctance, R, flux = R_g + par.core_reluctance / par.coil_turns**2, 1.03 * par.coil_resistance, 0.0
    state, outputs = KERNEL.initial(inputs(mode=0.0), par)
    rows = []
    for k, command in enumerate(CYCLE * 3, 1):
        u = outputs.voltage_reference
        middle = (flux + 0.5 * par.sample_time * u) / (1.0 + 0.5 * par.sample_time * R * reluctance)
        flux += par.sample_time * (u - R * middle * reluctance)
        now = inputs(time=k * par.sample_time, command=command, voltage=u, current=flux * reluctance)
        state, outputs = KERNEL.step(state, now, par)
        rows.append(outputs)
    assert {(row.state, row.warnings, row.voltage_reference) for row in rows[:97]} == {(LEARNING, 0.0, 16.0)}
    said = {(row.state, row.warnings) for row in rows[98:297]}  # 8: the estimator explains nothing
    assert said == {(OPEN, 512.0)} if law == LawKind.contact else said == {(OPEN, 512.0), (OPEN, 520.0)}
    assert {row.voltage_reference for row in rows[200:297]} == {par.voltage_most}
    has_more = state.coil.needed > DRIVEN * par.voltage_hold / par.coil_resistance
    assert has_more == (law == LawKind.model)  # from then on; a contact that says nothing is dead


@pytest.mark.parametrize(("command", "is_closed"), [(0.5, 0.0), (0.51, 1.0), (1e9, 1.0), (-1.0, 0.0), (math.inf, 1.0)])
def test_command_is_closed_above_a_half(command, is_closed):
    rows, _ = run([command] * 5, mode=3.0)
    assert rows[-1].voltage_reference == PAR.voltage_hold * is_closed and rows[-1].cycle == is_closed


def test_lost_mode_counts_for_nothing():
    """0 between two samples of the contact."""
    lossy, _ = run(CYCLE * 2, voltage=10.0, current=0.2, mode=lambda k: 0.0 if k in (20, 150) else landing(k))
    whole, _ = run(CYCLE * 2, voltage=10.0, current=0.2, mode=landing)
    assert lossy == whole


def test_operation_may_last_longer_than_the_memory():
    rows, _ = run([1.0] * 1500 + [0.0] * 1500 + CYCLE, voltage=10.0, current=0.2, mode=1.0)
    assert all(math.isfinite(value) for row in rows for value in row) and rows[-1].cycle == 2.0


def test_state_is_all_there_is():
    given = {"voltage": 10.0, "current": 0.2, "mode": landing}
    begun, state = run(CYCLE + HIGH[:40], **given)
    kept = deepcopy(state)
    more, _ = run(HIGH[40:] + LOW, since=state, first=241, **given)
    again, _ = run(HIGH[40:] + LOW, since=kept, first=241, **given)
    assert more == again
    assert begun + more == run(CYCLE * 2, **given)[0]


def test_half_bridge_is_never_asked_for_less_than_nothing():
    par = PAR._replace(voltage_least=0.0)
    rows, _ = run(CYCLE * 4, par, voltage=10.0, current=0.2, mode=landing)
    assert min(row.voltage_reference for row in rows) == 0.0


def test_source_does_the_same():
    source = [outputs for _, outputs in commanded(CYCLE[:120], PAR, voltage=10.0, current=0.2, mode=2.0)][1:]
    generated, _ = run(CYCLE[:120], voltage=10.0, current=0.2, mode=2.0)
    assert source == generated


def test_contact_that_is_never_seen_is_told():
    """After the ordinary cycle."""
    silent, _ = run(CYCLE * 2, voltage=10.0, current=0.2, mode=0.0)
    heard, _ = run(CYCLE * 2, voltage=10.0, current=0.2, mode=landing)
    assert silent[-1].warnings % 2.0 == 1.0 and heard[-1].warnings % 2.0 == 0.0


@pytest.mark.parametrize(
    ("misfit", "told", "change"),
    [(0.5, 0.4e-3, 0.4e-3), (0.5, -0.9e-3, -0.9e-3), (0.5, -5e-3, 0.0), (3.5, 0.4e-3, 0.0), (20.0, -5e-3, 0.0)],
)
def test_opening_begins_with_the_flux_linkage_of_an_estimator_in_its_senses(misfit, told, change):
    """One that has explained its last window; the one of a mover elsewhere is farther off than the loop's can be."""
    par, given = PAR._replace(law=1.0), {"voltage": 10.0, "current": 0.2}
    _, before = run(HIGH, par, **given)
    flux = before.coil.flux + (10.0 - PAR.coil_resistance * 0.2) * PAR.sample_time
    _, found = run([0.0], par, since=before, first=99, estimated_flux_linkage=flux + told, misfit=misfit, **given)
    assert found.coil.flux == pytest.approx(flux + change, abs=1e-9)
    begins = told if abs(told) < 1e-3 else 0.0
    assert found.running.start_flux == pytest.approx(flux + begins, abs=1e-9)


def test_estimator_that_says_nothing_is_told_and_cycles_stay_ordinary():
    rows, _ = run(CYCLE * 6, PAR._replace(law=1.0), voltage=10.0, current=0.2, mode=landing)
    assert rows[-1].warnings >= 8.0 and {row.state for row in rows} == {LEARNING}


@pytest.mark.parametrize("wild", [5.0, -1000.0, math.nan, math.inf])
@pytest.mark.parametrize("name", ["voltage", "current"])
def test_one_wild_reading_changes_hardly_anything_and_is_told(name, wild):
    usual = {"voltage": 10.0, "current": 0.2}
    wild = 50.0 * wild if name == "voltage" else wild
    odd = {**usual, name: lambda k: wild if k == 240 else usual[name]}
    calm, at_ease = run(CYCLE * 3, mode=landing, **usual)
    rows, state = run(CYCLE * 3, mode=landing, **odd)
    assert state.coil.flux == pytest.approx(at_ease.coil.flux, abs=1e-5)
    assert [row.state for row in rows] == [row.state for row in calm]
    assert rows[-1].warnings == calm[-1].warnings + 16.0


def test_current_that_really_jumps_is_followed_after_some_samples():
    _, state = run(CYCLE + HIGH, voltage=10.0, current=lambda k: 0.2 if k < 250 else 0.9, mode=landing)
    assert state.coil.last_current == pytest.approx(0.9, abs=0.01)


def test_readings_that_stay_lost_leave_finite_outputs():
    rows, _ = run(CYCLE * 3, voltage=math.nan, current=math.nan, mode=math.nan, impact_speed=math.nan)
    assert all(math.isfinite(value) for row in rows for value in row)


@pytest.mark.parametrize(
    "name", [name for name in run_to_run.Inputs._fields if name not in ("time", "enable", "command")]
)
@pytest.mark.parametrize("law", [0.0, 1.0])
def test_no_input_that_is_not_a_number_reaches_an_output(name, law):
    usual = {"voltage": 10.0, "current": 0.2, "mode": landing, "windows": 3.0, "estimated_mass": 1.6e-3}
    usual |= {"estimated_gap_factor": 1.0, "estimated_rest_position": 0.017, "estimated_resistance": 48.0}
    values = {**usual, "smoothed_published": 1.0, "smoothed_time": lambda k: k * PAR.sample_time}
    rows, _ = run(CYCLE * 4, PAR._replace(law=law), **{**values, name: math.nan})
    assert all(math.isfinite(value) for row in rows for value in row)


def test_lost_command_goes_on():
    """In a closing."""
    rows, _ = run(HIGH[:20] + [math.nan] * 50, voltage=10.0, current=0.2, mode=3.0)
    assert {row.voltage_reference for row in rows} == {PAR.voltage_hold}


def test_stronger_hold_ends_with_a_closing_that_arrives():
    """A soft closing in which the mover does not move, and the ordinary one after it."""

    def stuck_twice(k):
        return 3.0 if 200 < k <= 600 else landing(k)

    rows, _ = run(CYCLE * 6, voltage=10.0, current=0.2, mode=stuck_twice)
    held = [rows[200 * c + 97].voltage_reference for c in range(6)]
    assert held == [PAR.voltage_hold] * 3 + [PAR.voltage_most] + [PAR.voltage_hold] * 2


def test_ordinary_closing_with_a_warm_coil_has_more_voltage_than_holds():
    """With the voltage that holds the current of a coil 30 % warmer may not close; with a cold one nothing changes."""

    def closing(warmth):
        rows, state = run(CYCLE + LOW, voltage=0.0, mode=landing)
        coil = state.coil._replace(resistance=warmth * PAR.coil_resistance, measured=warmth * PAR.coil_resistance)
        rows, _ = run(HIGH, since=state._replace(coil=coil), first=303, enable=0.0, voltage=0.0, mode=3.0)
        return {row.voltage_reference for row in rows}

    assert closing(1.1) == {PAR.voltage_hold}
    (warm,) = closing(1.3)
    assert PAR.voltage_hold < warm < PAR.voltage_most


def test_windows_that_explain_nothing_judge_nothing_and_are_told():
    given = {"voltage": 10.0, "current": 0.2, "windows": lambda k: k // 100, "misfit": 40.0, "smoothed_published": 1.0}
    rows, _ = run(CYCLE * 6, PAR._replace(law=1.0), smoothed_time=lambda k: k * PAR.sample_time, **given)
    assert {row.voltage_reference for row in rows} == {0.0, PAR.voltage_hold}
    assert rows[-1].warnings == 8.0


def test_flux_linkage_of_a_current_that_rests_does_not_drift():
    """The resistance is believed 3 % too large."""
    par = PAR._replace(coil_resistance=1.03 * PAR.coil_resistance)
    rows, _ = run([1.0] * 3000, par, voltage=PAR.coil_resistance * 0.2, current=0.2, mode=1.0)
    assert rows[-1].flux_linkage == rows[150].flux_linkage


def test_gain_of_the_bridge_is_learnt_and_taken_out():
    state, outputs = KERNEL.initial(inputs(mode=3.0), PAR)
    asked, rows = 0.0, []
    for k in range(1, 601):
        given = inputs(time=k * 1e-4, command=CYCLE[(k - 1) % 200], voltage=0.9 * asked, current=0.2, mode=landing(k))
        state, outputs = KERNEL.step(state, given, PAR)
        asked = outputs.voltage_reference
        rows.append(outputs)
    assert state.coil.bridge_gain == pytest.approx(0.9, abs=0.01)


def test_voltage_that_is_left_without_one_is_its_zero_and_told():
    def voltage(k):
        return 10.4 if 0 < (k - 1) % 200 < 98 else 0.4

    rows, state = run(CYCLE * 3, voltage=voltage, current=lambda k: 0.2 * (voltage(k) > 1.0), mode=landing)
    assert state.coil.voltage_zero == pytest.approx(0.4, abs=1e-3) and rows[-1].warnings >= 32.0


@pytest.mark.parametrize(("leaves", "lands"), [(1500, 1600), (100, 1500), (1023, 1024), (1022, 1023)])
def test_motions_after_the_samples_that_are_kept_teach_nothing(leaves, lands):
    """They would be looked for behind the end of the memory."""

    def mode(k):
        return 3.0 if k <= leaves else 2.0 if k <= lands else 1.0

    rows, state = run([1.0] * 2000 + [0.0] * 300, voltage=10.0, current=0.2, mode=mode)
    assert state.heard.takeoff == 0.0 and state.course.last < 1024
    assert all(math.isfinite(x) for row in rows for x in row)


@pytest.mark.parametrize(("speed", "is_warned"), [(0.25, 0.0), (0.35, 1.0)])
def test_an_impact_that_is_hardly_hard_counts_but_is_not_warned_of(speed, is_warned):
    """An estimator is off by 0.03 m/s: warned from 0.22 m/s on, one soft operation in 200 was."""
    par = PAR._replace(approach_least=0.06)
    state, _ = run_to_run.initial(inputs(), par)
    law = laws.first(par.closing_travel, 0.0, par)._replace(was_plain=0.0, speed=par.approach_least)
    state = state._replace(
        laws=laws.write(state.laws, 1.0, law),
        cycles=20.0,
        running=state.running._replace(command=1.0, age=98.0, is_judged=0.0, due=60.0),
    )
    said = inputs(time=98e-4, misfit=1.0, landing_time=6e-3, smoothed_time=9e-3, estimated_impact_speed=speed)
    found = judged_by_estimator(state, said, par)
    assert found.noted.hard == is_warned and found.landed_hard == 1.0
