"""Parameter set that commissioning writes: what was given, with what was found in its place.

For the gap law by formula the factor of its reluctance goes into the law, which all estimators know.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from gapsense._os.files import write_atomically
from gapsense.estimators.mhe.model import Parameters
from gapsense.estimators.reduced_model import GapLaw
from gapsense.fmi.components import load_component, own
from gapsense.identification.actuator.fit import Commissioned
from gapsense.identification.actuator.problem import Matrix
from gapsense.identification.assumptions import marks
from gapsense.identification.noise import LEAST as LEAST_NOISE
from gapsense.identification.noise import noises
from gapsense.parameters import is_file
from gapsense.tables import Value

PORTS = {port.field: port for port in load_component(own("mhe")).of("parameter")}
LEARNT = {  # deviations before the first window of `Mhe`, by the fields that they are about
    "prior.eddy": "core_eddy",
    "prior.gap": "gap_factor",
    "prior.knee": "core_bend",
    "prior.saturation": "core_saturation",
    "prior.hysteresis": "core_hysteresis",
    "prior.mass": "mover_mass",
    "prior.rest": "spring_rest",
}
NOT_NUMBERS = ("gap_law", "gap_file", "gap_bend")
LEAST = 3e-3  # of these: the device is another one tomorrow


def found(result: Commissioned) -> dict[str, float]:
    """What was found, by parameter; the coil is warmer tomorrow, so that its resistance stays as uncertain as it is."""
    par, law = result.parameters, []
    if par.gap_law == GapLaw.fringing:
        law, factor = ["gap_reluctance", "gap_slope"], par.gap_factor
        par = par._replace(**{name: getattr(par, name) * factor for name in law}, gap_factor=1.0)
    fields = [*law, "gap_factor", *result.names]
    return {**{PORTS[field].name: float(getattr(par, field)) for field in fields}, **noise(result), **priors(result)}


def noise(result: Commissioned) -> dict[str, float]:
    """That of the records, as `identify` writes it."""
    currents = [max(d.noise, LEAST_NOISE * float(np.abs(d.current).max())) for d in result.drives]
    return {**noises([d.record for d in result.drives]), "noise.current": float(f"{max(currents):.3g}")}


def priors(result: Commissioned) -> dict[str, float]:
    """Standard errors of what `Mhe` learns, all else as it was found."""
    fields = [field for field in ("coil_resistance", *LEARNT.values()) if field in result.names]
    at = [result.names.index(field) for field in fields]
    to_knee = np.eye(len(fields))
    to_knee[fields.index("core_bend"), fields.index("core_saturation")] = -1.0  # `Mhe` learns b = K lambda_sat / N^2
    H: Matrix = to_knee.T @ np.linalg.inv(result.covariance)[np.ix_(at, at)] @ to_knee
    stds = dict(zip(fields, np.sqrt(np.diag(np.linalg.inv(H))).tolist()))
    return {name: max(stds[field], LEAST) for name, field in LEARNT.items() if field in stds}


def complete(result: Commissioned, given: Mapping[str, Value]) -> dict[str, Value]:
    """What was given, with what was found; without a sampling period of the estimators that of the records."""
    return {"sample_time": result.drives[0].record.dt, **device(result.parameters), **given, **found(result)}


def device(par: Parameters) -> dict[str, Value]:
    """All that is known of the device, for the other estimators have other defaults."""
    law = GapLaw(int(par.gap_law))
    groups = ("coil_", "mover_", "spring_", "damping", "stop_", "core_", *(("gap_",) if law == GapLaw.fringing else ()))
    fields = [field for field in PORTS if field and field.startswith(groups) and field not in NOT_NUMBERS]
    values: dict[str, Value] = {PORTS[field].name: float(getattr(par, field)) for field in fields}
    return {**values, "gap.law": law.name}


def write(
    file: Path, result: Commissioned, given: Mapping[str, Value], origin: str, assumed: Sequence[str] = ()
) -> Path:
    """Write a parameter-set file for scenarios, `gapsense build` and `gapsense estimate`."""
    names = {"gap_factor": "gap_slope"} if result.parameters.gap_law == GapLaw.fringing else {}
    errors = {PORTS[names.get(field, field)].name: error for field, error in result.errors.items()}
    file.parent.mkdir(parents=True, exist_ok=True)
    values = complete(result, given)
    lines = [
        'description = "Reluctance actuator, commissioned"',
        f"source = {json.dumps(origin)}",
        *marks([name for name in assumed if name in values]),
        "",
        "[values]",
        *(line(name, value, file, errors.get(name)) for name, value in values.items()),
    ]
    write_atomically(file, lambda out: out.writelines(f"{text}\n" for text in lines))
    return file


def line(name: str, value: Value, file: Path, error: float | None) -> str:
    """A value, with its standard error if it was fitted."""
    if is_file(name, value):
        value = Path(os.path.relpath(str(value), file.resolve().parent)).as_posix()
    elif isinstance(value, float):
        value = float(f"{value:.8g}")
    return f"{json.dumps(name)} = {json.dumps(value)}" + ("" if error is None else f"  # +- {100.0 * error:.2g} %")
