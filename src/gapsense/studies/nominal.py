"""The reduced model with the right parameters, [RTS] Section II-B: those of the actuator, the core from a fit."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from gapsense.actuators.parameters import RTS_VALVE
from gapsense.actuators.reluctance_actuator import Parameters
from gapsense.estimators.reduced_model import Model
from gapsense.studies.batch import Varied
from gapsense.studies.reference import reference_states

Floats = NDArray[np.float64]


def nominal(
    actuator: Parameters = RTS_VALVE,
    core_reluctance: float = 1.75,
    core_saturation: float = 0.0238,
    sample_time: float = 20e-6,
) -> Model:
    """The reduced model (13)-(17) of an actuator; R_c0* [1/H] and lambda_sat [Wb] are fitted, by default Table II."""
    if actuator.gap_law > 0.5:
        raise ValueError("`gap_law` 1 (table) found, 0 expected: (56) perturbs the fringing law. Set it to 0.")
    l_z = actuator.stop_upper - actuator.stop_lower
    area, turns = l_z * l_z, actuator.coil_turns * actuator.coil_turns
    return Model(
        T_s=sample_time,
        R=actuator.coil_resistance,
        m=actuator.mover_mass * area,
        k_sp=actuator.spring_stiffness * area,
        z_sp=(actuator.spring_rest - actuator.stop_lower) / l_z,
        c_f=actuator.damping * area,
        R_c0=core_reluctance,
        lam_sat=core_saturation,
        l_z=l_z,
        z_min=actuator.stop_lower,
        gap_is_table=False,
        gap_knots=(),
        gap_reluctance=(),
        gap_curvature=(),
        gap_scale=1.0 / turns,
        gap_offset=actuator.gap_reluctance / turns,
        gap_slope=actuator.gap_slope * l_z / turns,
        gap_fringing=actuator.gap_fringing,
        gap_window=actuator.gap_window,
        gap_tilt=0.0,
        has_force_error=1.0,
    )


def own(m: Model) -> Varied:
    """A single run without errors."""
    return Varied(*(getattr(m, name) for name in Varied._fields))


def fitted(samples: Any, m: Model) -> Model:
    """The model with R_c0* and lambda_sat that leave the smallest current errors (47c) in a cycle, in least squares."""

    def at(ratios: Floats) -> Model:
        return m._replace(R_c0=m.R_c0 * float(ratios[0]), lam_sat=m.lam_sat * float(ratios[1]))

    def current_error(ratios: Floats) -> Floats:
        return np.asarray(reference_states(samples, own(at(ratios)), m).current_error[0])

    return at(least_squares(current_error, [1.0, 1.0], xtol=1e-12, ftol=1e-12, gtol=1e-12).x)
