"""The relay of the scenario, INVENTED: [SEMERA] prints only its filter's parameters.

A power relay that is operated at 30 V.  Its armature is pivoted and reflected to the pole face, 12 mm from the pivot:
the mass is J/r^2 with J = 2.0e-7 kg m^2 (an armature of about 4 g), stiffness and damping are those about the pivot
divided by r^2.  Coil of 8000 turns on a core of 4 mm diameter that saturates at 1.6 T; the gap slope is 1/(mu0 A) of a
pole face of 4.2 mm diameter; 0.05 mm of residual gap keep the armature from sticking.
"""

from pathlib import Path

from gapsense.identification.parameter_set import parameters_of

FILE = Path(__file__).resolve().parents[2] / "scenarios" / "semera_relay" / "parameters" / "relay.toml"
RELAY = parameters_of("solenoid_valve", FILE)._replace(coil_resistance=1560.0)  # as its filter expects
