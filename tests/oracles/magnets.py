"""The magnet of [HEKF] in Python.

mu_0 and l_1 of [HEKF] Table 1 are misprinted: they are 1.257e-6 H/m and 22 mm.  With the printed stroke of 0.5 mm the
magnet with a force that acts where the inductance rises never lifts at 24 V: at 0.21 A the force is 3.19 N, the weight
3.34 N.  With 0.2 mm i_on and i_off are what the model says: it can lift from 0.099 A on and holds down to 0.021 A.
"""

from gapsense.actuators import pot_magnet
from gapsense.fmi.components import kernel_parameters, own

POT_MAGNET = kernel_parameters(own("pot_magnet"), {})  # [HEKF] Table 1
POT_MAGNET_PRINTED = POT_MAGNET._replace(orientation=pot_magnet.Orientation.printed, stop_upper=0.5e-3)
