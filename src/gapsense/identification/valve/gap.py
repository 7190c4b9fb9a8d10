"""The gap before and after the fit: from inductances, or from positions that are fitted too, or as it was given.

Current and flux linkage depend on reluctances over the square of the turns, and so do forces.  Once the gap law is
sought, any turns explain the records alike: they are held, as they are given.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from rich.table import Table

from gapsense.actuators.magnetics import MU_0
from gapsense.actuators.solenoid_valve import GapLaw, Parameters
from gapsense.identification.gap_law import motion
from gapsense.identification.gap_law.laws import Law, Vector, best_law, candidates, rows
from gapsense.identification.gap_law.motion import KNOWN, Measured, Trial, evidence, scale_law, trials
from gapsense.identification.gap_law.show import fields
from gapsense.identification.gap_law.table import read_inductances, remarks
from gapsense.identification.least_squares import rms, square
from gapsense.identification.measurements.operations import estimate, operations
from gapsense.identification.measurements.record import Record, read_each
from gapsense.identification.measurements.signals import hidden, noise
from gapsense.identification.parameter_set import write_table
from gapsense.identification.residual import EXPLAINED
from gapsense.identification.valve.fit import Identified
from gapsense.identification.valve.form import LAWS, Sought, shape, value_of
from gapsense.identification.valve.model import Trajectory
from gapsense.identification.valve.show import Known
from gapsense.problems import InputError
from gapsense.report.table import percent, quantity, table

TURNS = "coil_turns"


class Gap(NamedTuple):
    """What is known, and what is sought."""

    parameters: Parameters  # with first guesses of the gap law and the core
    sought: Sought
    records: Sequence[Record]  # with positions that are to be fitted
    conventions: Sequence[str] = ()  # of the voltage between samples, that are left to the fit
    told: Sequence[Table | str] = ()


def noises(records: Sequence[Record]) -> list[str]:
    """Sentences on the positions that are fitted."""
    return [
        f"{record.name}: the position is fitted too, with a noise of {quantity(record.position_noise, 'm')}."
        for record in records
        if record.position_noise
    ]


EXACT = 1e-3  # of the stroke: a position is no better, whatever its noise
MOVES = 0.05  # of the stroke, that a position has to change
BEYOND = 0.25  # of the stroke, that a position may be outside of the stops


def prepare_position(record: Record, par: Parameters, period: float | None = None) -> Record:
    """The record with the noise of its position and without the offset of that, if something moves."""
    stroke = float(par.stop_upper - par.stop_lower)
    if record.position is None or float(np.ptp(record.position)) < MOVES * stroke:
        return record
    rest = operations(record, period)[0].start + 1
    start = float(np.clip(par.initial_position, par.stop_lower, par.stop_upper))
    z = record.position - float(np.median(record.position[:rest])) + start
    if z.min() < par.stop_lower - BEYOND * stroke or z.max() > par.stop_upper + BEYOND * stroke:
        ends = f"{quantity(float(record.position.min()), 'm')} to {quantity(float(record.position.max()), 'm')}"
        raise InputError(
            [
                f"{record.name}: `position` is {ends}, beginning with"
                f" {quantity(float(np.median(record.position[:rest])), 'm')}; the gap, from"
                f" {quantity(float(par.stop_lower), 'm')} to {quantity(float(par.stop_upper), 'm')} and beginning with"
                f" {quantity(start, 'm')}, is expected. Correct unit or direction, `stop.lower`, `stop.upper` or"
                " `initial.position`, or rename the column."
            ]
        )
    return record._replace(position=z, position_noise=max(noise(z), hidden(z), EXACT * stroke))


def of_inductances(
    file: Path, par: Parameters, records: Sequence[Record], sought: Sought, conventions: Sequence[str]
) -> Gap:
    """The gap law of a table of inductances, held; which part of the rest is the core's follows from saturation."""
    measured, turns = read_inductances(file), float(par.coil_turns)
    if measured.gap[-1] < 0.5 * par.stop_upper:
        raise InputError(
            [
                f"{file.name}: gaps up to {quantity(float(measured.gap[-1]), 'm')} found, at least half of the largest,"
                f" {quantity(float(par.stop_upper), 'm')}, expected. Correct `stop.upper`, or measure at larger gaps."
            ]
        )
    law = best_law(candidates(measured.gap, turns**2 / measured.inductance)).law
    known = par._replace(gap_law=float(GapLaw.table), core_reluctance=law.offset)
    told = [
        f"The gap law is that of {file.name}, `{law.name}`, for {turns:g} turns; both are held. Their errors are"
        " not in the standard errors of the others.",
        *remarks(measured),
    ]
    sought = sought._replace(held=(*sought.held, TURNS), gap=(), law=law, total=law.offset)
    return Gap(known, sought, records, conventions, told=[*told, *noises(records)])


SMALLEST = 1e-6
CONFIRMED = (
    "The positions confirm the form of the gap law. Its scale cannot be told from the turns: it is held, and the turns"
    " are sought. `--hold coil.turns` does it the other way round."
)
HELD = (
    "`coil.turns` is held at {:g}: while the gap law is sought, any number explains the records alike, if all"
    " reluctances go with its square."
)


def of_positions(
    par: Parameters, records: Sequence[Record], sought: Sought, conventions: Sequence[str], period: float | None = None
) -> Gap:
    """The gap law that measured positions tell, to be fitted together with all else.

    If they only confirm the form of the law that is known, it stays, and the turns are sought.
    """
    every = read_each(records, conventions) or {"": [*records]}
    names, readings = [*every], [*every.values()]
    is_known = TURNS not in sought.held and (sought.given is None or not sought.given.isdisjoint(LAWS[par.gap_law]))
    laws = [_laws(par, reading, is_known, period) for reading in readings]
    left = [min(square(trial.left) for trial in trials) for trials in laws]
    k = left.index(min(left))
    best = motion.best(laws[k])
    told: list[Table | str] = [_law_table(laws[k], best), *noises(records)]
    found = Gap(par, sought, records, tuple(name for name in names[k : k + 1] if name))
    if best.law.name == KNOWN:
        return found._replace(parameters=_confirm(par, best), told=[*told, CONFIRMED])
    known = par._replace(core_reluctance=best.core_reluctance, core_saturation=best.core_saturation)
    known, gap = _guess_law(known, best.law)
    law = best.law if best.law.knots else None
    sought = sought._replace(held=(*sought.held, TURNS), gap=gap, law=law)
    return found._replace(parameters=known, sought=sought, told=[*told, HELD.format(float(par.coil_turns))])


def _confirm(par: Parameters, found: Trial) -> Parameters:
    """First guesses where the gap law is as it is known, and the turns are others."""
    scale = max(found.scale, SMALLEST)
    return par._replace(
        coil_turns=par.coil_turns / np.sqrt(scale),
        core_reluctance=max(found.core_reluctance, SMALLEST) / scale,
        core_saturation=found.core_saturation,
    )


def _law(par: Parameters) -> Law:
    """The gap law that is known."""
    if par.gap_law == GapLaw.linear:
        return Law("linear", 0.0, (float(par.gap_slope),))
    if par.gap_law == GapLaw.fringing:
        r0 = 1.0 / (MU_0 * float(par.gap_area))
        return Law("fringing", 0.0, (r0, float(par.gap_area) ** -0.5, 2.0 * float(par.gap_window)))
    return Law("table", float(par.gap_file_reluctance[0]), tuple(par.gap_file_slope), tuple(par.gap_file_gap))


def _laws(par: Parameters, records: Sequence[Record], is_known: bool, period: float | None) -> list[Trial]:
    """Gap laws that positions tell; first that which is known, if it may be."""
    parts = []
    for record in records:
        if record.position is not None and record.position_noise:
            flux = estimate(record, operations(record, period))
            first = flux.operations[0].start
            parts.append((record.current[first:], flux.flux_linkage[first:], record.position[first:]))
    columns: list[Vector] = [np.concatenate(part) for part in zip(*parts)]
    samples, turns = Measured(*columns), float(par.coil_turns)
    known = [scale_law(samples, turns, _law(par))] if is_known else []
    return [*known, *trials(samples, turns, float(par.stop_upper))]


def _guess_law(par: Parameters, law: Law) -> tuple[Parameters, tuple[str, ...]]:
    """First guesses of a law, and what is sought of it."""
    if law.knots:
        return par._replace(gap_law=float(GapLaw.table)), shape(law)[0 if law.offset > 0.0 else 1 :]
    values = fields(law)
    return par._replace(gap_law=float(GapLaw[law.name]), **values), tuple(values)


def _law_table(trials: Sequence[Trial], best: Trial) -> Table:
    """The laws that were tried."""
    rows = []
    for trial, worth in zip(trials, evidence([*trials])):
        taken = "taken" if trial is best else ""
        rows.append((trial.law.name, f"{trial.size}", quantity(rms(trial.left), "A"), f"{worth:.0f}", taken))
    return table("Gap laws, by the positions", ("", "numbers", "left of the current", "evidence", ""), rows)


def find_gap(
    par: Parameters,
    records: Sequence[Record],
    sought: Sought,
    inductances: Path | None,
    conventions: Sequence[str],
    period: float | None = None,
) -> Gap:
    """What is known and sought; unchanged where there are neither inductances nor positions."""
    found = [prepare_position(record, par, period) for record in records]
    if inductances is not None:
        return of_inductances(inductances, par, found, sought, conventions)
    if any(record.position_noise for record in found):
        return of_positions(par, found, sought, conventions, period)
    return Gap(par, sought, found, conventions)


def keep_law(known: Known, result: Identified, to: Path) -> Known:
    """What is known, with the law that was found; a table is written beside the file of the parameter set."""
    law = GapLaw(int(value_of(result.parameters, "gap_law"))).name
    if result.form.law is None:
        return known._replace(table=known.table if law == "table" else None)
    made = rows(result.form.law_at(result.ratios), float(value_of(result.parameters, "stop_upper")))
    return known._replace(table=write_table(to.with_name(f"{to.stem}_law.csv"), made))


def describe_gap(result: Identified, records: Sequence[Record]) -> list[Table | str]:
    """What was found of the gap, and whether the model explains the positions."""
    return [*slopes(result), *(_verdict(r, m) for r, m in zip(records, result.models) if r.position_noise)]


def _verdict(record: Record, model: Trajectory) -> str:
    """What the model leaves of a position."""
    assert record.position is not None and record.position_noise is not None
    left = rms(record.position[-model.position.size :] - model.position)
    is_noise = left < max(EXPLAINED * record.position_noise, EXACT * float(np.ptp(record.position)))
    return f"{record.name}: the model leaves {quantity(left, 'm')} of the position, " + (
        "which is noise."
        if is_noise
        else f"{left / record.position_noise:.2g} times its noise: the mechanics is another one (friction, bounces, a"
        " spring that is not linear), or the sensor (its scale, its delay)."
    )


def slopes(result: Identified) -> list[Table | str]:
    """The slopes of a table that was fitted, with their errors; what is the gap's of the rest."""
    if result.form.law is None:
        return []
    law, errors = result.form.law_at(result.ratios), result.uncertainty.shape
    made: list[Table | str] = []
    if errors:
        numbers = zip(law.knots, law.numbers, shape(law)[1:])
        cells = ((quantity(h, "m"), quantity(x, "1/(H.m)"), percent(errors[name])) for h, x, name in numbers)
        made.append(table("Slope of the gap reluctance", ("gap", "slope", "standard error"), cells))
    core = float(value_of(result.parameters, "core_reluctance"))
    return [
        *made,
        f"Of {quantity(law.offset + core, '1/H')} without gap {quantity(core, '1/H')} are the core's, which saturates.",
    ]
