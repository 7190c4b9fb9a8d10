"""What doubt about known parameters does to the fitted ones: these are fitted again with a known one changed.

What was given is as certain as `--accuracy` says.  What was assumed may be off by a factor, too much for derivatives:
so the fit is repeated with the value one standard error off, to both sides, or as far off as the records allow.  They
tell no stroke from another one, but something of the relaxed gap of a spring, say, which bends the motion.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from gapsense.identification.assumptions import scale
from gapsense.identification.causes import Matrix
from gapsense.identification.least_squares import independent
from gapsense.identification.measurements.record import Vector
from gapsense.identification.valve.errors import Uncertainty, largest, reported
from gapsense.identification.valve.form import Device, Form, multiply, replace_values, value_of
from gapsense.identification.valve.minimise import Fit, Weighted
from gapsense.identification.valve.model import Experiment, cost

STEP = 1e-3  # of a difference quotient
LINEAR = 0.1  # doubt up to which derivatives do
SHOWN = 10.0  # standard errors by one record that a value may be off; then the record shows it, whatever else is wrong
ALLOWED, TRIALS = 0.1, 5  # part by which the cost may grow, and times that a smaller change is tried
OPEN = 1.02  # least relaxed gap, in upper stops, of a spring that opens the valve
TINY = 1e-300
ALIKE: Mapping[str, Mapping[str, float]] = {  # powers by which fitted values go with held ones, about
    "stop_upper": {
        "coil_turns": 0.5,
        "core_reluctance": 1.0,
        "mover_mass": -2.0,
        "spring_stiffness": -2.0,
        "damping": -2.0,
    },
    "spring_rest": {"spring_stiffness": -1.0},
    "gap_slope": {"coil_turns": 0.5, "core_reluctance": 1.0},
    "gap_area": {"coil_turns": -0.5, "core_reluctance": -1.0},
}


class Ended(NamedTuple):
    """Where the fit ended."""

    form: Form
    ratios: Vector
    experiments: list[Experiment]


def shift(known: Device, name: str, by: float, tied: Collection[str] = ()) -> Device:
    """The device with another value: e^by times as large, or by that part; `tied` fields go with the stroke."""
    lower, upper = float(value_of(known, "stop_lower")), float(value_of(known, "stop_upper"))
    old = dict(multiply(known, name, float(np.exp(by))))
    if parts := scale(name.replace("_", ".")).parts:
        old = {name: max(0.0, float(value_of(known, name)) + by * (1.0 if parts == "1" else upper - lower))}
    rest, start = (float(value_of(known, field)) for field in ("spring_rest", "initial_position"))
    if name == "spring_rest" and rest > upper:
        old = {name: max(rest * float(np.exp(by)), min(rest, OPEN * upper))}
    if name == "stop_upper":
        old = {name: lower + (upper - lower) * float(np.exp(by))}
        old |= {field: value_of(known, field) * float(np.exp(by)) for field in tied}
    stops = {lower: old.get("stop_lower", lower), upper: old.get("stop_upper", upper)}
    return replace_values(known, **old, initial_position=stops.get(start, start))


def add_doubts(at: Ended, found: Uncertainty, doubts: Mapping[str, float], tied: Collection[str] = ()) -> Uncertainty:
    """The uncertainty with what doubts about held fields add, each by itself; see `shift`."""
    effects = [
        largest([np.outer(x, x) for x in move_by_doubt(at, name, doubt, tied)]) for name, doubt in doubts.items()
    ]
    return widen(found, at.form, sum(effects[1:], effects[0])) if effects else found


def move_by_doubt(at: Ended, name: str, doubt: float, tied: Collection[str]) -> list[Vector]:
    """What becomes of the logarithms of what is fitted, if a held value is off to either side."""
    form, one_sided = at.form, bool(scale(name.replace("_", ".")).parts)  # which may be 0, and not less

    def change(by: float) -> Device:
        return shift(form.known, name, by, tied)

    def residuals(by: float) -> Vector:
        return np.asarray(Weighted(form._replace(known=change(by)), at.experiments).residuals([at.ratios])[0])

    J, r = Weighted(form, at.experiments).jacobian(at.ratios), residuals(0.0)
    step = doubt if one_sided else STEP
    B = (residuals(step) - (r if one_sided else residuals(-step))) / (step if one_sided else 2.0 * step)
    slope = -np.linalg.pinv(J) @ B
    if not one_sided and doubt <= LINEAR:
        return [doubt * slope]
    alike = np.array([ALIKE.get(name, {}).get(fitted, 0.0) for fitted in form.fitted])
    sides = [min(doubt, bound(B + J @ slope, r))] if one_sided else [-doubt, doubt]
    return [refit(at, change, by, (slope, alike), cost(r)) for by in sides]


def bound(left: Vector, r: Vector) -> float:
    """How far off a value may be by the residuals, of which a change leaves so much."""
    size = max(float(left @ left), TINY)
    return abs(float(left @ r)) / size + SHOWN * float(np.sqrt(cost(r) / independent(r) / size))


def refit(at: Ended, change: Callable[[float], Device], by: float, slopes: Sequence[Vector], before: float) -> Vector:
    """The same by fits from where slopes lead; where the records do not allow a change, by a smaller one."""
    for _ in range(TRIALS):
        form = at.form._replace(known=change(by))
        ends = [_end(form, at.ratios + by * slope, at.experiments) for slope in slopes]
        ratios, least = min(ends, key=lambda end: end[1])
        grown = least / max(before, TINY) - 1.0
        if grown <= ALLOWED:
            break
        by *= float(np.clip(0.9 * np.sqrt(ALLOWED / grown), 0.1, 0.9))
    return np.asarray(ratios - at.ratios)


def _end(form: Form, start: Vector, experiments: list[Experiment]) -> tuple[Vector, float]:
    """The minimum next to a start, around which its bounds are, and the cost there."""
    law = None if form.law is None else form.law_at(start)
    fit = Fit(form._replace(known=form.at(start), law=law))
    ratios = fit.least_squares(fit.form.start, experiments)
    return start + ratios, fit.cost(ratios, experiments)


def widen(found: Uncertainty, form: Form, added: Matrix) -> Uncertainty:
    """The uncertainty with a covariance of the fitted logarithms added."""
    names = list(form.fitted)
    T = reported(form, len(found.causes))[:, : len(names)]
    std = np.array([*found.relative.tolist(), *found.causes.values()])
    sure = np.where(np.isfinite(std), std, 0.0)
    cov = found.correlation * np.outer(sure, sure) + T @ added @ T.T
    new = np.sqrt(np.diag(cov))
    scaled = np.where(new > 0.0, new, 1.0)
    correlation = np.where(np.isfinite(np.outer(std, std)), cov / np.outer(scaled, scaled), found.correlation)
    shape = {
        name: float(np.hypot(error, np.sqrt(added[names.index(name), names.index(name)])))
        for name, error in found.shape.items()
    }
    return found._replace(
        relative=np.where(np.isfinite(std), new, np.inf)[: found.relative.size], correlation=correlation, shape=shape
    )
