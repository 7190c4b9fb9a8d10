"""Parameter sets of the actuators, and the gap table of [UKF]."""

from __future__ import annotations

import math

from gapsense.actuators import pot_magnet, reluctance_actuator
from gapsense.actuators.magnetics import MU_0, fringing
from gapsense.actuators.solenoid_valve import GapLaw, Parameters

GAP_AREA = 1.75e-5  # A of the fringing law [m^2], papers.md on [UKF]
GAP_WINDOW = 10e-3  # G [m]


def fringing_table(
    points: int = 19, largest: float = 0.9e-3, area: float = GAP_AREA, window: float = GAP_WINDOW
) -> tuple[list[float], list[float], list[float]]:
    """Gaps from 0 to `largest` [m], reluctances [1/H] and their derivatives [1/(H m)] of the fringing law.

    [UKF] has 19 points, from a finite-element model that is not printed; this law stands in for it.
    """
    gaps = [largest * k / (points - 1) for k in range(points)]
    laws = [fringing(h, 1.0 / (MU_0 * area), 1.0 / math.sqrt(area), 2.0 * window) for h in gaps]
    return gaps, [R for R, _, _ in laws], [slope for _, slope, _ in laws]


_GAPS, _RELUCTANCES, _SLOPES = fringing_table()

# The solenoid valve of [SEMERA] Table I.  Its resistance is not printed: Table III's 1.5 ohm is |r - 77.5 ohm|.
VALVE = Parameters(
    coil_resistance=76.0,
    coil_turns=1200.0,
    gap_law=GapLaw.linear,
    gap_slope=2.7e10,
    gap_area=GAP_AREA,
    gap_window=GAP_WINDOW,
    gap_file_gap=_GAPS,
    gap_file_reluctance=_RELUCTANCES,
    gap_file_slope=_SLOPES,
    core_reluctance=3.25e6,
    core_saturation=0.024,
    mover_mass=1.6e-3,
    spring_stiffness=37.0,
    spring_rest=22.5e-3,
    damping=0.4,
    stop_lower=0.0,
    stop_upper=0.9e-3,
    initial_position=0.9e-3,
    micro_step=12.5e-6,
)

# INVENTED: [SEMERA] prints only the filter parameters of its relay (Table V: 1560 ohm, 1 H).  These are plausible
# values of a power relay that is operated at 30 V.  Its armature is pivoted and reflected to the pole face, 12 mm from
# the pivot: the mass is J/r^2 with J = 2.0e-7 kg m^2 (an armature of about 4 g), stiffness and damping are those about
# the pivot divided by r^2.  Coil of 8000 turns on a core of 4 mm diameter that saturates at 1.6 T; the gap slope is
# 1/(mu0 A) of a pole face of 4.2 mm diameter; 0.05 mm of residual gap keep the armature from sticking.
_RELAY_AREA = 1.385e-5
_RELAY_GAPS, _RELAY_RELUCTANCES, _RELAY_SLOPES = fringing_table(area=_RELAY_AREA)
RELAY = VALVE._replace(
    coil_resistance=1560.0,
    coil_turns=8000.0,
    gap_slope=5.74e10,
    gap_area=_RELAY_AREA,
    gap_file_gap=_RELAY_GAPS,
    gap_file_reluctance=_RELAY_RELUCTANCES,
    gap_file_slope=_RELAY_SLOPES,
    core_reluctance=2.0e7,
    core_saturation=0.16,
    mover_mass=1.4e-3,
    spring_stiffness=200.0,
    spring_rest=1.1e-3,
    damping=0.2,
    stop_lower=0.05e-3,
    stop_upper=0.8e-3,
    initial_position=0.8e-3,
)

# The linear travel solenoid valve of [RTS] Table I; the gap law is ours, papers.md on [RTS].
RTS_VALVE = reluctance_actuator.Parameters(
    coil_resistance=48.0,
    coil_turns=1200.0,
    hysteresis=1.0,
    saturation=1.0,
    eddy_currents=1.0,
    core_length=0.055,
    core_area=1.26e-5,
    core_magnetization=1.45e6,
    core_shape=1949.6,
    core_coupling=3.66e-3,
    core_pinning=942.0,
    core_reversibility=0.736,
    core_eddy_conductance=1630.0,
    gap_law=reluctance_actuator.GapLaw.fringing,
    gap_reluctance=0.0,
    gap_slope=4.7e10,
    gap_fringing=300.0,
    gap_window=9.73e-3,
    gap_file_gap=[0.0, 1.0],  # of no importance with this law
    gap_file_reluctance=[0.0, 4.7e10],
    gap_file_spline=[0.0, 0.0],
    mover_mass=1.6e-3,
    spring_stiffness=61.8,
    spring_rest=0.0192,
    damping=0.8,
    stop_lower=0.4e-3,
    stop_upper=1.4e-3,
    initial_position=1.4e-3,
    micro_step=10e-6,
)

# The pot magnet of [HEKF] Table 1.  mu_0 and l_1 are misprinted there; see papers.md.
POT_MAGNET_PRINTED = pot_magnet.Parameters(
    orientation=pot_magnet.Orientation.printed,
    coil_turns=964.0,
    coil_resistance=114.3,
    coil_resistance_upper=120.0,
    core_permeability=200.0,
    core_length=22e-3,
    pole_area=7.6341e-5,
    mover_mass=0.34,
    gravity=9.81,
    stop_upper=0.5e-3,
    current_on=0.1,
    current_off=0.02,
    initial_position=0.0,
    micro_step=25e-6,
)

# The same with a force that acts where the inductance rises.  With the printed stroke of 0.5 mm it never lifts at 24 V:
# at 0.21 A the force is 3.19 N, the weight 3.34 N.  With 0.2 mm i_on and i_off are what the model says: it can lift
# from 0.099 A on and holds down to 0.021 A.
POT_MAGNET = POT_MAGNET_PRINTED._replace(orientation=pot_magnet.Orientation.consistent, stop_upper=0.2e-3)
