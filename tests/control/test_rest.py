"""Rests between operations: a valve stays open, or closed, for minutes or hours; the next operations are as ever."""

import numpy as np
import pytest

from gapsense.control import run_to_run
from gapsense.kernels.kernel import Kernel
from gapsense.kernels.layout import names
from gapsense.scenarios.run_to_run.chain import Chain, Part, Running
from gapsense.scenarios.run_to_run.conditions import CONDITIONS
from gapsense.scenarios.run_to_run.loops import controller

PLAIN = CONDITIONS["plain"]
T_s, SAMPLES, CLOSED = PLAIN.sample_time, 1000, 490  # of a piece: a cycle, or a part of a rest
OUTPUTS = ("law.voltage_reference", "law.flux_linkage", "law.state", "law.warnings")
GIVEN = ("command", "voltage", "current", "mode")
SECONDS = [2.0, pytest.param(10.0, marks=pytest.mark.slow), pytest.param(100.0, marks=pytest.mark.slow)]


@pytest.fixture(scope="module")
def alone():
    """The controller without an actuator, as vectors of one run."""
    par, kernel = controller(PLAIN), Kernel(run_to_run)
    wires = {name: name for name in GIVEN} | {"enable": 1.0}
    columns = {
        f"law.{name}": np.atleast_2d(float(value)) if np.ndim(value) == 0 else value
        for name, value in zip(names(type(par)), par)
    }
    return Chain([Part("law", kernel, wires)], OUTPUTS, GIVEN), columns


def readings(command, since, resistance):
    """Of a piece: the mover leaves 0.5 ms after a command and lands 3 ms after it, the current follows in 1 ms."""
    age, stop = since + np.arange(SAMPLES), np.where(command, 1.0, 3.0)
    age = np.where(command, age, age - CLOSED) if command.any() and not command.all() else age
    share = np.exp(-age * T_s / 1e-3)
    current = 0.2 * np.where(command, 1.0 - share, share)
    mode = np.where(age < 25, 4.0 - stop, np.where(age < 150, 2.0, stop))
    return np.transpose([command * 1.0, resistance * np.where(command, 0.2, 0.0), current, mode])


def operations(alone, is_closed, seconds, skipped=0):
    """Outputs at the end of a rest after some cycles, and of two cycles after that; some of the samples are skipped."""
    chain, columns = alone
    running = Running(chain, columns, [0.0, 0.0, 0.0, 3.0], T_s, 1)
    resistance = 1.02 * columns["law.coil_resistance"][0, 0]  # another one than believed
    cycle, held = np.arange(SAMPLES) < CLOSED, np.full(SAMPLES, is_closed)
    for _ in range(8):
        running.go(columns, readings(cycle, 0, resistance))
    for k in range(round(seconds / (SAMPLES * T_s))):
        rest = running.go(columns, readings(held, SAMPLES * k + (0 if is_closed else SAMPLES), resistance))
    if skipped:
        values, at = running.blocks[0].values, running.chain.places[0]
        before = values.copy()
        running.go(columns, readings(held, SAMPLES * (k + 2), resistance))
        counted = values - before
        counted[at.time] = 0.0  # which it is not told
        counted[np.abs(counted) < 1e-30] = 0.0  # the noise of readings without any decays
        assert np.all(np.isin(counted, (0.0, SAMPLES)))  # nothing else changes: so it goes on for ever
        assert np.any(counted)
        values += skipped * counted
    opened = [running.go(columns, readings(~held, 0, resistance))] if is_closed else []
    after = [running.go(columns, readings(cycle, 0, resistance)) for _ in range(2)]
    return rest[:, :, 0], np.concatenate([*opened, *after])[:, :, 0]


@pytest.mark.parametrize("seconds", SECONDS)
@pytest.mark.parametrize("is_closed", [False, True])
def test_a_rest_changes_nothing(alone, is_closed, seconds):
    """The flux linkage stays where it was, and the voltages of the next operations are those after a short rest."""
    (rest, after), (_, usual) = (operations(alone, is_closed, time) for time in (seconds, 0.1))
    assert np.all(rest == rest[0]) and np.all(after[:, 2:] == usual[:, 2:])
    assert after == pytest.approx(usual, abs=1e-3)


@pytest.mark.parametrize("hours", [1, 1000])
@pytest.mark.parametrize("is_closed", [False, True])
def test_hours_of_rest_change_nothing(alone, is_closed, hours):
    """A rest comes to a state in which nothing but counters of samples changes; these are set forward."""
    skipped = round(hours * 3600.0 / (SAMPLES * T_s))
    (_, after), (_, usual) = operations(alone, is_closed, 0.2, skipped), operations(alone, is_closed, 0.1)
    assert np.all(after[:, 2:] == usual[:, 2:]) and after == pytest.approx(usual, abs=1e-3)
