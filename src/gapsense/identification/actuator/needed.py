"""What commissioning has to be told, and how wrong what it is not told may be."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from gapsense.estimators.mhe.model import Parameters
from gapsense.estimators.reduced_model import GapLaw
from gapsense.identification.actuator.file import PORTS
from gapsense.identification.assumptions import scale

STOPS, MOVER = ("stop.lower", "stop.upper"), ("mover.mass", "spring.stiffness", "spring.rest", "damping")
COIL = ("coil.resistance", "coil.turns", "core.reluctance", "core.saturation")  # losses need no more than a guess
GAPS = {GapLaw.fringing: ("gap.slope", "gap.fringing", "gap.window"), GapLaw.table: ("gap.file",)}
LEAST = 0.5  # of a logarithm
FITTED_AS = {
    "gap.slope": ("gap_factor",),
    "gap.file": ("gap_factor",),
    "core.reluctance": ("core_reluctance", "core_bend"),
    "core.saturation": ("core_saturation", "core_bend"),
}


def missing(known: Parameters, given: Collection[str]) -> list[str]:
    """Names of what is needed and was not given."""
    return [n for n in (*STOPS, *COIL, *MOVER, *GAPS[GapLaw(int(known.gap_law))]) if n not in given]


def doubts(names: Sequence[str]) -> dict[str, float]:
    """Deviations of the fields that go with assumed parameters; a factor also where nothing but a part is known."""
    fields = {port.name: (field,) for field, port in PORTS.items()} | FITTED_AS
    return {field: max(scale(name).doubt, LEAST) for name in names for field in fields[name]}
