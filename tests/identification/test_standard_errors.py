"""What a function has found has its standard errors as data, in the units of the parameters."""

from __future__ import annotations

import numpy as np
import pytest
from coil_records import PLAIN, coil_record
from valve_records import columns, write

import gapsense
from gapsense.identification.coil.fit import fit_coil
from gapsense.studies.devices import VALVE

KNOWN = '[values]\n"coil.turns" = 1130.0\n"mover.mass" = 1.8e-3\n"damping" = 0.5\n'


def test_errors_of_a_coil_are_those_of_its_values():
    record = coil_record(seed=3)
    signals = {"time": record.times, "voltage": record.voltage, "current": record.current}
    found, coil = gapsense.identify(signals, model="coil", voltage="trapezoid"), fit_coil([record])
    assert {*found.standard_errors} == {"coil.resistance", "gap.reluctance", "prior.inductance"}
    assert found.standard_errors["coil.resistance"] == pytest.approx(
        coil.errors["resistance"] * PLAIN.resistance, rel=1e-2
    )
    for name, true in (("coil.resistance", PLAIN.resistance), ("prior.inductance", 1.0 / PLAIN.air)):
        assert abs(found.parameters[name] - true) < 4.0 * found.standard_errors[name] < 0.01 * true


def test_errors_of_a_valve_are_those_of_its_values(tmp_path):
    write(tmp_path / "valve.csv", columns(seed=1))
    (tmp_path / "known.toml").write_text(KNOWN)
    options = {"model": "solenoid_valve", "voltage": "trapezoid", "forms": "plain", "starts": 1, "assume": True}
    options |= {"driver": "series=0"}  # the voltage is that of the coil
    found = gapsense.identify(tmp_path / "valve.csv", parameters=tmp_path / "known.toml", **options)
    true = {name: getattr(VALVE, name.replace(".", "_")) for name in found.standard_errors}
    assert {*true} >= {"coil.resistance", "coil.turns", "core.reluctance", "spring.stiffness", "damping", "mover.mass"}
    for name, value in true.items():
        assert abs(found.parameters[name] - value) < 4.0 * found.standard_errors[name], name
    assert 0.0 < found.standard_errors["coil.resistance"] < 1e-3 * VALVE.coil_resistance
    assert np.isfinite([*found.standard_errors.values()]).all()
