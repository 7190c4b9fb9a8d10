"""What an estimator is told of the core: what ten cycles of one nominal actuator of the type have taught it.

No data sheet has these numbers, and those of another actuator of the same type are as far off as its other parameters.
"""

from __future__ import annotations

from typing import NamedTuple

from ..estimators.parameters import VALVE


class Core(NamedTuple):
    """Of the model of `Mhe`, over N^2."""

    reluctance: float  # R_c [1/H]
    knee: float  # b [A]
    saturation: float  # lambda_sat [Wb]
    eddy: float  # g_e [S]
    hysteresis: float  # I_h [A]


CORES = {
    "reluctance_actuator": Core(reluctance=0.486, knee=0.186, saturation=0.0282, eddy=0.974e-3, hysteresis=8.05e-3),
    "play_actuator": Core(reluctance=1.94, knee=0.0799, saturation=0.0244, eddy=0.814e-3, hysteresis=13.3e-3),
}


def core(plant: str) -> dict[str, float]:
    """The flat parameters of `Mhe` for the core of a plant."""
    c, squared_turns = CORES[plant], VALVE.turns**2
    return {
        "core_reluctance": c.reluctance * squared_turns,
        "core_bend": c.knee * squared_turns / c.saturation,
        "core_saturation": c.saturation,
        "core_eddy": c.eddy,
        "core_hysteresis": c.hysteresis,
    }
