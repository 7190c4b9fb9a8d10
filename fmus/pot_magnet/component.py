"""The pot magnet as an FMU."""

from gapsense.actuators import pot_magnet
from gapsense.fmi.ports import Component, Limit
from gapsense.kernels.interface import ports_of

# Terms of R / L with the armature at the lower stop, over mu_0 and, for the gap, over 2: below 0.48e6 / s each.
CORE = (("core.length", 1), ("coil.turns", -2), ("core.permeability", -1), ("pole.area", -1))
GAP = (("stop.upper", 1), ("coil.turns", -2), ("pole.area", -1))
FAST = "the coil would settle within microseconds, and be integrated in steps of nanoseconds"
RESISTANCES = ("coil.resistance", "coil.resistance_upper")

COMPONENT = Component(
    name="PotMagnet",
    description="Pot magnet that lifts its armature against gravity, with five modes",
    kernel=pot_magnet.__name__,
    ports=ports_of(pot_magnet),
    stop_time=0.2,
    step_size=100e-6,
    limits=tuple(Limit((*term, (R, 1)), below, FAST) for R in RESISTANCES for term, below in ((CORE, 0.6), (GAP, 0.3))),
)
