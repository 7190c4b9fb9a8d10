"""The gap law that measured positions tell, fitted together with all else."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from rich.table import Table

from gapsense.actuators.magnetics import MU_0
from gapsense.actuators.solenoid_valve import GapLaw, Parameters
from gapsense.identification.gap_law import choice, motion
from gapsense.identification.gap_law.file import fields
from gapsense.identification.gap_law.laws import Law, Vector
from gapsense.identification.measurements.flux import estimate
from gapsense.identification.measurements.operations import operations
from gapsense.identification.measurements.record import Record, between
from gapsense.identification.valve.form import shape
from gapsense.identification.valve.forms import Sought
from gapsense.identification.valve.gap.start import TURNS, Gap, noises
from gapsense.identification.valve.scales import LAWS
from gapsense.report.table import quantity, table

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
    readings = [[between(record, name) for record in records] for name in conventions] or [[*records]]
    is_known = TURNS not in sought.held and (sought.given is None or not sought.given.isdisjoint(LAWS[par.gap_law]))
    laws = [_laws(par, reading, is_known, period) for reading in readings]
    left = [min(motion.square(trial.left) for trial in trials) for trials in laws]
    k = left.index(min(left))
    best = motion.best(laws[k])
    told: list[Table | str] = [_shown(laws[k], best), *noises(records)]
    if best.law.name == motion.KNOWN:
        return Gap(
            parameters=_confirmed(par, best),
            sought=sought,
            records=records,
            conventions=conventions[k : k + 1],
            told=[*told, CONFIRMED],
        )
    known = par._replace(core_reluctance=best.core_reluctance, core_saturation=best.core_saturation)
    known, names = _started(known, best.law)
    law = best.law if best.law.knots else None
    sought = sought._replace(held=(*sought.held, TURNS), gap=names, law=law)
    return Gap(
        parameters=known,
        sought=sought,
        records=records,
        conventions=conventions[k : k + 1],
        told=[*told, HELD.format(float(par.coil_turns))],
    )


def _confirmed(par: Parameters, found: motion.Trial) -> Parameters:
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


def _laws(par: Parameters, records: Sequence[Record], is_known: bool, period: float | None) -> list[motion.Trial]:
    """Gap laws that positions tell; first that which is known, if it may be."""
    parts = []
    for record in records:
        if record.position is not None and record.position_noise:
            flux = estimate(record, operations(record, period))
            first = flux.operations[0].start
            parts.append((record.current[first:], flux.flux_linkage[first:], record.position[first:]))
    columns: list[Vector] = [np.concatenate(part) for part in zip(*parts)]
    samples, turns = motion.Samples(*columns), float(par.coil_turns)
    known = [motion.scaled(samples, turns, _law(par))] if is_known else []
    return [*known, *motion.trials(samples, turns, float(par.stop_upper))]


def _started(par: Parameters, law: Law) -> tuple[Parameters, tuple[str, ...]]:
    """First guesses of a law, and what is sought of it."""
    if law.knots:
        return par._replace(gap_law=float(GapLaw.table)), shape(law)[0 if law.offset > 0.0 else 1 :]
    values = fields(law)
    return par._replace(gap_law=float(GapLaw[law.name]), **values), tuple(values)


def _shown(trials: Sequence[motion.Trial], best: motion.Trial) -> Table:
    """The laws that were tried."""
    rows = (
        (
            trial.law.name,
            f"{trial.size}",
            quantity(choice.rms(trial.left), "A"),
            f"{worth:.0f}",
            "taken" if trial is best else "",
        )
        for trial, worth in zip(trials, motion.evidence([*trials]))
    )
    return table("Gap laws, by the positions", ("", "numbers", "left of the current", "evidence", ""), rows)
