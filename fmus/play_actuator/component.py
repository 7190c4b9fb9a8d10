"""Port table of the actuator of another physics; its ports are those that `ReluctanceActuator` has too."""

from gapsense.fmi.components import load_component, own
from gapsense.fmi.ports import Component, fixed, output, parameter

OTHER = load_component(own("reluctance_actuator"))
COMMON = {port.name: port for port in OTHER.ports}
SIGNALS = ("voltage", "current", "position", "velocity", "flux_linkage", "force", "mode", "contact")
GAP = ("gap.slope", "gap.fringing", "gap.window")
STOPS = ("stop.lower", "stop.upper", "stop.restitution")
MOVER = ("mover.mass", "spring.stiffness", "spring.rest", "damping", *STOPS, "initial.position")

COMPONENT = Component(
    name="PlayActuator",
    description="Reluctance actuator of another physics: hysteresis of play elements, two poles of eddy currents",
    kernel="gapsense.actuators.play_actuator",
    step_size=20e-6,
    rising=OTHER.rising,
    ports=(
        *(COMMON[name] for name in SIGNALS),
        output("eddy_current", "A", "Part of the current that eddy currents need", nominal=1e-2),
        output("hysteresis_current", "A", "Part of the current that the play elements need", nominal=1e-2),
        COMMON["impact_speed"],
        *(COMMON[name] for name in ("coil.resistance", "coil.turns")),
        fixed("core.reluctance", "1/H", "Reluctance of the core without flux", 2.01888e6, min=1e-9),
        fixed("core.saturation", "Wb", "Flux linkage of saturation", 24.71e-3, min=1e-12),
        parameter("hysteresis.amplitude", "A", "Current of all play elements at their limits", 15e-3, min=0.0),
        fixed("hysteresis.reach", "Wb", "Flux linkage from zero to the limit of the widest", 3e-3, min=1e-12),
        parameter("eddy.fast", "S", "Fast eddy current per rate of the flux linkage", 0.7e-3, min=0.0),
        fixed("eddy.fast_time", "s", "Its time constant", 50e-6, min=10e-6),
        parameter("eddy.slow", "S", "Slow eddy current per rate of the flux linkage", 0.5e-3, min=0.0),
        fixed("eddy.slow_time", "s", "Its time constant", 0.5e-3, min=10e-6),
        *(COMMON[name] for name in (*GAP, *MOVER)),
        fixed("micro_step", "s", "Longest step of the integrator", 5e-6, min=1e-7, max=10e-6),
    ),
)
