"""Tables of a solenoid that is none of ours, as programs for finite elements write them; solved apart from the package.

The flux phi of the coil passes a yoke and splits into a leak and the armature with its gap.  Both iron parts have a
field sinh(1.7 phi/b) that no law of the package has, so that the reduced model is wrong by what passes the leak.  The
force is -dR/dh phi_a^2/2 of the flux phi_a that passes the gap.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq


class Magnet(NamedTuple):
    """Turns, areas and lengths; flux densities at which the iron bends."""

    turns: float = 900.0
    area: float = 60e-6  # of the pole [m2]
    fringe: float = 4e-3  # how far the flux spreads [m]
    rest: float = 40e-6  # gap that is left when the pole is closed [m]
    leak: float = 1.2e-7  # permeance beside the gap [H]
    yoke: float = 9.5e-5  # flux at which its reluctance has grown by half [Wb]
    armature: float = 8.0e-5
    iron: float = 2.0e5  # reluctance of each part without flux [1/H]

    def gap(self, h):
        """Reluctance of the gap, and its derivative."""
        length, mu = h + self.rest, 4e-7 * np.pi
        wide = self.area * (1.0 + length / self.fringe)
        return length / (mu * wide), self.area / (mu * wide**2)

    def drop(self, flux, bend):
        """Magnetomotive force along an iron part."""
        return self.iron * bend * np.sinh(np.minimum(1.7 * flux / bend, 300.0)) / 1.7

    def solve(self, current, h):
        """Flux linkage and force."""
        R, slope = self.gap(h)

        def left(armature):
            along = R * armature + self.drop(armature, self.armature)
            return along + self.drop(armature + self.leak * along, self.yoke) - self.turns * current

        phi = brentq(left, 0.0, 1e-3, xtol=1e-18, rtol=1e-14)
        total = phi + self.leak * (R * phi + self.drop(phi, self.armature))
        return self.turns * total, -0.5 * slope * phi**2


GAPS = np.linspace(0.1e-3, 2.1e-3, 11)
CURRENTS = np.linspace(0.0, 1.5, 13)


MAGNET = Magnet()


def solved(gaps=GAPS, currents=CURRENTS, magnet=MAGNET):
    """Columns by name, on a grid, in SI units."""
    h, i = (x.ravel() for x in np.meshgrid(gaps, currents, indexing="ij"))
    return columns(h, i, magnet)


def columns(h, i, magnet=MAGNET):
    """Columns at some points."""
    lam, F = np.array([magnet.solve(b, a) if b else (0.0, 0.0) for a, b in zip(h, i)]).T
    return {"gap": h, "current": i, "flux_linkage": lam, "force": F}


UNITS = {"gap": ("mm", 1e3), "current": ("A", 1.0), "flux_linkage": ("mWb", 1e3), "force": ("N", 1.0)}
UNITS |= {"inductance": ("mH", 1e3), "flux": ("uWb", 1e6)}


def write(file: Path, table, separator=",", decimal="."):
    """A CSV file with units in its heads."""
    heads = separator.join(f"{name} [{UNITS[name][0]}]" for name in table)
    rows = np.column_stack([UNITS[name][1] * np.asarray(x) for name, x in table.items()])
    lines = [separator.join(f"{x:.9g}".replace(".", decimal) for x in row) for row in rows]
    file.write_text("\n".join([heads, *lines]) + "\n", encoding="utf-8")
    return file
