"""A commissioned actuator for the user: its parameter set, tables and a figure.

For the gap law by formula the factor of its reluctance goes into the law, which all estimators know.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from rich.table import Table

from gapsense.estimators.mhe.model import Parameters
from gapsense.estimators.reduced_model import GapLaw
from gapsense.fmi.components import load_component, own
from gapsense.identification.actuator.drive import SLOWEST
from gapsense.identification.actuator.fit import (
    CAUSES,
    DEVIATIONS,
    REBOUND,
    STOPS,
    Commissioned,
    position_error,
    with_bend,
    with_usual_knee,
)
from gapsense.identification.actuator.kernel import Beyond
from gapsense.identification.assumptions import list_values, meanings, scale
from gapsense.identification.least_squares import Matrix
from gapsense.identification.parameter_set import Entry, error_note, format_error, round_value, write_set
from gapsense.identification.residual import LEAST as LEAST_NOISE
from gapsense.identification.residual import noises, verdict
from gapsense.identification.scale import find_tuning
from gapsense.identification.show import Validation, about, measured_and_model, say_what_is_exact, validation
from gapsense.identification.valve.model import Trajectory
from gapsense.report.table import quantity, table
from gapsense.tables import Value

PORTS = {port.field: port for port in load_component(own("mhe")).of("parameter")}
STOPPED = {field: PORTS.pop(field.replace("contact", "stop")) for field in STOPS}
LEARNT = {  # deviations before the first window of `Mhe`, by the fields that they are about
    "prior.eddy": "core_eddy",
    "prior.gap": "gap_factor",
    "prior.knee": "core_bend",
    "prior.saturation": "core_saturation",
    "prior.hysteresis": "core_hysteresis",
    "prior.mass": "mover_mass",
    "prior.rest": "spring_rest",
}
SHARP = ("core.exponent", "core.sharp_reluctance", "core.sharp_bend")
NOT_NUMBERS = (
    "gap_law",
    "gap_file",
    "gap_bend",
    "stop_law",
    "stop_restitution",
    *(name.replace(".", "_") for name in SHARP),
)
MOVES = 0.01  # of the stroke
LEAST = 3e-3  # of these: the device is another one tomorrow


def found_values(result: Commissioned) -> dict[str, float]:
    """What was found, by parameter; the coil is warmer tomorrow, so that its resistance stays as uncertain as it is."""
    par, law = result.parameters, []
    if par.gap_law == GapLaw.fringing:
        law, factor = ["gap_reluctance", "gap_slope"], par.gap_factor
        par = par._replace(**{name: getattr(par, name) * factor for name in law}, gap_factor=1.0)
    fields = [*law, "gap_factor", *(name for name in result.names if name in PORTS)]
    stops = {STOPPED[name].name: float(getattr(result.beyond, name)) for name in result.names if name in STOPPED}
    return {
        **{PORTS[field].name: float(getattr(par, field)) for field in fields},
        **stops,
        **noise(result),
        **priors(result),
    }


def standard_errors(result: Commissioned) -> dict[str, float]:
    """By parameter, in its unit."""
    found, ports = found_values(result := with_usual_knee(result)[0]), PORTS | STOPPED
    return {name: error * found[name] for field, error in result.errors.items() if (name := ports[field].name)}


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
    """What was given, with what was found; without a sampling period of the estimators that of the records.

    With losses that are known, filters have the error of the current that they usually have, if none was given.
    """
    dt = result.drives[0].record.dt
    sharp = sharp_knee(result) if result.beyond.core_power else {name: 0.0 for name in SHARP[:1] if name in given}
    result, _ = with_usual_knee(result)
    models = [at_rest(m, result.parameters) if result.beyond.contact_stiffness else m for m in result.models]
    tuning = find_tuning([d.record for d in result.drives], models, result.residuals, result.parameters)
    law = {"stop.law": "elastic"} if result.beyond.contact_stiffness else {}
    law |= {"stop.law": "hard"} if "stop_restitution" in result.names else {}
    return {"sample_time": dt, **device(result.parameters), **tuning, **given, **law, **found_values(result), **sharp}


def sharp_knee(result: Commissioned) -> dict[str, Value]:
    """What `Mhe` takes in place of the knee that all estimators have; its saturation is theirs."""
    par, n, usual = result.parameters, float(result.beyond.core_power), with_usual_knee(result)[0].parameters
    bend = par.core_bend * (usual.core_saturation / par.core_saturation) ** (n - 1.0)
    return dict(zip(SHARP, (n, float(par.core_reluctance), float(bend))))


def at_rest(model: Trajectory, par: Parameters) -> Trajectory:
    """A trajectory without what an elastic stop gives way, and without the last small bounces."""
    near = MOVES * (par.stop_upper - par.stop_lower)
    z = np.where(model.position < par.stop_lower + near, par.stop_lower, model.position)
    return model._replace(position=np.where(z > par.stop_upper - near, par.stop_upper, z))


def device(par: Parameters) -> dict[str, Value]:
    """All that is known of the device, for the other estimators have other defaults."""
    law = GapLaw(int(par.gap_law))
    groups = ("coil_", "mover_", "spring_", "damping", "stop_", "core_", *(("gap_",) if law == GapLaw.fringing else ()))
    fields = [field for field in PORTS if field and field.startswith(groups) and field not in NOT_NUMBERS]
    values: dict[str, Value] = {PORTS[field].name: float(getattr(par, field)) for field in fields}
    return {**values, "gap.law": law.name}


def write_actuator(
    file: Path, result: Commissioned, given: Mapping[str, Value], origin: str, assumed: Sequence[str] = ()
) -> Path:
    """Write a parameter-set file for scenarios, `gapsense build` and `gapsense estimate`."""
    names = {"gap_factor": "gap_slope"} if result.parameters.gap_law == GapLaw.fringing else {}
    ports, usual = PORTS | STOPPED, with_usual_knee(result)[0]
    errors = {ports[names.get(field, field)].name: error for field, error in usual.errors.items()}
    values = complete(result, given)
    return write_set(
        file,
        "Reluctance actuator, commissioned",
        origin,
        [Entry(name, round_value(value), error_note(errors.get(name))) for name, value in values.items()],
        assumed=[name for name in assumed if name in values],
    )


ENDS, MOVER = ("stop.lower", "stop.upper"), ("mover.mass", "spring.stiffness", "spring.rest", "damping")
COIL = ("coil.resistance", "coil.turns", "core.reluctance", "core.saturation")  # losses need no more than a guess
GAPS = {GapLaw.fringing: ("gap.slope", "gap.fringing", "gap.window"), GapLaw.table: ("gap.file",)}
LEAST_DOUBT = 0.5  # of a logarithm
FITTED_AS = {
    "gap.slope": ("gap_factor",),
    "gap.file": ("gap_factor",),
    "core.reluctance": ("core_reluctance", "core_bend"),
    "core.saturation": ("core_saturation", "core_bend"),
}


def missing(known: Parameters, given: Collection[str]) -> list[str]:
    """Names of what is needed and was not given."""
    return [n for n in (*ENDS, *COIL, *MOVER, *GAPS[GapLaw(int(known.gap_law))]) if n not in given]


def doubts(names: Sequence[str]) -> dict[str, float]:
    """Deviations of the fields that go with assumed parameters; a factor also where nothing but a part is known."""
    fields = {port.name: (field,) for field, port in PORTS.items()} | FITTED_AS
    return {field: max(scale(name).doubt, LEAST_DOUBT) for name in names for field in fields[name]}


BELIEVED = 0.7  # of the deviation that was assumed: the record has told little
FAR = 3.0  # of the same deviations from what was believed
FRICTION = " Dry friction, which no estimator models, looks like that."
HEADS = ("parameter", "believed", "found", "standard error", "")


def actuator_tables(
    result: Commissioned, known: Parameters, checks: Sequence[Validation] = (), assumed: Sequence[str] = ()
) -> list[Table | str]:
    """Values and standard errors, then what the residuals and the misfit say."""
    before, rows = with_bend(known), []
    for field, error in result.errors.items():
        is_believed = math.inf > error >= BELIEVED * result.believed[field]
        note = "as it was believed" if is_believed else "at a limit" * (field in result.at_limit)
        if field in Beyond._fields:
            port = STOPPED.get(field)
            name, unit = (port.name, port.unit) if port else ("exponent of the knee", "")
            values = ["", quantity(float(getattr(result.beyond, field)), unit)]
        else:
            name, unit = PORTS[field].name, PORTS[field].unit
            values = [quantity(float(getattr(par, field)), unit) for par in (before, result.parameters)]
        rows.append((name, *values, format_error(error), "assumed" if name in assumed else note))
    return [
        table("Parameters", HEADS, rows),
        *([validation(checks)] if checks else []),
        *assumptions(known, assumed),
        say_what_is_exact([name for name in (*ENDS, "coil.turns") if name not in assumed]),
        *remarks(result, before),
        *about(*(drive.record for drive in result.drives), *(check.record for check in checks)),
    ]


def assumptions(known: Parameters, names: Sequence[str]) -> list[str]:
    """What was not given, and what that means."""
    ports = {port.name: port for port in PORTS.values()}
    values: dict[str, Value] = {
        name: "as shipped" if ports[name].columns else float(getattr(known, ports[name].field)) for name in names
    }
    return [f"Assumed, and not given: {list_values(values, ports, names)}.", *meanings(names)] if names else []


def remarks(result: Commissioned, before: Parameters) -> list[str]:
    """Sentences: how well the model explains the records, how the search ended, and what is doubtful."""
    return [*_describe_fit(result), *_describe_search(result, before), *_describe_doubtful(result, before)]


def _describe_fit(result: Commissioned) -> list[str]:
    """How well the model explains the records, and with what beside the usual numbers."""
    said = [verdict(r, quantity(r.rms, "A"), quantity(r.limit, "A"), CAUSES) for r in result.residuals]
    if result.beyond.core_power or (set(result.names) & {*STOPS, *REBOUND}):
        said.append(describe_additions(result))
    return said + [
        f"{d.record.name}: the voltage switches with fewer than {SLOWEST:g} samples from edge to edge, so that its mean"
        " is a guess. Do not rely on values and standard errors. Sample faster, or sample a filtered mean."
        for d in result.drives
        if d.is_too_fast
    ]


def _describe_search(result: Commissioned, before: Parameters) -> list[str]:
    """How large the misfit is, whether the search has found a minimum, and what positions are worth."""
    is_usual = result.misfit < before.health_limit
    well = "" if is_usual else ", of which less than 1 is usual: the model is another one"
    said = [f"Misfit {result.misfit:.2g}{well}."]
    if not result.is_minimum:
        after = f"after {result.steps} steps" if result.steps else "without one step from what was believed"
        said.append(
            f"The search ends {after}, not at a minimum: its slopes promise {100.0 * result.promise:.0f} % less, but no"
            " step keeps that. Begin with other values, those of the core above all."
        )
    if is_usual and result.is_explained and not result.at_limit:
        said.append(
            f"By the standard errors, positions of the model are certain to {1e6 * position_error(result):.2g} um RMS."
        )
    return said


def _describe_doubtful(result: Commissioned, before: Parameters) -> list[str]:
    """Which parameters end at a limit or far from what was believed, and which the records do not tell."""
    said, is_other = list[str](), bool(result.beyond.core_power)  # the knee is another one than usual
    for name in (name for name in result.at_limit if name in PORTS):
        port, values = PORTS[name], [float(getattr(par, name)) for par in (result.parameters, before)]
        at, believed = (quantity(value, port.unit) for value in values)
        said.append(
            f"`{port.name}` ends at a limit of the search: {at}, where {believed} was believed. So it has no standard"
            " error, and those of the others are too small. Begin with a value near it."
        )
    stroke = before.stop_upper - before.stop_lower
    if all(np.ptp(model.position) < MOVES * stroke for model in result.models):
        said.append("The mover does not leave its stop: mass, spring and damping keep their first guesses.")
    if held := [PORTS[n].name for n in DEVIATIONS if n not in (*result.names, *["core_saturation"] * is_other)]:
        said.append(f"Held, for they are 0 or in a file: {', '.join(held)}.")
    for name in (name for name in result.names if name in PORTS and name not in (*REBOUND, *["core_bend"] * is_other)):
        factor = float(getattr(result.parameters, name) / getattr(before, name))
        if abs(math.log(factor)) > FAR * result.believed[name]:
            said.append(
                f"`{PORTS[name].name}` is {factor:.2g} times what was believed, much further off than it should be:"
                f" check the given values and the voltage.{FRICTION * (name == 'damping' and factor > 1.0)}"
            )
    return said


def describe_additions(result: Commissioned) -> str:
    """Say what the records need beside the usual numbers, and which components have it."""
    (_, left), n = with_usual_knee(result), result.beyond.core_power
    told = {
        "gap_window": "a leak beside the gap (`gap.window`)",
        "core_power": f"a knee b m^{n:.3g} of the core",
        "contact_stiffness": "elastic stops, on which the mover bounces",
        "stop_restitution": "hard stops, from which it bounces",
    }
    parts = [text for name, text in told.items() if name in result.names and (n or name != "gap_window")]
    knee = (
        f" `Mhe` has it, `core.exponent`. Others have the nearest of theirs, which leaves {quantity(left, 'A')}."
        if n
        else ""
    )
    return f"The usual model does not explain this. In these values are: {'; '.join(parts)}.{knee}"


def actuator_figure(result: Commissioned, checks: Sequence[Validation]) -> Figure:
    """Measured currents and those of the model, and its positions."""
    runs = [(drive.record, model) for drive, model in zip(result.drives, result.models)]
    return measured_and_model("Measured and commissioned", runs, checks)
