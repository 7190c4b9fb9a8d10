"""Valves nobody has seen: every parameter, the losses, the drive, the noise and the converter follow from a seed.

A user knows the stops, the relaxed spring and the mean slope of the gap; first guesses are those of the papers' valve.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from lossy_records import gap_law, simulated
from valve_records import DT

from gapsense.actuators.magnetics import MU_0
from gapsense.actuators.solenoid_valve import GapLaw, Parameters
from gapsense.identification.measurements.record import Columns, Record, to_record
from gapsense.identification.valve import lossy_valve
from gapsense.studies.devices import VALVE

VARIED = (
    *("coil_resistance", "coil_turns", "core_reluctance", "core_saturation", "mover_mass", "damping"),
    *("spring_stiffness", "stop_upper", "gap_area", "gap_window"),
)
KNOWN = ("gap_window", "stop_lower", "stop_upper", "spring_rest", "initial_position")
EDDY, HYSTERESIS = (0.005, 0.3), (0.01, 0.15)  # R g_e; I_h, of the largest current
REST = 30  # samples before the first edge


class Case(NamedTuple):
    """A valve, what its user knows, and records of it."""

    truth: lossy_valve.Parameters
    known: Parameters
    records: list[Record]

    @property
    def added(self) -> set[str]:
        """What it has more than the plain form."""
        sizes = {"eddy": self.truth.core_eddy, "hysteresis": self.truth.core_hysteresis}
        return {name for name, x in {**sizes, "fringing": self.truth.valve.gap_law}.items() if x}


def case(seed: int) -> Case:
    """The case of a seed: of all eight forms one, by the seed."""
    rng, form = np.random.default_rng(9000 + seed), seed % 8
    while True:
        par = valve(rng, has_fringes=bool(form & 4))
        volts = np.sort(rng.uniform(1.5, 3.5, 2))[::-1] * threshold(par)
        largest = volts[0] / par.coil_resistance
        truth = lossy_valve.Parameters(
            valve=par,
            core_eddy=float(form & 1) * between(rng, EDDY) / par.coil_resistance,
            core_hysteresis=float(form & 2) / 2.0 * between(rng, HYSTERESIS) * largest,
            core_turnover=rng.uniform(0.05, 0.15) * par.core_saturation,
            coil_factor=1.0,
        )
        quality = between(rng, (3e-3, 1e-2)), int(rng.integers(8, 13))
        counts = rng.integers(2, 4, 2).tolist()
        records = [record(truth, v, count, rng, quality, k) for k, (v, count) in enumerate(zip(volts, counts))]
        if all(np.ptp(each.position) > 0.99 * par.stop_upper for each in records):
            break
    known = VALVE._replace(**{name: getattr(par, name) for name in KNOWN})
    return Case(truth, known._replace(gap_slope=gap_law(par.stop_upper, par)[0] / par.stop_upper), records)


def between(rng, limits):
    """A size between two, as likely in each decade."""
    return float(np.exp(rng.uniform(*np.log(limits))))


def valve(rng, has_fringes: bool) -> Parameters:
    """All parameters 30 % off; it is open at rest."""
    par = VALVE._replace(**{name: getattr(VALVE, name) * rng.uniform(0.7, 1.3) for name in VARIED})
    slope = 1.0 / (MU_0 * par.gap_area)
    rest = par.stop_upper * VALVE.spring_rest / VALVE.stop_upper
    law = GapLaw.fringing if has_fringes else GapLaw.linear
    return par._replace(gap_slope=slope, gap_law=law, spring_rest=rest, initial_position=par.stop_upper)


def threshold(par: Parameters) -> float:
    """Voltage that just lifts the mover in the end, without fringes [V]."""
    force = par.spring_stiffness * (par.spring_rest - par.stop_upper)
    flux = np.sqrt(2.0 * abs(force) / par.gap_slope)
    return float(flux / par.coil_turns * (par.core_reluctance + par.gap_slope * par.stop_upper) * par.coil_resistance)


def record(truth, volts, count, rng, quality, k) -> Record:
    """Pulses of one height; their lengths and pauses differ."""
    noise, bits = quality
    lengths, pauses = rng.uniform(4e-3, 7e-3, count), rng.uniform(11e-3, 13e-3, count)
    ends = np.cumsum(lengths + pauses)
    n = REST + round(ends[-1] / DT)
    t = (np.arange(2 * n) - 2 * REST + 1) * DT / 2.0
    begins = ends - lengths - pauses
    is_on = np.any(
        [(t - DT / 4.0 > a) & (t - DT / 4.0 < a + x) for a, x in zip(snapped(begins), snapped(lengths))], axis=0
    )
    current, position = simulated(np.where(is_on, volts, 0.0).tolist(), truth.valve, truth[1:4], DT)
    at = t[::2]
    voltage = np.where(
        np.any([(at > a) & (at < a + x) for a, x in zip(snapped(begins), snapped(lengths))], axis=0), volts, 0.0
    )
    measured = {"voltage": voltage + 1e-3 * volts * rng.standard_normal(n)}
    measured["current"] = current + noise * current.max() * rng.standard_normal(n)
    values = {name: converted(x, bits) for name, x in measured.items()}
    columns = {"time": at - at[0], **values, "position": position}
    return to_record(Columns(f"random{k}.csv", np.arange(n) + 2, columns))


def snapped(times):
    """Half-way between two samples."""
    return np.round(np.asarray(times) / DT) * DT


def converted(x, bits):
    """By a bipolar converter that is used to 80 %."""
    step = 2.0 * np.abs(x).max() / 0.8 / 2**bits
    return step * np.round(x / step)
