"""The devices of the papers for Python, from the port tables in fmus/, so that each number stands once; their runs.

[SEMERA] does not print the resistance of its valve: Table III's 1.5 ohm is |r - 77.5 ohm|. The gap law of [RTS] is
ours.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from gapsense.actuators import reluctance_actuator, solenoid_valve
from gapsense.fmi.components import kernel_parameters, own
from gapsense.kernels.kernel import Kernel

VALVE: solenoid_valve.Parameters = kernel_parameters(own("solenoid_valve"), {})  # [SEMERA] Table I
RTS_VALVE: reluctance_actuator.Parameters = kernel_parameters(own("reluctance_actuator"), {})  # [RTS] Table I


def drive(plant: Any, par: Any, voltage: npt.NDArray[np.float64], dt: float, *names: str) -> npt.NDArray[np.float64]:
    """Outputs of an actuator at multiples of `dt` [s], one column per name; each voltage [V] is held until the next."""
    steps = ((k * dt, dt, u) for k, u in enumerate(voltage[:-1].tolist(), 1))
    _, rows = Kernel(plant).run([(0.0, 0.0, 0.0), *steps], par)
    places = [plant.Outputs._fields.index(name) for name in names]
    return np.array([[row[place] for place in places] for row in rows], dtype=float)
