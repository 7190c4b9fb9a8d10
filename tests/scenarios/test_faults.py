"""Faults of a coil against its kernel in a plain loop, and a run with events that goes on from a checkpoint."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gapsense import Scenario
from gapsense.cosim import Checkpoint, FmuError, Master, prepare, read_result, run
from gapsense.cosim.run.apart import Listeners, Plan, record_apart
from gapsense.cosim.run.checkpoint import keeper
from gapsense.cosim.run.recording import Subject
from gapsense.cosim.scenario.read import Document, read_document
from gapsense.fmi.components import kernel_of, kernel_parameters, load_component
from gapsense.tables import merge_tables

ROOT = Path(__file__).resolve().parents[2]
FAULTS = ROOT / "scenarios" / "faults"
VOLTAGE, STEP, COUNT = 30.0, 25e-6, 400


@pytest.fixture(scope="module")
def fmus(natives):
    """Native ones, which have the bits of the Python ones in all scenarios: tests/native/test_scenarios.py."""
    return natives


def valve(fmus, name="SolenoidValve", step=STEP, **values):
    """A valve that is switched on at the start."""
    scenario = Scenario("coil", fmus=fmus, stop=COUNT * STEP, base_step=step)
    scenario.add("valve", name, values).set("valve.voltage", VOLTAGE)
    return scenario


def by_hand(resistances):
    """Current and position of the kernel, step by step, with the resistance of each step."""
    folder = ROOT / "fmus" / "solenoid_valve"
    component = load_component(folder)
    kernel, par = kernel_of(component).scalar, [*kernel_parameters(folder, {})]
    outputs = [port.name for port in component.of("output")]
    state, row = kernel["initial"]([0.0, 0.0, VOLTAGE], par)
    rows = [row]
    for k, par[0] in enumerate(resistances, start=1):  # the first one is that of the coil
        state, row = kernel["step"](state, [k * STEP, STEP, VOLTAGE], par)
        rows.append(row)
    return dict(zip(outputs, np.array(rows).T))


def test_warming_coil_is_the_kernel_with_the_resistance_of_each_step(fmus):
    result = valve(fmus).event("warm", "valve.coil.resistance", "ramp", value=95.0, over=6e-3, at=2e-3).run()
    shares = [min(1.0, max(0, k - 80) / 240) for k in range(COUNT)]
    expected = by_hand([76.0 + share * (95.0 - 76.0) for share in shares])
    assert all(result[f"valve.{name}"].tobytes() == values.tobytes() for name, values in expected.items())
    assert result["valve.current"][-1] == pytest.approx(VOLTAGE / 95.0, rel=1e-2)


def test_shorted_coil_decays_with_its_resistance(fmus):
    """The flux linkage falls by what the resistance takes, and nothing is supplied."""
    fine = STEP / 10
    result = valve(fmus, step=fine).event("short", "valve.voltage", "set", value=0.0, at=5e-3).run()
    k = slice(1999, None)  # a Gauss-Seidel step takes the input of the base step at which it ends
    i, flux = result["valve.current"][k], result["valve.flux_linkage"][k]
    lost = np.cumsum(76.0 * fine * 0.5 * (i[:-1] + i[1:]))
    assert i[0] > 0.3 and i[400] < 0.2 * i[0]
    np.testing.assert_allclose(lost[:400], (flux[0] - flux[1:])[:400], rtol=3e-4)  # of the trapezoids
    assert np.ptp(result["valve.supplied_energy"][k]) == 0.0


@pytest.mark.parametrize(("resistance", "share"), [(10e3, 1e-6), (100e3, 2e-3)])
def test_open_coil_loses_its_current_at_once_and_no_energy(fmus, resistance, share):
    """What was stored is dissipated; the balance closes to a share of it that grows with the resistance."""
    result = valve(fmus).event("open", "valve.coil.resistance", "set", value=resistance, at=5e-3).run()
    i, k = result["valve.current"], 200
    stored = 0.5 * i[k] * result["valve.flux_linkage"][k]
    balance = result["valve.supplied_energy"] - result["valve.dissipated_energy"] - result["valve.stored_energy"]
    assert i[k] > 0.3 and np.isfinite(i).all()
    assert abs(i[k + 1]) < 0.03 and i[-1] == pytest.approx(VOLTAGE / resistance, rel=0.02)
    assert np.ptp(balance) < share * stored


def test_open_coil_with_eddy_currents_keeps_its_flux_longer_than_its_current(fmus):
    scenario = valve(fmus, "ReluctanceActuator")
    result = scenario.event("open", "valve.coil.resistance", "set", value=100e3, at=5e-3).run()
    after = 202
    assert abs(result["valve.current"][after]) < 0.01 * result["valve.current"][200]
    assert result["valve.flux_linkage"][after] > 0.4 * result["valve.flux_linkage"][200]


# Checkpoints ----------------------------------------------------------------------------------------------------------

EVENTS = {
    "offset": {"target": "semera.current", "action": "bias", "value": 0.01, "at": 1.99e-3, "over": 4e-3},
    "burst": {"target": "sensor.current_measured", "action": "noise", "value": 0.02, "at": 2.99e-3, "until": 6.99e-3},
    "stuck": {"target": "mhe.voltage", "action": "stuck", "at": 3.49e-3, "until": 5.99e-3},
    "warm": {"target": "actuator.coil.resistance", "action": "ramp", "value": 60.0, "over": 6e-3, "at": 0.99e-3},
    "lost": {
        "target": "ertss.current",
        "action": "dropout",
        "duration": 0.4e-3,
        "when": {"signal": "actuator.current", "above": 0.2, "for": 3e-3},
    },
}


@pytest.mark.parametrize("every", [251, pytest.param(340, marks=pytest.mark.slow)])
def test_run_with_events_goes_on_with_the_same_bits(fmus, tmp_path, every):
    """Events of all kinds are on, and a condition is counting, where it was saved."""
    document = read_document(FAULTS, [])
    data = merge_tables(
        {**document.data, "metrics": {}, "variants": {}}, {"events": EVENTS, "record": {"signals": ["*"]}}
    )
    scenario, descriptions = prepare(Document(document.path, data), None, fmus)
    scenario = replace(scenario, experiment=replace(scenario.experiment, count=450))
    take = Subject(scenario, descriptions).make_take()
    file, base = tmp_path / "run.checkpoint", scenario.experiment.base_step
    with Master(scenario, descriptions) as master:
        kept = keeper(Checkpoint(file, every * base), scenario, descriptions, take)
        whole = master.run(take.columns, take.seeds, values=take.values, keeper=kept)
    kept = keeper(Checkpoint(file, resume=True), scenario, descriptions, take)
    resumed = record_apart(Plan(scenario, descriptions, take, kept), Listeners(None, print))
    assert not whole.error and not resumed.error
    assert whole.data[: whole.rows].tobytes() == resumed.data[: resumed.rows].tobytes()
    assert whole.events == resumed.events
    assert {name for name, *_ in whole.events} == set(EVENTS)
    assert any(begin <= every and (end is None or end > every) for _, begin, end in whole.events)


def test_result_tells_its_events_after_it_was_saved(fmus, tmp_path):
    result = run(FAULTS, "dropout", fmus, isolation="process")
    assert [(s.name, s.target, s.action) for s in result.events] == [("lost", "sensor.current_measured", "dropout")] * 2
    assert [round(1e3 * s.begin, 2) for s in result.events] == [40.03, 60.03]
    assert read_result(result.save(tmp_path / "faults.csv")).events == result.events


def test_component_that_takes_no_nan_is_told_with_the_event(fmus):
    scenario = valve(fmus).event("lost", "valve.voltage", "dropout", at=1e-3)
    with pytest.raises(FmuError) as caught:
        scenario.run()
    assert str(caught.value).startswith("valve, t = 0.000975 s (base step 40): fmi2DoStep returned fmi2Error")
    assert str(caught.value).endswith("Event `lost` gives it NaN. If it does not accept NaN, use `stuck`.")
    assert caught.value.result.events[0].begin == 1e-3
