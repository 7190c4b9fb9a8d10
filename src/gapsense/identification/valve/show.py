"""A valve for the user: its parameter set, tables and figures, what was found, how certain it is, how well it fits."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from rich.table import Table

from gapsense.actuators.solenoid_valve import GapLaw, Parameters
from gapsense.fmi.components import load_component, own
from gapsense.fmi.ports import Port
from gapsense.fmi.values import ValuesError, fields
from gapsense.identification.assumptions import describe_doubt, meanings
from gapsense.identification.causes import CAUSES
from gapsense.identification.measurements.operations import starts
from gapsense.identification.measurements.record import Record
from gapsense.identification.parameter_set import (
    GAPS,
    TABLE_UNITS,
    Entry,
    error_note,
    format_error,
    parameters_of,
    read_sets,
    write_set,
    write_table,
)
from gapsense.identification.residual import hums, verdict
from gapsense.identification.show import TWO_SIDED, Validation, about, validation
from gapsense.identification.temperature import Coefficient
from gapsense.identification.valve import lossy_valve
from gapsense.identification.valve.driver import TAKEN
from gapsense.identification.valve.errors import likely_causes
from gapsense.identification.valve.fit import Identified
from gapsense.identification.valve.form import (
    BOUND,
    FACTOR,
    FILTER,
    LIMITS,
    LOSSES,
    TABLE_FIELDS,
    Device,
    guess_similar,
    replace_values,
    value_of,
)
from gapsense.identification.valve.model import simulate, take_out_causes
from gapsense.problems import InputError
from gapsense.report.table import quantity, table
from gapsense.tables import Value

PORTS = {port.field: port for port in load_component(own("solenoid_valve")).of("parameter")}
PORTS |= {port.field: port for port in load_component(own("ekf")).of("parameter") if port.field in LOSSES}
PORTS[FILTER] = Port("current.filter", "parameter", "s", "Time constant of a low-pass of the current alone")
PORTS[TABLE_FIELDS[0]] = Port("gap.file", "parameter", "1", "Factor on the table of the gap law")
BY_NAME = {port.name: port for port in PORTS.values()}


class Known(NamedTuple):
    """Known parameters and first guesses; `table` is the file of the gap table, where the law needs one."""

    parameters: Parameters
    table: Path | None = None
    losses: Mapping[str, float] = {}
    resistance: float | None = None  # of the coil, if the file has it [Ohm]
    given: frozenset[str] = frozenset()  # fields whose values are known, or were guessed by the user


def read_known(file: Path | None) -> Known:
    """Known parameters and first guesses from a parameter-set file.

    What it leaves out is that of a valve that is electrically like the one of [SEMERA] Table I.
    """
    values, assumed = read_sets([file] if file else [])
    law, table = str(values.get("gap.law", "linear")), values.get("gap.file")
    if law == "table" and table is None:
        raise ValueError(f"{file}, gap.file: missing; with `gap.law` = `table` a CSV file is expected. Add it.")
    defaults: dict[str, Value] = {}
    if isinstance(lower := values.get("stop.lower"), float):
        defaults = {"stop.upper": lower + PORTS["stop_upper"].start}
    fields_of = {port.name: field for field, port in PORTS.items()}
    there, known = ({fields_of[n] for n in names if n in fields_of} for names in (values, {*values} - {*assumed}))
    return Known(
        parameters=guess_similar(parameters_of("solenoid_valve", file, defaults), there),
        table=Path(str(table)) if law == "table" else None,
        losses=_losses(values, file),
        resistance=float(values["coil.resistance"]) if "coil.resistance" in values else None,
        given=frozenset(known),
    )


def _losses(values: Mapping[str, Value], file: Path | None) -> dict[str, float]:
    """Losses of the core that a set has, as estimators take them."""
    given = {PORTS[name].name: values[PORTS[name].name] for name in LOSSES if PORTS[name].name in values}
    try:
        found = fields(load_component(own("ekf")), given, own("ekf"))
    except ValuesError as error:
        raise InputError([f"{file and file.name}: {problem}" for problem in error.problems]) from None
    return {name: float(found[name]) for name in LOSSES if PORTS[name].name in given}


def write_valve(
    file: Path,
    result: Identified,
    known: Known,
    sources: Sequence[Path],
    tuning: Mapping[str, float],
    notes: Sequence[str] = (),
) -> Path:
    """Write a parameter-set file for scenarios, `gapsense build` and `gapsense estimate`, with notes as comments."""
    names = [name for name in PORTS if not name.startswith(("gap", "micro_step", FILTER)) and name not in LOSSES]
    if isinstance(par := result.parameters, lossy_valve.Parameters):  # with the losses that the device has
        names += [*LOSSES[:1] * (par.core_eddy > 0.0), *LOSSES[1:] * (par.core_hysteresis > 0.0)]
    entries = [
        *(_entry(name, result) for name in names),
        *_gap(file, result, known),
        *(Entry(name, value, "of the records, for estimators") for name, value in tuning.items()),
    ]
    return write_set(
        file,
        "Solenoid valve, identified",
        f"gapsense identify {' '.join(source.name for source in sources)}",
        entries,
        assumed=[PORTS[name].name for name in result.assumed],
        notes=notes,
    )


def _gap(file: Path, result: Identified, known: Known) -> list[Entry]:
    """The gap law; a table that was multiplied by a factor is written beside the file."""
    law, table = GapLaw(value_of(result.parameters, "gap_law")).name, known.table
    if table is None:
        named = [_entry(name, result) for name, port in PORTS.items() if port.name in GAPS[law]]
        return [Entry("gap.law", law), *named]
    if TABLE_FIELDS[0] in result.form.fitted:
        columns = {name: np.array(value_of(result.parameters, f"gap_file_{name}")) for name in TABLE_UNITS}
        table = write_table(file.with_name(f"{file.stem}-gap.csv"), columns)
    return [Entry("gap.law", "table"), Entry("gap.file", str(table))]


def get_fitted_value(result: Identified, name: str) -> float:
    """Get the value of a parameter; of the table of a gap law, the factor on it."""
    if name != TABLE_FIELDS[0]:
        return float(value_of(result.parameters, name))
    now, before = (value_of(par, name) for par in (result.parameters, result.form.known))
    return float(now[-1] / before[-1])


def show_value(result: Identified, name: str) -> str:
    """The same with its unit."""
    return quantity(get_fitted_value(result, name), PORTS[name].unit)


def valve_errors(result: Identified) -> dict[str, float]:
    """Standard errors by parameter of the device, in its unit."""
    named = {name: error for name, error in result.errors.items() if name not in (*TABLE_FIELDS, FILTER)}
    return {PORTS[name].name: error * get_fitted_value(result, name) for name, error in named.items()}


def _entry(name: str, result: Identified) -> Entry:
    """A parameter, with its standard error if it was fitted."""
    port, note = PORTS[name], error_note(result.errors.get(name), name in result.poor)
    if name in result.assumed:
        note = f"assumed, not known: {describe_doubt(port.name, result.assumed[name])}"
    return Entry(port.name, get_fitted_value(result, name), "not identified, held" if name in result.held else note)


def validate_valve(par: Device, records: Sequence[Record], coefficient: Coefficient | None) -> list[Validation]:
    """The model beside each of the records, with the resistance at its temperature, if that is known."""
    found = []
    for record in records:
        T = record.temperature
        R = value_of(par, "coil_resistance") if coefficient is None or T is None else coefficient.at(T)
        found.append(validate(replace_values(par, coil_resistance=R), record))
    return found


def validate(par: Device, record: Record) -> Validation:
    """The model, with its own resistance, beside a record that begins at rest."""
    first = starts(record)[0]
    halves = take_out_causes(record, is_sharp=True).halves[first:]
    R = np.full(len(halves), value_of(par, "coil_resistance"))
    model = simulate(par, halves, record.dt, R, record.filtered)
    return Validation(record, model, first)


SAME = 1.01  # ratio of the costs of starts that found the same minimum
WHAT = {"series": "series, while on", "drop": "drop, while off", "delay": "delay of the current"}
ALIKE = "Evidence does not clearly exclude other forms ({}). What they make of the values is in the standard errors."
PWM = (
    "The voltage is switched every {:.3g} samples (PWM), too fast for places of its edges. So its mean is known to {}"
    " only, which is in the standard errors. Where that leaves more than noise, record means of intervals, or without"
    " PWM; `gapsense commission` seeks the place of every edge."
)
UNSATURATED = (
    "`core.saturation` ends at the upper limit of the search: these records show no saturation, and the other values do"
    " not depend on it."
)
LOUD = 4e-3  # noise, of the largest current, that hides losses which move turns and core
UNSEEN = (
    "Of the losses of a core, {} were not seen, but noise of {:.2g} % of the largest current may hide some, or flux"
    " that was left before the record. Then turns and core are further off than stated, above all with short strokes."
)
FILTERED = (
    "The current alone comes through a low-pass of first order with a corner of about {}: the current of the model is"
    " filtered alike, and its mean delay is a delay of the current. Estimators know no such filter: record without it."
)
STRONG = 0.95  # correlation from which two parameters can hardly be told apart


def valve_tables(result: Identified, records: Sequence[Record], checks: Sequence[Validation]) -> list[Table | str]:
    """What was found, how certain it is, and how it predicts the records that were not used for the fit."""
    shown = [resistances(result, records), *forms(result), *drive(result), parameters(result), correlations(result)]
    told = about(*records, *(check.record for check in checks))
    return [*shown, *assumed_table(result), *([validation(checks)] if checks else []), *remarks(result), *told]


def assumed_table(result: Identified) -> list[Table | str]:
    """What was neither given nor found, how far its values may be off, and what that means."""
    names = {PORTS[name].name: name for name in result.assumed}
    if not names:
        return []
    rows = [(name, show_value(result, f), describe_doubt(name, result.assumed[f])) for name, f in names.items()]
    heads = ("parameter", "assumed", "standard error")
    return [table("Assumed, neither given nor found in the records", heads, rows), *meanings(names)]


def parameters(result: Identified) -> Table:
    """Value and standard error of every parameter."""
    rows = []
    for name, error in result.errors.items():
        unit, value = PORTS[name].unit, get_fitted_value(result, name)
        ends = [value * float(np.exp(side * TWO_SIDED * error)) for side in (-1.0, 1.0) if math.isfinite(error)]
        interval = " to ".join(quantity(end, unit) for end in ends)
        note = "not identified" if name in result.poor else ""
        rows.append((PORTS[name].name, quantity(value, unit), format_error(error), interval, note))
    rows += [(PORTS[name].name, show_value(result, name), "", "", "not identified, held") for name in result.held]
    return table("Parameters", ("parameter", "value", "standard error", "95 % interval", ""), rows)


def forms(result: Identified) -> list[Table]:
    """The forms of the model that were tried, if any were beside the plain one."""
    heads, rows = ("form", "parameters", "residual", "evidence", ""), []
    for trial in result.trials:
        added, count = trial.form.added, len({*trial.form.fitted} - {FACTOR})
        judged = (f"{trial.evidence:.0f}", "taken" if trial.is_taken else "") if added else ("", "")
        rows.append((", ".join(added) or "plain", f"{count}", quantity(trial.rms, "A"), *judged))
    return [table("Forms of the model, fitted to the first operations", heads, rows)] if result.trials[1:] else []


def labels(result: Identified) -> list[str]:
    """Names of what was fitted, in the order of the correlations."""
    return [*(PORTS[n].name for n in result.names), *(f"driver.{name}" for name in result.uncertainty.causes)]


def drive(result: Identified) -> list[Table]:
    """What was taken out of the recorded voltage, if anything was."""
    rows = []
    for name, value in result.drive.items():
        unit, error = TAKEN[name], result.uncertainty.causes.get(name)
        stated = "given" if error is None else quantity(error, unit)
        rows.append((WHAT[name], quantity(value, unit), stated))
    return [table("Taken out of the records", ("", "value", "standard error"), rows)] if rows else []


def correlations(result: Identified) -> Table:
    """Correlations of the errors."""
    names = labels(result)
    lower = (row[:k] for k, row in enumerate(result.uncertainty.correlation.tolist()))
    rows = [(name, *(f"{c:.2f}" for c in row)) for name, row in zip(names, lower)]
    return table("Correlations", ("", *(name.rpartition(".")[2] for name in names[:-1])), rows[1:])


def resistances(result: Identified, records: Sequence[Record]) -> Table:
    """Resistance of every period, (23)."""
    rows = (
        (record.name, *(f"{1e3 * record.times[k]:.6g} ms" for k in operation[:2]), quantity(float(R), "Ohm"))
        for record, flux in zip(records, result.fluxes)
        for operation, R in zip(flux.operations, flux.resistances)
    )
    return table("Resistance per period, (23)", ("record", "from", "to", "resistance"), rows)


def remarks(result: Identified) -> list[str]:
    """Sentences: how the minimum was found, how well it explains the records, and what these do not tell."""
    return [
        *_describe_search(result),
        *_describe_readings(result),
        *_describe_residuals(result),
        *_describe_undetermined(result),
    ]


def _describe_search(result: Identified) -> list[str]:
    """How the minimum was found."""
    said = [f"J = {result.cost:.4g} after {result.evaluations} simulations."]
    if result.starts:
        best = min(start.cost for start in result.starts)
        agreeing = sum(start.cost <= SAME * best for start in result.starts)
        worse = len(result.starts) - agreeing
        others = f"; {worse} ended in worse ones, rejected by their cost" if worse else ""
        said.append(f"{agreeing} of {len(result.starts)} starts found this minimum{others}.")
    else:
        said.append("The multi-directional search converges slowly: compare with `--starts 1`.")
    return said


def _describe_readings(result: Identified) -> list[str]:
    """How the voltage and the current of the records were read."""
    said = [f"The voltage between two samples is best read as `{result.convention}`."] if result.convention else []
    said += [result.slow] if result.slow else []
    if result.places:
        said.append(
            f"The {len(result.places)} edges of the voltage lie differently between two samples: the place of each is"
            " sought, and its doubt is in the standard errors."
        )
    if filtered := float(getattr(result.parameters, FILTER, 0.0)):
        said.append(FILTERED.format(quantity(0.5 / np.pi / filtered, "Hz")))
    return said + [PWM.format(c.samples, quantity(c.doubt, "V")) for c in result.carriers[:1]]


def _describe_residuals(result: Identified) -> list[str]:
    """How well the model explains the records, and which other models do."""
    said = [verdict(r, quantity(r.rms, "A"), quantity(r.limit, "A")) for r in result.residuals]
    said += explanations(result)
    said += [ALIKE.format("; ".join(result.alike))] if result.alike else []
    noise = max(r.noise / float(np.abs(m.current).max()) for r, m in zip(result.residuals, result.models))
    unseen = {name for t in result.trials for name in t.form.added} & {"eddy", "hysteresis"} - {*result.form.added}
    if result.is_explained and unseen and noise > LOUD:
        said.append(UNSEEN.format(" and ".join(sorted(unseen)), 100.0 * noise))
    return said


def _describe_undetermined(result: Identified) -> list[str]:
    """Which parameters the records do not determine, or not apart."""
    said = [UNSATURATED] if result.is_unsaturated else []
    for name in [n for n in result.at_bounds if not (n == "core_saturation" and result.is_unsaturated)]:
        said.append(
            f"`{PORTS[name].name}` ends at a limit of the search, {LIMITS.get(name, BOUND):g} times its first guess, so"
            " that it has no standard error, and those of the others are too small: give a better guess."
        )
    for name in result.held:
        value = show_value(result, name)
        said.append(
            f"`{PORTS[name].name}` is not identified: these records do not determine it. It is held at {value}."
        )
    for name in result.poor:
        error = format_error(result.errors[name])
        said.append(f"`{PORTS[name].name}` is not identified: its standard error is {error}. Do not rely on it.")
    rho, names = result.uncertainty.correlation, labels(result)
    for k, j in zip(*np.nonzero(np.tril(np.abs(rho), -1) > STRONG)):
        a, b = names[j], names[k]
        said.append(f"`{a}` and `{b}` can hardly be told apart: their correlation is {float(rho[k, j]):.2f}.")
    return said


def explanations(result: Identified) -> list[str]:
    """What else may explain what the model leaves, where that is too much; first what explains most of it."""
    shares = result.uncertainty.shares
    found = [
        f"{CAUSES[n].sentence} {quantity(shares[n].value, CAUSES[n].unit)} ({100.0 * shares[n].part:.0f} %)"
        for n in likely_causes(shares)
    ]
    if result.is_explained:
        return []
    if said := hums(result.residuals):
        return [f"{said}."]
    if not found:
        return []
    return [f"Most likely causes, apart from other values of the parameters: {', or '.join(found)}."]
