"""The devices of the papers in Python: what the port tables in fmus/ say, so that each number stands once.

[SEMERA] does not print the resistance of its valve: Table III's 1.5 ohm is |r - 77.5 ohm|.  The gap law of [RTS] is
ours.
"""

from gapsense.actuators import reluctance_actuator, solenoid_valve
from gapsense.fmi.components import kernel_parameters, own

VALVE: solenoid_valve.Parameters = kernel_parameters(own("solenoid_valve"), {})  # [SEMERA] Table I
RTS_VALVE: reluctance_actuator.Parameters = kernel_parameters(own("reluctance_actuator"), {})  # [RTS] Table I
