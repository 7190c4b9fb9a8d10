"""One FMU on recorded signals gives the bits of its kernel."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gapsense.cosim import FmuError, ScenarioError
from gapsense.cosim.fmu.feed import feed
from gapsense.estimators import semera
from gapsense.fmi.components import load_component
from gapsense.kernels.kernel import Kernel
from gapsense.kernels.layout import names

ROOT = Path(__file__).resolve().parents[2]
DT = 50e-6


def signals(n=60):
    k = np.arange(n)
    return {"voltage": np.where(k > 5, 30.0, 0.0), "current": 0.4 * (1.0 - np.exp(-np.maximum(k - 5, 0) / 14.0))}


def test_outputs_are_those_of_the_kernel_bit_for_bit(fmus):
    component = load_component(ROOT / "fmus" / "semera")
    starts = {port.field: float(port.start) for port in component.of("parameter")}
    par = tuple({**starts, "prior_resistance": 76.0}[name] for name in names(semera.Parameters))
    code, given = Kernel(semera).scalar, signals()
    found = feed(fmus / "Semera.fmu", "s", {"prior.resistance": 76.0}, 1.0, DT, given)
    rows = list(zip(*(given[name].tolist() for name in names(semera.Inputs))))
    state, outputs = code["initial"](rows[0], par)
    for k, row in enumerate(rows):
        if k:
            state, outputs = code["step"](state, row, par)
        assert tuple(found[name][k] for name in names(semera.Outputs)) == tuple(outputs)


def test_record_plays_in_the_drive_as_it_is(fmus, tmp_path):
    given, times = signals(), np.arange(60) * DT
    rows = zip(times.tolist(), given["current"].tolist(), given["voltage"].tolist())
    lines = ["time [s],current [A],voltage [V]", *(",".join(map(repr, row)) for row in rows)]
    (tmp_path / "record.csv").write_text("\n".join(lines) + "\n")
    played = {"waveform": "table", "table.file": str(tmp_path / "record.csv")}
    found = feed(fmus / "DriveVoltage.fmu", "drive", played, 0.0, DT, {"enable": np.ones(60)})
    np.testing.assert_allclose(found["voltage"], given["voltage"], rtol=1e-9, atol=1e-6)
    (tmp_path / "record.csv").write_text("\n".join(lines).replace("[s]", "[ms]"))
    with pytest.raises(FmuError, match=r"`time` is in `ms`, but `s` is expected, and nothing is converted"):
        feed(fmus / "DriveVoltage.fmu", "drive", played, 0.0, DT, {"enable": np.ones(60)})


def test_wrong_names_and_values_are_told_at_once(fmus):
    wrong = {"prior.resistence": 1.0, "noise.current": -1.0}
    with pytest.raises(ScenarioError) as caught:
        feed(fmus / "Semera.fmu", "s", wrong, 0.0, DT, {"speed": np.zeros(3)})
    assert len(caught.value.problems) == 3
    with pytest.raises(ScenarioError, match="gapsense build"):
        feed(fmus / "None.fmu", "s", {}, 0.0, DT, signals())


def test_failure_names_the_time(fmus):
    voltage = signals()["voltage"]
    voltage[7] = np.nan  # an estimator would survive it
    with pytest.raises(FmuError, match=r"t = 0\.0003 s"):
        feed(fmus / "SolenoidValve.fmu", "s", {}, 0.0, DT, {"voltage": voltage})
