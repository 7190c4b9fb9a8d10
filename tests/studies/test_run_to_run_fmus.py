"""The study's loops through FMUs: the same bits as by the kernels over runs."""

from __future__ import annotations

import numpy as np
import pytest

from gapsense import Scenario
from gapsense.fmi.components import load_component, own
from gapsense.scenarios.run_to_run.chain import Running
from gapsense.scenarios.run_to_run.conditions import CONDITIONS, samples
from gapsense.scenarios.run_to_run.loops import loop_of

HELD_OUT, CYCLES, SEEN = 6, 8, ("plant.position", "plant.mode", "plant.current")
COMMAND = "command.voltage"
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
    with scenario(fmus, law, loop, cycles * condition.period, condition) as made:
        found = made.run()
    for name in SEEN:
        np.testing.assert_array_equal(found[name][1:], expected[name])


def scenario(fmus, law, loop, stop, condition):
    """The loop as a scenario."""
    made = Scenario(f"{law} through FMUs", fmus=fmus, stop=stop, base_step=condition.sample_time)
    wave = {"waveform": "square", "square.amplitude": 1.0, "square.period": condition.period}
    wave["square.duty"] = condition.closed / condition.period
    made.add("command", "DriveVoltage", wave, enable=1.0, reference=0.0)
    names = [part.name for part in loop.chain.parts if part.name in FMUS]
    for name in names:
        made.add(name, load_component(own(FMUS[name])).name, told(name, loop))
    wires = {
        "plant.voltage": "drive.voltage_mean",
        "law.voltage": "drive.voltage_mean",
        "law.command": COMMAND,
    }
    wires |= {"law.current": "sensor.current_measured", "sensor.voltage": "drive.voltage_mean"}
    wires |= {f"sensor.{signal}": f"plant.{signal}" for signal in ("current", "position", "mode")}
    if law == "model":
        heard = loop.chain.parts[-1].wires
        wires |= {f"law.{name}": source for name, source in heard.items() if str(source).startswith("mhe.")}
        wires |= {f"mhe.{name}": wires[f"law.{name}"] for name in ("voltage", "current", "command")}
    else:
        wires["law.mode"] = "sensor.mode_measured"
    unwired = [p.name for p in load_component(own("run_to_run")).of("input") if f"law.{p.name}" not in wires]
    for name in unwired:
        made.set(f"law.{name}", float(name == "enable"))
    for target, source in wires.items():
        made.connect(source, target, **({"factor": 1.0, "unit": "1"} if source == COMMAND else {}))
    made.set("drive.enable", 1.0).connect("law.voltage_reference", "drive.reference", delayed=True)
    return made.record(*SEEN)


def told(name, loop):
    """Parameters of a part by the names of its FMU."""
    ports = [p for p in load_component(own(FMUS[name])).of("parameter") if not p.columns]
    return {port.name: value(port, loop.par[f"{name}.{port.field}"]) for port in ports}


def value(port, column):
    number = float(column[0, 0])
    if port.choices:
        return port.choices[round(number)]
    return {"Boolean": bool, "Integer": round}.get(port.kind, float)(number)
