"""The devices of the papers in Python: what the port tables in fmus/ say, so that each number stands once; their runs.

[SEMERA] does not print the resistance of its valve: Table III's 1.5 ohm is |r - 77.5 ohm|.  The gap law of [RTS] is
ours.  mu_0 and l_1 of [HEKF] Table 1 are misprinted: they are 1.257e-6 H/m and 22 mm.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from gapsense.actuators import pot_magnet, reluctance_actuator, solenoid_valve
from gapsense.fmi.components import kernel_parameters, own
from gapsense.kernels.kernel import Kernel

VALVE: solenoid_valve.Parameters = kernel_parameters(own("solenoid_valve"), {})  # [SEMERA] Table I
RTS_VALVE: reluctance_actuator.Parameters = kernel_parameters(own("reluctance_actuator"), {})  # [RTS] Table I

# With the printed stroke of 0.5 mm the magnet with a force that acts where the inductance rises never lifts at 24 V: at
# 0.21 A the force is 3.19 N, the weight 3.34 N.  With 0.2 mm i_on and i_off are what the model says: it can lift from
# 0.099 A on and holds down to 0.021 A.
POT_MAGNET: pot_magnet.Parameters = kernel_parameters(own("pot_magnet"), {})  # [HEKF] Table 1
POT_MAGNET_PRINTED = POT_MAGNET._replace(orientation=pot_magnet.Orientation.printed, stop_upper=0.5e-3)


def driven(plant: Any, par: Any, voltage: npt.NDArray[np.float64], dt: float, *names: str) -> npt.NDArray[np.float64]:
    """Outputs of an actuator at multiples of `dt` [s], one column per name; each voltage [V] is held until the next."""
    steps = ((k * dt, dt, u) for k, u in enumerate(voltage[:-1].tolist(), 1))
    _, rows = Kernel(plant).run([(0.0, 0.0, 0.0), *steps], par)
    places = [plant.Outputs._fields.index(name) for name in names]
    return np.array([[row[place] for place in places] for row in rows], dtype=float)
