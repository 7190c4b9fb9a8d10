"""The study's loops through FMUs: the same bits as by the kernels over runs."""

from __future__ import annotations

from copy import deepcopy

import numpy as np
import pytest

from gapsense import Scenario
from gapsense.fmi.components import load_component, own
from gapsense.scenarios.run_to_run.chain import Running
from gapsense.scenarios.run_to_run.conditions import CONDITIONS, samples
from gapsense.scenarios.run_to_run.loops import COMPONENTS, SCENARIO, loop_of

HELD_OUT, CYCLES = 6, 8
SEEN = {f"plant.{name}": f"actuator.{name}" for name in ("position", "mode", "current")}
FMUS = {
    "drive": "drive_voltage", "plant": "reluctance_actuator", "sensor": "sensor", "mhe": "mhe", "law": "run_to_run",
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("run", range(20))
@pytest.mark.parametrize("law", ["contact", "model"])
def test_twenty_actuators_through_fmus(natives, law, run):
    """Native ones, which have the bits of the Python FMUs."""
    same_bits(natives, law, run, CYCLES)


def same_bits(fmus, law, run, cycles):
    """One actuator of the study, some cycles."""
    condition = CONDITIONS["plain"]
    count, closed = samples(condition)
    loop = loop_of(law, condition, HELD_OUT, range(run, run + 1))
    running = Running(loop.chain, loop.par, [0.0, 0.0], condition.sample_time, 1)
    given = np.transpose([np.arange(count) < closed, np.zeros(count)])
    rows = np.concatenate([running.go(loop.par, given) for _ in range(cycles)])[:, :, 0]
    expected = dict(zip(loop.chain.recorded, rows.T))
    with scenario(fmus, loop, cycles * condition.period) as made:
        found = made.run()
    for name, signal in SEEN.items():
        np.testing.assert_array_equal(found[signal][1:], expected[name])


def scenario(fmus, loop, stop):
    """The shipped scenario with the parameters of a loop; with a contact, `Mhe` only looks on there."""
    made = Scenario.load(SCENARIO, fmus)
    kept = ("experiment", "components", "connect", "connections", "inputs")
    made.data = deepcopy({name: made.data[name] for name in kept}) | {"title": "through FMUs"}
    made.data["experiment"]["stop"] = stop
    for part in loop.chain.parts:
        for name, number in told(part.name, loop).items() if part.name in FMUS else ():
            made.set(f"{COMPONENTS.get(part.name, part.name)}.{name}", number)
    return made.record(*SEEN.values())


def told(name, loop):
    """Parameters of a part by the names of its FMU."""
    ports = [p for p in load_component(own(FMUS[name])).of("parameter") if not p.columns]
    return {port.name: value(port, loop.par[f"{name}.{port.field}"]) for port in ports}


def value(port, column):
    number = float(column[0, 0])
    if port.choices:
        return port.choices[round(number)]
    return {"Boolean": bool, "Integer": round}.get(port.kind, float)(number)
