"""Where between its samples the voltage of a coarse record switched, by the currents after its edges."""

from __future__ import annotations

import numpy as np
import pytest
from network_records import LONG

from gapsense.fmi.components import kernel_parameters, own
from gapsense.identification.actuator import fit
from gapsense.identification.actuator.edges import place_edges
from gapsense.identification.estimate import run_estimator, with_placed_edges
from gapsense.identification.measurements.record import Columns, to_record

FINE, EACH, REST, HALF = 10e-6, 25, 500, 4507
TOLD = {"core.eddy": 4e-3, "prior.eddy": 0.05, "prior.gap": 0.005, "prior.hysteresis": 0.3, "noise.current": 6e-3}
KNOWN = {**LONG.set, **TOLD, "window.tail": 12e-3, "window.longest": 60e-3}


def record(late, values, pulses=1):
    """Every 250 us, of the model itself; the first edge `late` fine steps after a sample; and true positions."""
    par = fit.with_bend(kernel_parameters(own("mhe"), values))._replace(sample_time=FINE)
    u = np.r_[np.zeros(REST + late), np.tile(np.repeat([12.0, 0.0], HALF), pulses)]
    i, _, z = fit.run(par, u.tolist()).T
    at, rng = slice(None, None, EACH), np.random.default_rng(late)
    u, i, z = np.r_[0.0, u][at], i[at], z[at]
    values = {"time": FINE * EACH * np.arange(u.size), "voltage": u, "current": i + 6e-3 * rng.standard_normal(u.size)}
    return to_record(Columns("x.csv", np.arange(u.size) + 2, values), "end"), z


@pytest.mark.parametrize("late", [0, 8, 20])
def test_currents_tell_where_edges_are(late, fmus):
    """Also one exactly at a sample; positions before the landing are then within 1 % of the stroke."""
    made, z = record(late, KNOWN, pulses=2)
    read = with_placed_edges(made, KNOWN)
    first = REST // EACH + 1
    assert "The currents do, to" in read.remarks[-1] and "mean voltages" in read.remarks[-1]
    assert read.is_mean and read.voltage[first] == pytest.approx(12.0 * (1.0 - late / EACH), abs=2.0)
    before = slice(first, first + int(np.argmin(z[first:])))
    off, was = (
        np.sqrt(np.mean((run_estimator(fmus / "Mhe.fmu", one, KNOWN).outputs["position"] - z)[before] ** 2))
        for one in (read, made)
    )
    assert off < min(20e-6, 0.01 * LONG.stroke) and (off < 0.5 * was or was < 20e-6)


def test_what_the_currents_do_not_tell_is_said():
    made, _ = record(0, KNOWN)
    read = with_placed_edges(made, {**KNOWN, "prior.eddy": 1.0, "prior.gap": 0.04})
    assert not read.is_mean and "Nor do the currents" in read.remarks[-1]
    assert np.array_equal(read.voltage, made.voltage)


def test_fine_records_stay_as_they_are():
    made, _ = record(0, KNOWN)
    par = kernel_parameters(own("mhe"), KNOWN)
    fine = made._replace(times=made.times / 10.0)
    assert place_edges(fine, par) is fine and place_edges(made._replace(is_mean=True), par).remarks == ()
