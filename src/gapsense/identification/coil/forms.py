"""The forms of the model of a coil, each with some of the parts that a core may add, and where their parameters lie."""

from __future__ import annotations

from itertools import combinations
from typing import NamedTuple

from gapsense.identification.coil.device import FAR, Parameters

ALWAYS = ("resistance", "air")
PARTS = {"core": ("core", "saturation"), "eddy": ("eddy",), "hysteresis": ("hysteresis", "turnover")}
WORDS = {"core": "saturation", "eddy": "eddy currents", "hysteresis": "hysteresis"}


class Form(NamedTuple):
    """Some of the parts."""

    parts: tuple[str, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Fields of the device that are fitted."""
        return (*ALWAYS, *(name for part in self.parts for name in PARTS[part]))

    @property
    def words(self) -> str:
        """What it is called."""
        return " + ".join(WORDS[part] for part in self.parts) or "constant inductance"


FORMS = [Form(parts) for count in range(len(PARTS) + 1) for parts in combinations(PARTS, count)]  # plain ones first
RICHEST = FORMS[-1]


class Scale(NamedTuple):
    """What records have without any model."""

    resistance: float  # (23) [ohm]
    inductance: float  # of the nearest coil of constant inductance [H]
    current: float  # largest [A]
    flux_linkage: float  # largest [Wb]


class Range(NamedTuple):
    """Where a parameter is sought."""

    start: float
    low: float
    high: float


def ranges(s: Scale) -> dict[str, Range]:
    """Ranges by field: a bend far beyond the flux linkage, or a turnover beyond it, is not seen."""
    R, r, lam = s.resistance, 1.0 / s.inductance, s.flux_linkage
    return {
        "resistance": Range(R, R / 3.0, 3.0 * R),
        "air": Range(0.8 * r, 0.02 * r, 5.0 * r),
        "core": Range(0.2 * r, 1e-3 * r, 5.0 * r),
        "saturation": Range(2.0 * lam, 1.02 * lam, 3.0 * lam),
        "eddy": Range(0.01 / R, 1e-4 / R, 1.0 / R),
        "hysteresis": Range(0.02 * s.current, 1e-4 * s.current, 2.0 * s.current),
        "turnover": Range(0.3 * lam, 0.02 * lam, lam),
    }


def without_parts(s: Scale, sample_time: float) -> Parameters:
    """The coil of constant inductance, to which forms add."""
    turnover = ranges(s)["turnover"].start
    return Parameters(
        sample_time=sample_time,
        resistance=s.resistance,
        air=1.0 / s.inductance,
        core=0.0,
        saturation=FAR,
        eddy=0.0,
        hysteresis=0.0,
        turnover=turnover,
    )
