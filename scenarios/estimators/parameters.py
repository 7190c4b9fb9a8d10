"""What the estimators of the scenario `estimators` know of the valve of [RTS], each in its own terms, right or wrong.

All follow from one set of numbers: Table I, and the core of the reduced model as `gapsense study reduced-fit` finds it.
`HybridEkf` knows pot magnets only: a gap reluctance that is linear in the gap, no saturation, no damping, and a load
that is the same everywhere.  It is given the magnet that is most like the valve.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gapsense.actuators import magnetics
from gapsense.actuators.magnetics import fringing
from gapsense.estimators.hybrid_ekf import MU_0
from gapsense.studies.devices import RTS_VALVE
from gapsense.studies.devices import VALVE as SEMERA_VALVE

Floats = NDArray[np.float64]
KNOTS = 19  # of the gap table, as in [UKF]
PERMEABILITY = 200.0  # of the magnet that stands for the valve; only its ratio to the core's length matters
CORE_SHARE = 0.798  # of saturation: explains the currents in the motions of the scenario's first cycle best


class Valve(NamedTuple):
    """The valve without hysteresis and eddy currents, as its estimators believe it to be."""

    resistance: float = RTS_VALVE.coil_resistance
    turns: float = RTS_VALVE.coil_turns
    lower: float = RTS_VALVE.stop_lower
    upper: float = RTS_VALVE.stop_upper
    mass: float = RTS_VALVE.mover_mass
    stiffness: float = RTS_VALVE.spring_stiffness
    rest: float = RTS_VALVE.spring_rest
    damping: float = RTS_VALVE.damping
    core: float = 1.402 * RTS_VALVE.coil_turns**2  # R_c0 by the reduced fit [1/H]
    saturation: float = 24.71e-3  # lambda_sat by the same [Wb]
    gap: float = 1.0  # factor of the gap reluctance
    slope: float = RTS_VALVE.gap_slope
    fringing: float = RTS_VALVE.gap_fringing
    window: float = RTS_VALVE.gap_window


class Core(NamedTuple):
    """The core of the valve with hysteresis and eddy currents; fields are ports of the group `core`."""

    reluctance: float  # R_c0 [1/H]
    saturation: float  # [Wb]
    bend: float  # K [1/H]
    eddy: float  # g_e [S]
    hysteresis: float  # I_h [A]
    turnover: float  # l_h [Wb]


VALVE = Valve()
# By `studies.estimators.core`:
CORE = Core(reluctance=1.5e6, saturation=27.67e-3, bend=8.32e6, eddy=1.011e-3, hysteresis=9.83e-3, turnover=2.24e-3)
DEVICES = {  # others, by variant, that the estimators are told of; their iron is the same
    "other_gap": VALVE._replace(lower=0.2e-3, upper=1e-3, slope=6e10, fringing=150.0, window=6e-3),
    "other_table": VALVE._replace(
        resistance=SEMERA_VALVE.coil_resistance,
        turns=SEMERA_VALVE.coil_turns,
        lower=0.1e-3,  # no printed stop: the lower one is the pole face, where no fringing law holds
        upper=SEMERA_VALVE.stop_upper,
        mass=SEMERA_VALVE.mover_mass,
        stiffness=SEMERA_VALVE.spring_stiffness,
        rest=SEMERA_VALVE.spring_rest,
        damping=SEMERA_VALVE.damping,
        slope=1.0 / (magnetics.MU_0 * SEMERA_VALVE.gap_area),
        fringing=SEMERA_VALVE.gap_area**-0.5,
        window=2.0 * SEMERA_VALVE.gap_window,
    ),
}


def plant(v: Valve) -> dict[str, float]:
    """Parameters of `ReluctanceActuator` but for its iron."""
    law = {"gap.slope": v.slope, "gap.fringing": v.fringing, "gap.window": v.window}
    device = {name: value for name, value in mechanics(v).items() if name != "core.saturation"}
    return {**device, **law, "coil.turns": v.turns, "initial.position": v.upper}


def gap_law(z: float, valve: Valve) -> tuple[float, float]:
    """Reluctance of a gap and its derivative."""
    R, rate, _ = fringing(z, valve.slope, valve.fringing, valve.window)
    return valve.gap * R, valve.gap * rate


def gap_table(valve: Valve = VALVE) -> tuple[Floats, Floats, Floats]:
    """Gaps between the stops, reluctances and derivatives, for `BoundedUkf`."""
    gaps = np.linspace(valve.lower, valve.upper, KNOTS)
    R, rate = np.array([gap_law(float(z), valve) for z in gaps]).T
    return gaps, R, rate


def wrong(e: ArrayLike) -> Valve:
    """The valve with relative errors of m, k_sp, z_sp, c_f, R_c0, lambda_sat, R_g and R; z_sp from the lower stop."""
    factors = (1.0 + np.asarray(e, float)).tolist()
    names = ("mass", "stiffness", "rest", "damping", "core", "saturation", "gap", "resistance")
    changed = {name: getattr(VALVE, name) * factor for name, factor in zip(names, factors)}
    return VALVE._replace(**{**changed, "rest": VALVE.lower + (VALVE.rest - VALVE.lower) * factors[2]})


def reduced(v: Valve) -> dict[str, float]:
    """Parameters of `Ekf` and `Ertss`."""
    law = {"gap.slope": v.slope * v.gap, "gap.fringing": v.fringing, "gap.window": v.window}
    return {**mechanics(v), "core.reluctance": v.core, "coil.turns": v.turns, **law}


def blind(v: Valve) -> dict[str, float]:
    """Parameters of `Mhe`: those of `Ekf`, and guesses of the losses that it learns."""
    return {**reduced(v), "core.eddy": 0.5e-3, "core.hysteresis": 5e-3, "core.turnover": 0.07 * v.saturation}


def tabulated(v: Valve) -> dict[str, float]:
    """Parameters of `BoundedUkf`.

    Its table is a file.  A factor of the reluctance is one of N^2 the other way round, in all that the filter computes
    from reluctances; that of the core must not change.
    """
    coil_and_core = {"core.reluctance": v.core / v.gap, "coil.turns": v.turns / math.sqrt(v.gap)}
    return {**mechanics(v), **coil_and_core, "prior.position": v.upper}


def reduced_core(v: Valve) -> dict[str, float]:
    """Parameters of `Ekf` and `Ertss` that know the losses of the core."""
    return {**reduced(v), **core(v)}


def tabulated_core(v: Valve) -> dict[str, float]:
    """Parameters of `BoundedUkf` that knows them."""
    known = core(v)
    reluctances = {name: known[name] / v.gap for name in ("core.reluctance", "core.bend")}
    return {**tabulated(v), **known, **reluctances}


def core(v: Valve) -> dict[str, float]:
    """`CORE`, its reluctances and its saturation as wrong as those of the valve."""
    believed = CORE._replace(
        reluctance=CORE.reluctance * (v.core / VALVE.core),
        bend=CORE.bend * (v.core / VALVE.core),
        saturation=CORE.saturation * (v.saturation / VALVE.saturation),
    )
    return {f"core.{name}": value for name, value in believed._asdict().items()}


def mechanics(v: Valve) -> dict[str, float]:
    """What the models of [RTS] and [UKF] have in common."""
    return {
        "coil.resistance": v.resistance,
        "mover.mass": v.mass,
        "spring.stiffness": v.stiffness,
        "spring.rest": v.rest,
        "damping": v.damping,
        "core.saturation": v.saturation,
        "stop.lower": v.lower,
        "stop.upper": v.upper,
    }


def magnet(v: Valve) -> dict[str, float]:
    """Parameters of `HybridEkf`: the pot magnet that is most like the valve.

    Its gap reluctance is the chord between the stops, and so is the force, (10) and (14); what the valve has at the
    lower stop, and a core at `CORE_SHARE` of saturation, is in the length of the field lines; the spring at half stroke
    is its weight.
    """
    (low, _), (high, _) = gap_law(v.lower, v), gap_law(v.upper, v)
    stroke = v.upper - v.lower
    area = 2.0 * stroke / (MU_0 * (high - low))
    closed = low + v.core / (1.0 - CORE_SHARE)
    return {
        "coil.resistance": v.resistance,
        "coil.resistance_upper": v.resistance,
        "core.length": closed * PERMEABILITY * MU_0 * area,
        "pole.area": area,
        "coil.turns": v.turns,
        "stop.upper": stroke,
        "mover.mass": v.mass,
        "gravity": v.stiffness * (v.rest - v.lower - 0.5 * stroke) / v.mass,
    }


def coil(v: Valve) -> dict[str, float]:
    """Parameters of `Semera` and `IntegralEstimator`: resistance, and inductance at the upper stop."""
    return {"prior.resistance": v.resistance, "prior.inductance": v.turns**2 / (gap_law(v.upper, v)[0] + v.core)}
