"""The reduced model with the right parameters, [RTS] Section II-B: those of the actuator, the core from a fit."""

from __future__ import annotations

from typing import Any

from gapsense.actuators.reluctance_actuator import GapLaw, Parameters
from gapsense.estimators import ekf
from gapsense.estimators.reduced_model import Model, normalised
from gapsense.studies.devices import RTS_VALVE
from gapsense.studies.reduced_fit.fit import fit_core
from gapsense.studies.smoother.batch import Varied


def nominal(
    actuator: Parameters = RTS_VALVE,
    core_reluctance: float = 1.75,
    core_saturation: float = 0.0238,
    sample_time: float = 20e-6,
) -> Model:
    """The reduced model (13)-(17) of an actuator; R_c0* [1/H] and lambda_sat [Wb] are fitted, by default Table II."""
    if actuator.gap_law == GapLaw.table:
        raise ValueError("`gap_law` 1 (table) found, 0 expected: (56) perturbs the fringing law. Set it to 0.")
    shared = {name: value for name, value in actuator._asdict().items() if name in ekf.Parameters._fields}
    par = ekf.Parameters(**{**dict.fromkeys(ekf.Parameters._fields, 0.0), **shared})
    return normalised(
        par._replace(
            sample_time=sample_time,
            core_reluctance=core_reluctance * actuator.coil_turns**2,
            core_saturation=core_saturation,
            option_force_error=1.0,
        )
    )


def own(m: Model) -> Varied:
    """A single run without errors."""
    return Varied(*(getattr(m, name) for name in Varied._fields))


def fitted(samples: Any, m: Model) -> Model:
    """The model with R_c0* and lambda_sat that leave the smallest current errors (47c) in a cycle, in least squares."""
    return fit_core(samples.position, samples.flux_linkage, samples.current, m).model(m)
