"""Records of a lifting magnet by another's network: five pieces of steel, a pole whose side leaks, elastic stops.

The steel has a permeability that rises with the flux density before it falls, and the leak beside the gap a logarithm
of its own.  A spring holds the mover at the open stop; stops are those of `TableActuator`, on which it bounces.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np
from c_code import driven
from scipy.optimize import brentq

from gapsense.actuators import table_actuator
from gapsense.actuators.table_actuator import Parameters
from gapsense.estimators.mhe import mhe
from gapsense.fmi.components import kernel_parameters, own
from gapsense.identification.measurements.record import Columns, Record, to_record

MU_0, TURNS, RADIUS = 4e-7 * np.pi, 957.0, 5e-3
POLE = np.pi * RADIUS**2
IRON = (  # length and area
    (31.5e-3, np.pi * (15e-3**2 - 13.5e-3**2)),
    (22.4e-3, POLE),
    (6.5e-3, POLE),
    (8.5e-3, np.pi * 3.5e-3 * 18.5e-3),
    (7.85e-3, np.pi * 3.5e-3 * 19.15e-3),
)
SLIDE = 1.0 / (2.0 * np.pi * MU_0 * 3.5e-3 / np.log(5.65 / 5.0) + MU_0 * 33.5e-3 * (0.52 + 2.0 * np.log(9.0) / np.pi))
NOISE, DT, FINE = 6e-3, 50e-6, 10e-6


def field(B: float) -> float:
    """Of the steel [A/m]."""
    b = B / 1.488
    return B / MU_0 / (1.0 + (399.0 + 1200.0 * b) / (1.0 + 3.0 * b + b**12.5))


def working(h: float) -> float:
    """Reluctance of the gap with the leak beside it."""
    return 1.0 / (MU_0 * POLE / h + MU_0 * 13e-3 * np.log(1.0 + 0.5 * np.pi * 3e-3 / h))


def current(h: float, lam: float) -> float:
    """Static [A]."""
    flux = lam / TURNS
    return ((working(h) + SLIDE) * flux + sum(length * field(flux / area) for length, area in IRON)) / TURNS


def static(h: float, amperes: float) -> tuple[float, float]:
    """Flux linkage and force at a current."""
    lam, way = float(brentq(lambda x: current(h, x) - amperes, 0.0, 0.5)), 1e-8
    slope = (working(h + way) - working(h - way)) / (2.0 * way)
    return lam, -0.5 * slope * (lam / TURNS) ** 2


def write(file: Path, gaps: np.ndarray, fluxes: np.ndarray, law: Callable[[float, float], float]) -> Path:
    """A map of a law for `TableActuator`."""
    rows = [f"{h:.9g},{lam:.9g},{law(h, lam):.9g}\n" for h in gaps for lam in fluxes]
    file.write_text("gap [m],flux_linkage [Wb],current [A]\n" + "".join(rows), encoding="utf-8")
    return file


class Magnet(NamedTuple):
    """A stroke, a spring for it, and how long it is switched on and off; stops without stiffness are hard."""

    stroke: float = 4.75e-3
    stiffness: float = 250.0
    rest: float = 9e-3
    half: float = 70e-3
    volts: float = 12.0
    stop: float = 4e6
    bounce: float = 0.5

    @property
    def plant(self) -> Parameters:
        """Its parameters."""
        upper = 0.25e-3 + self.stroke
        return _table(upper)._replace(
            coil_resistance=10.0, coil_turns=TURNS, core_eddy_conductance=4.4e-3 * TURNS**2, mover_mass=16e-3,
            spring_stiffness=self.stiffness, spring_rest=self.rest, damping=0.2, stop_lower=0.25e-3, stop_upper=upper,
            stop_law=float(self.stop > 0.0), stop_stiffness=self.stop, stop_damping=self.bounce,
            stop_restitution=0.0 if self.stop else self.bounce, initial_position=upper,
        )  # fmt: skip

    @property
    def set(self) -> dict[str, float | str]:
        """What a data sheet says: mechanics 5 % off, the steel and its losses guessed."""
        p, slope = self.plant, 1.0 / (MU_0 * POLE)
        return {
            "sample_time": DT, "coil.turns": TURNS, "coil.resistance": 10.3, "mover.mass": 1.05 * p.mover_mass,
            "spring.stiffness": 0.95 * p.spring_stiffness, "spring.rest": p.spring_rest, "damping": 0.22,
            "stop.lower": p.stop_lower, "stop.upper": p.stop_upper, "gap.law": "fringing", "gap.slope": slope,
            "gap.reluctance": 0.0, "gap.fringing": 1.0 / RADIUS, "gap.window": 2.0 * RADIUS,
            "core.reluctance": 5e6, "core.saturation": 0.142, "core.bend": 3e5, "core.eddy": 2e-3,
            "core.hysteresis": 5e-3, "core.turnover": 0.01,
        }  # fmt: skip

    @property
    def known(self) -> mhe.Parameters:
        """The same for `Mhe`."""
        return kernel_parameters(own("mhe"), self.set)


SHORT = Magnet(stroke=1e-3, stiffness=2000.0, rest=3.5e-3, half=60e-3)
LONG = Magnet()


@cache
def _table(upper: float) -> Parameters:
    gaps = np.linspace(0.05e-3, upper + 0.2e-3, 43)
    fluxes = np.r_[0.0:0.1:15j, 0.104:0.2:25j]
    with TemporaryDirectory() as folder:
        file = write(Path(folder) / "map.csv", gaps, fluxes, current)
        return kernel_parameters(own("table_actuator"), {"map.file": str(file)})


@cache
def run(magnet: Magnet, pulses: int = 2) -> np.ndarray:
    """Voltage, current, position of some pulses, at each fine step."""
    n = round(magnet.half / FINE)
    u = np.r_[np.zeros(200), np.tile(np.repeat([magnet.volts, 0.0], n), pulses)]
    return np.column_stack((u, driven(table_actuator, magnet.plant, u, FINE, "current", "position")))


def measured(magnet: Magnet, pulses: int = 2, seed: int = 1, name: str = "made") -> tuple[Record, np.ndarray]:
    """What instruments make of it, and the true position."""
    rng, each = np.random.default_rng(seed), round(DT / FINE)
    u, i, z = run(magnet, pulses)[each // 2 :: each].T
    values = {
        "time": DT * np.arange(u.size),
        "voltage": u + 5e-3 * rng.standard_normal(u.size),
        "current": i + NOISE * rng.standard_normal(u.size),
    }
    return to_record(Columns(f"{name}.csv", np.arange(u.size) + 2, values)), z
