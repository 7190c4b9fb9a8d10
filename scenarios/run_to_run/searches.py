"""Searches of the literature for what a profile should believe of its mover: every cycle is a trial, with its cost.

`nelder-mead` is the downhill simplex over (a, b, q) of each operation; `fisher` the same in the plane of the two
directions in which the nominal profile of the flux linkage changes most, by its Fisher information.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from gapsense.control import laws
from gapsense.control.learning import LARGEST, with_law
from gapsense.control.mover import make_mover
from gapsense.control.profile import Operation, flux
from gapsense.control.records import Parameters
from gapsense.control.tracking import plan_operation

Floats = npt.NDArray[np.float64]
Search = Generator[Floats, float, None]
SIZE = 0.5  # of the first simplex, in standard deviations of a, b, q before anything is learnt
SPEED = 0.15  # of all approaches [m/s]
DIRECTIONS = 2  # of a Fisher basis
INSTANTS, STEP = 200, 1e-4  # of the sensitivity of a profile; change of a parameter
OFFSETS = tuple(f"{o}_{name}" for o in ("closing", "opening") for name in ("balance", "tilt", "lightness"))
BEFORE = np.array(laws.BEFORE[:3])


def nelder_mead(start: Floats, size: float = SIZE) -> Search:
    """The points to try, without an end; each is sent its cost."""
    simplex: list[tuple[float, Floats]] = []
    for point in (start, *(start + size * e for e in np.eye(start.size))):
        simplex.append(((yield point), point))
    while True:
        simplex.sort(key=_cost)
        *better, worst = simplex
        middle = np.mean([point for _, point in better], axis=0)
        new = yield from _beyond(better, worst, middle)
        if new[0] < worst[0]:
            simplex = [*better, new]
            continue
        (_, best), shrunk = simplex[0], simplex[:1]
        for _, point in simplex[1:]:
            nearer = 0.5 * (best + point)
            shrunk.append(((yield nearer), nearer))
        simplex = shrunk


def _beyond(
    better: list[tuple[float, Floats]], worst: tuple[float, Floats], middle: Floats
) -> Generator[Floats, float, tuple[float, Floats]]:
    """What takes the place of the worst point: its mirror image, one further out, or one nearer."""
    mirrored = 2.0 * middle - worst[1]
    found = ((yield mirrored), mirrored)
    if better[0][0] <= found[0] < better[-1][0]:
        return found
    is_best = found[0] < better[0][0]
    other = 3.0 * middle - 2.0 * worst[1] if is_best else 0.5 * (middle + min(found, worst, key=_cost)[1])
    return min(found, ((yield other), other), key=_cost) if is_best else ((yield other), other)


def _cost(tried: tuple[float, Floats]) -> float:
    return tried[0]


class Trials(NamedTuple):
    """Searches of all actuators, closing and opening, and the points that they want tried now."""

    bases: list[Floats]  # (3, dimensions) of each operation: from the point of a search to (a, b, q)
    searches: list[list[Search]]
    points: list[list[Floats]]


def begun(law: str, runs: int, par: Parameters) -> Trials:
    """Before the first trial: nominal."""
    bases = [fisher_basis(half, par) if law == "fisher" else np.diag(BEFORE) for half in (1.0, 0.0)]
    searches = [[nelder_mead(np.zeros(basis.shape[1])) for _ in range(runs)] for basis in bases]
    return Trials(bases, searches, [[next(search) for search in those] for those in searches])


def told(trials: Trials, speeds: Floats) -> Trials:
    """After a trial: impact speeds of all closings and openings, (2, runs)."""
    sent = zip(trials.searches, speeds.tolist())
    return trials._replace(points=[[s.send(cost) for s, cost in zip(those, costs)] for those, costs in sent])


def columns(trials: Trials) -> dict[str, Floats]:
    """Parameters of the loop for the next cycle, `law.*`."""
    offsets = [basis @ np.transpose(points) for basis, points in zip(trials.bases, trials.points)]
    rows = np.clip(np.concatenate(offsets), -LARGEST, LARGEST)
    return {f"law.{name}": row[None] for name, row in zip(OFFSETS, rows)} | {"law.given_speed": np.array([[SPEED]])}


def fisher_basis(half: float, par: Parameters) -> Floats:
    """The directions of (a, b, q) in which the nominal profile changes most, in standard deviations, (3, 2)."""
    travel = par.closing_travel if half else par.opening_travel
    profile = _profile(plan_operation(half, SPEED, travel, 0.0, par), par)
    columns = [(profile(STEP * e) - profile(-STEP * e)) / (2.0 * STEP) for e in np.diag(BEFORE)]
    sensitivity = np.transpose(columns)
    _, vectors = np.linalg.eigh(sensitivity.T @ sensitivity)
    signs = np.sign(vectors[np.abs(vectors).argmax(axis=0), range(3)])  # an eigenvector has none
    directions: Any = np.diag(BEFORE) @ (signs * vectors)[:, : -1 - DIRECTIONS : -1]
    return np.asarray(directions, float)


def _profile(plan: Operation, par: Parameters) -> Callable[[Floats], Floats]:
    """Flux linkage of the motion of an operation, as function of (a, b, q)."""
    times = plan.lead + plan.travel * np.linspace(0.0, 1.0, INSTANTS)
    return lambda law: np.array([flux(float(t), plan, with_law(make_mover(par), law)) for t in times])
