"""What the driver takes of a recorded voltage, and how late the current is: given, or found with the parameters.

Each is a cause of `causes`, with one value for all records.  After each fit of the parameters one Gauss-Newton step
moves both, then the records are prepared anew.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from gapsense._os.files import finite
from gapsense.identification.assumptions import SCALES
from gapsense.identification.causes import ANYWHERE, is_place
from gapsense.identification.measurements.record import Record, Vector
from gapsense.identification.valve.errors import linearise, scales
from gapsense.identification.valve.form import Sought
from gapsense.identification.valve.minimise import ENOUGH, Fit, Trial, choose_form, evidence, is_quiet, relative
from gapsense.identification.valve.model import Experiment, First, Prepared, residuals
from gapsense.report.table import quantity

TAKEN = {"series": "Ohm", "drop": "V", "delay": "s"}  # causes that may be given or fitted
OHMS = "coil.resistance"
PERCENT = dict.fromkeys(("voltage", "current", OHMS, *(n for n in SCALES if n != "stop.restitution")), "PERCENT")
WARMEST, COPPER = 0.3, 3.9e-3  # of the resistance, relative to the one that is known; its change by degree
CERTAIN = 3.0  # standard errors of the one that is known, where they are told
ROUNDS = 6
CLOSE = 0.05  # standard errors of a step that ends the search
FARTHEST = {"series": 0.2, "drop": 0.05, "delay": 0.5}  # of its scale, in one step
EDGE = 1.0  # the same, of the place of an edge [samples]
DOUBTFUL = 3.0  # standard errors, by white residuals, from which a delay is tried
FIT = "fit"


class Driver(NamedTuple):
    """Which causes are known, and which are fitted, starting from these values or from zero."""

    values: Mapping[str, float] = {}
    fitted: tuple[str, ...] = ()
    accuracy: Mapping[
        str, float
    ] = {}  # relative standard errors of the scales of voltage and current, or of a parameter

    def of(self, records: Sequence[Record]) -> list[Record]:
        """The records, marked with the known causes that are to be taken out of them."""
        return [record._replace(drive=self.values) for record in records]

    @property
    def is_timed(self) -> bool:
        """Whether the delay is given, or fitted whatever the evidence."""
        return "delay" in (*self.values, *self.fitted)


UNKNOWN = Driver()


def read_driver(driver: str | None, accuracy: str | None = None) -> Driver:
    """From the values of `--driver`, as `series=2,drop=0.8`, and `--accuracy`; a ValueError tells what is wrong."""
    texts, scales = dict[str, str](), dict[str, str]()
    for part in split_names([driver or ""]):
        texts |= _parse_part(part, TAKEN, "--driver")
    for part in split_names([accuracy or ""]):
        scales |= _parse_part(part, PERCENT, "--accuracy")
    values = {name: float(text) for name, text in texts.items() if text != FIT}
    errors = {name: 0.01 * float(text) for name, text in scales.items()}
    return Driver(values, tuple(name for name in TAKEN if texts.get(name) == FIT), errors)


def split_names(texts: Sequence[str]) -> list[str]:
    """Names with commas between."""
    return [name.strip() for text in texts for name in text.split(",") if name.strip()]


def _parse_part(part: str, units: Mapping[str, str], option: str) -> dict[str, str]:
    """Parse names with their values; those of `fit` alone are what a driver takes."""
    if part == FIT and units is TAKEN:
        return {"series": FIT, "drop": FIT}
    name, _, value = part.partition("=")
    least = -np.inf if name == "delay" else 0.0  # either of the two channels may be the later one
    size = finite(value)
    if name in units and ((value == FIT and units is TAKEN) or (size is not None and size >= least)):
        return {name: value}
    wanted = ",".join(f"{n}={unit}" for n, unit in units.items())
    more = ", each a number or `fit`; or `fit` alone" if units is TAKEN else ", in percent, none negative"
    raise ValueError(f"{option}: `{part}` found, some of `{wanted}`{more}, expected.")


def driver_notes(values: Mapping[str, float]) -> list[str]:
    """A sentence on what was taken out of the records, if anything was."""
    found = ", ".join(f"{name} {quantity(value, TAKEN[name])}" for name, value in values.items())
    return [f"Taken out of the recorded voltage and current: {found}."] if found else []


def doubt_resistance(resistance: float, believed: float | None, error: float | None = None) -> list[str]:
    """A sentence, if neither heat in copper nor the error of the known resistance explains that of (23).

    A voltage that is too large by a factor is explained by other values of the parameters: no residual shows it.
    """
    if not believed or abs(resistance / believed - 1.0) < (WARMEST if error is None else CERTAIN * error):
        return []
    change = resistance / believed - 1.0
    return [
        f"`coil.resistance` is {quantity(resistance, 'Ohm')} by (23), {100.0 * change:+.0f} % from the"
        f" {quantity(believed, 'Ohm')} of `--parameters`. In copper that would be {change / COPPER:+.0f} K:"
        " the recorded voltage is not the coil's (PWM sampled in step with it, a command), or the scale of a signal is"
        " wrong, and so are turns, stiffness, damping and mass. If the value is right, correct it in that file."
    ]


def settle(fit: Fit, ratios: Vector, prepared: Prepared, names: Sequence[str]) -> tuple[Vector, Prepared]:
    """The minimum for the first operations in parameters and causes, next to where the parameters fit best."""
    for _ in range(ROUNDS if names else 0):
        step = correction(fit, ratios, [first.experiment for first in prepared.firsts], names, prepared.places)
        prepared = prepared.move_causes(step.causes)
        ratios = fit.least_squares(step.ratios, [first.experiment for first in prepared.firsts])
        if step.is_small:
            break
    return ratios, prepared


class Step(NamedTuple):
    """Towards a minimum in parameters and causes."""

    ratios: Vector  # of the parameters, afterwards
    causes: dict[str, float]  # changes
    is_small: bool
    is_doubtful: bool  # whether a cause may be none


def correction(
    fit: Fit,
    ratios: Vector,
    experiments: Sequence[Experiment],
    names: Sequence[str],
    places: Mapping[str, float] = MappingProxyType({}),
) -> Step:
    """One Gauss-Newton step, not too far, with the edges at `places`; its errors are those of white residuals."""
    at, r = linearise(fit.form, ratios, experiments, names, ()), residuals(fit.form, [ratios], experiments)[0]
    k, sizes = ratios.size, scales(experiments, names)
    off = np.append(np.zeros(k), [places.get(name, 0.0) / ANYWHERE for name in names])
    found = -at.inverse @ r - at.believed @ off
    error = np.sqrt((at.inverse[k:] ** 2).sum(axis=1) * float(r @ r) / r.size)
    wanted, most = found[k:], np.array([EDGE if is_place(name) else FARTHEST[name] for name in names])
    part = float(np.min(most / np.maximum(np.abs(wanted), most)))
    low, high = fit.form.limits
    return Step(
        ratios=np.clip(ratios + part * found[:k], 0.99 * low, 0.99 * high),
        causes={name: float(part * x * sizes[name]) for name, x in zip(names, wanted)},
        is_small=bool(np.all(np.abs(wanted) <= CLOSE * error)),
        is_doubtful=bool(np.all(np.abs(wanted) <= DOUBTFUL * error)),
    )


class Timed(NamedTuple):
    """The forms that were tried, with or without a delay."""

    prepared: Prepared
    trials: list[Trial]
    causes: tuple[str, ...]  # that are fitted
    others: Sequence[tuple[float, Timed]] = ()  # those not taken, and the evidence against each


def choose_timing(fit: Fit, ratios: Vector, prepared: Prepared, sought: Sought, drive: Driver) -> Timed:
    """The forms of the model, and a delay or the places of edges if the evidence is for it.

    Both look much like eddy currents.  They are tried if the chosen form has some, or leaves a residual that they
    explain. They are never tried where eddy currents must not be sought, because these would pass as a delay.
    """
    without = Timed(prepared, choose_form(fit, ratios, prepared.firsts, sought), drive.fitted)
    best, firsts = last_taken(without.trials), prepared.firsts
    if drive.is_timed or "eddy" not in sought.forms or is_quiet(best, firsts):
        return without
    other, at, found = Fit(best.form), [first.experiment for first in firsts], [(0.0, without)]
    inside = [name for name in prepared.edges if best.form.added and is_inside(name, firsts)]  # else all, at the end
    for causes in (("delay",), tuple(inside)):
        if causes and (best.form.added or not correction(other, best.ratios, at, causes).is_doubtful):
            names = (*drive.fitted, *causes)
            start, moved = settle(fit, ratios, prepared, names)
            if moved.is_alike:
                continue
            timed = Timed(moved, choose_form(fit, start, moved.firsts, sought), names)
            end = last_taken(timed.trials)
            more = len(causes) + len(end.form.fitted) - len(best.form.fitted)
            left, now = relative(best.errors, firsts), relative(end.errors, moved.firsts)
            found.append((evidence(left, now, more) - ENOUGH, timed))
    most, timed = max(found, key=lambda pair: pair[0])
    others = [(most - each, other) for each, other in found if other is not timed and not _has_places(other)]
    edges = prepared.edges if _has_places(timed) else []
    return timed._replace(causes=tuple(dict.fromkeys((*timed.causes, *edges))), others=others)


def _has_places(timed: Timed) -> bool:
    return any(map(is_place, timed.causes))


def is_inside(name: str, firsts: Sequence[First]) -> bool:
    """Whether an edge lies in the first operation of its record."""
    _, record, sample = name.split(".")
    inside = firsts[int(record)].experiment
    return 0 < int(sample) - inside.first < inside.current.size


def last_taken(trials: Sequence[Trial]) -> Trial:
    """The last form that was taken."""
    return [trial for trial in trials if trial.is_taken][-1]
