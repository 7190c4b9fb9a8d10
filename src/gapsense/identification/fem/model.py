"""Flux linkage and force of a table as one energy: a reduced model, and what it leaves as a smooth surface.

With W(lambda, h) the energy at rest, i = dW/dlambda and F = -dW/dh.  The reduced model is that of the estimators,

    i = lambda/N^2 (R(h) + R_c(lambda)),    F = -lambda^2/(2 N^2) dR/dh,

in which any leak that is parallel to the gap is part of R(h), and the core that all flux passes is R_c.  What it leaves
is sum c_jk M_j(lambda) N_k(h), by cubic B-splines: i and F are both linear in c, and no force is left that is not the
slope of the energy.  Second differences of c are penalised, as little as generalised cross-validation asks for
(P. Eilers and B. Marx 1996; G. Golub, M. Heath and G. Wahba 1979), or more, until the flux linkage rises with the
current and falls with the gap everywhere.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.interpolate import BSpline, CubicSpline
from scipy.linalg import cholesky, eigh, solve_triangular

from gapsense.estimators.core_losses import SATURATED
from gapsense.identification.fem.reading import Solved
from gapsense.identification.gap_law.laws import Law, Matrix, Vector, lowest, not_negative, reluctance, total
from gapsense.identification.least_squares import rms

FORMS = ("Froehlich", "bent")  # R_c0/(1 - x), or K x^2/(1 - x^2), at x = flux linkage over that of saturation
SHARP, POWER = "sharp", 8.0  # K x^8, which no estimator has, to compare with
LAWS = ((1, 1), (2, 1), (3, 1), (3, 2), (3, 3), (3, 4), (3, 6), (3, 8))  # degree and number, of the slope of R
LEAST = 1e-4  # least slope of R, in the largest one: R rises everywhere
FARTHEST = 30.0  # saturation, in the largest flux linkage
SMALL = 0.05  # of the largest value: below, errors are relative to that
PIECES = (8, 10)  # of the surface, at most, by flux linkage and by gap
RIDGE = 1e-3  # penalty of the surface itself, over that of its second differences
MORE = 4.0  # factor of the penalty until the surface is that of a device
CERTAIN = 5e-4  # relative error of what was solved, at least: a mesh is no finer
FLUXES, GAPS = 41, 40  # rows of a map
FINE = 4  # times that, on which it is looked at
SLOPES = 121  # at which that of R is kept
TINY = 1e-12


class Reduced(NamedTuple):
    """The model of the estimators."""

    turns: float
    law: Law  # reluctance of the gap, with what is beside it and of the core without flux
    form: str  # of the core
    core: float  # R_c0 of Froehlich, or K of the bent one [1/H]
    saturation: float  # [Wb]


def bend(x: Vector, form: str) -> tuple[Vector, Vector]:
    """Reluctance of the core in parts of its coefficient, and the derivative by x; from `SATURATED` on linear."""
    y = np.minimum(x, SATURATED)
    if form == SHARP:
        value, rate = y**POWER, POWER * y ** (POWER - 1.0)
    elif form == "bent":
        value, rate = y**2 / (1.0 - y**2), 2.0 * y / (1.0 - y**2) ** 2
    else:
        value, rate = 1.0 / (1.0 - y), 1.0 / (1.0 - y) ** 2
    return value + (x - y) * rate, rate


def current(m: Reduced, lam: Vector, h: Vector) -> tuple[Vector, Vector]:
    """The current [A], and its derivative by the flux linkage [1/H]."""
    x = lam / m.saturation
    value, rate = bend(x, m.form)
    R = total(m.law, h) + m.core * value
    return lam * R / m.turns**2, (R + m.core * rate * x) / m.turns**2


def force(m: Reduced, lam: Vector, h: Vector) -> Vector:
    """Negative: it closes the gap [N]."""
    return np.asarray(-0.5 * (lam / m.turns) ** 2 * reluctance(m.law, h)[1])


def scale(x: Vector) -> Vector:
    """What errors of some values are relative to."""
    return np.asarray(np.abs(x) + SMALL * np.abs(x).max())


def reduce(points: Solved, turns: float, form: str | None = None) -> Reduced:
    """The reduced model nearest to the points: relative errors of current and force, by Schwarz's criterion."""
    gaps = np.unique(points.gap)
    found = [
        fit(points, turns, each, degree, space_knots(gaps, float(gaps[0]), float(gaps[-1]), pieces, degree))
        for each in (FORMS if form is None else [form])
        for degree, pieces in LAWS
        if degree + pieces < gaps.size
    ]
    n = points.gap.size * (1 if points.force is None else 2)
    worth = [n * np.log(cost + TINY * n) + size * np.log(n) for _, size, cost in found]
    return found[int(np.argmin(worth))][0]


def fit(points: Solved, turns: float, form: str, degree: int, knots: Vector) -> tuple[Reduced, int, float]:
    """The model with one core and a slope of R by B-splines, none negative; its numbers, and its squared errors."""
    lam, h, low = points.flux_linkage, points.gap, knots[:1]
    heights, fixed = splines(knots, h, degree=degree), splines(knots, h, -1, degree)
    fixed = np.column_stack((lam, (fixed + low * splines(knots, low, degree=degree)) * lam[:, None]))
    fixed, wanted = fixed / (turns**2 * scale(points.current)[:, None]), points.current / scale(points.current)
    pull = np.zeros((0, heights.shape[1]))
    if points.force is not None:
        pull = -0.5 * (lam / turns)[:, None] ** 2 * heights / scale(points.force)[:, None]
        wanted = np.concatenate((wanted, points.force / scale(points.force)))
    fixed = np.vstack((fixed, np.column_stack((np.zeros(len(pull)), pull))))
    Q = np.linalg.qr(fixed).Q  # once: all but the column of the core stay

    def solve_factors(logarithm: float) -> tuple[Vector, float]:
        """Solve the factors for a saturation of this logarithm, and the squares that they leave."""
        column = lam * bend(lam / np.exp(logarithm), form)[0] / (turns**2 * scale(points.current))
        column = np.append(column, np.zeros(len(pull)))
        other = column - Q @ (Q.T @ column)
        size = float(np.linalg.norm(other)) or 1.0
        basis = np.column_stack((Q, other / size))
        columns, values = np.column_stack((basis.T @ column, basis.T @ fixed)), basis.T @ wanted
        factors = not_negative(columns, values)
        beside = float(wanted @ wanted - values @ values)
        return factors, float(((columns @ factors - values) ** 2).sum()) + max(beside, 0.0)

    spans = np.log(lam.max() * np.geomspace(1.0 / SATURATED, FARTHEST, 30))
    at = lowest(lambda x: solve_factors(x)[1], spans)
    (core, offset, *slopes), cost = solve_factors(at)[0].tolist(), solve_factors(at)[1]
    fine = np.linspace(knots[0], knots[-1], SLOPES)
    rise = splines(knots, fine, degree=degree) @ slopes
    law = Law("slopes", offset, tuple(np.maximum(rise, LEAST * rise.max()).tolist()), tuple(fine.tolist()))
    made = Reduced(turns=turns, law=law, form=form, core=core, saturation=float(np.exp(at)))
    return made, len(slopes) + 3, cost


class Surface(NamedTuple):
    """A reduced model with a smooth correction."""

    base: Reduced
    flux_knots: Vector  # of B-splines, that at 0 left out [Wb]
    gap_knots: Vector  # [m]
    factors: Matrix  # (by flux linkage, by gap) [A]
    numbers: float = 0.0  # as many free ones as smoothing leaves
    apart: tuple[Vector, ...] = ()  # of each point, flux linkage and force from the surface of the others, relative

    def current(self, lam: Vector, h: Vector) -> Vector:
        """The current [A]."""
        by_flux, by_gap = splines(self.flux_knots, lam)[:, 1:], splines(self.gap_knots, h)
        return np.asarray(current(self.base, lam, h)[0] + np.einsum("nj,jk,nk->n", by_flux, self.factors, by_gap))

    def force(self, lam: Vector, h: Vector) -> Vector:
        """The force [N]."""
        energy, slope = splines(self.flux_knots, lam, -1)[:, 1:], splines(self.gap_knots, h, 1)
        return np.asarray(force(self.base, lam, h) - np.einsum("nj,jk,nk->n", energy, self.factors, slope))


def splines(knots: Vector, x: Vector, order: int = 0, degree: int = 3) -> Matrix:
    """All B-splines at some places, their derivatives (1), or their integrals from the first knot on (-1)."""
    made = BSpline(knots, np.eye(knots.size - degree - 1), degree)
    made = made.antiderivative() if order < 0 else made.derivative(order) if order else made
    return np.asarray(made(x))


def space_knots(x: Vector, low: float, high: float, most: int, degree: int = 3) -> Vector:
    """Space knots from `low` to `high` with about as many values between two of them."""
    count = max(1, min(most, np.unique(np.round(x, 12)).size - 2))
    inner = np.unique(np.quantile(np.unique(x), np.linspace(0.0, 1.0, count + 1)))[1:-1]
    inside = inner[(inner > low) & (inner < high)]
    return np.concatenate(([low] * (degree + 1), inside, [high] * (degree + 1)))


def smooth(points: Solved, base: Reduced, low: float, high: float, has_force: bool = True) -> Surface:
    """The smoothest surface, for gaps from `low` to `high`, that the points allow."""
    lam, h = points.flux_linkage, points.gap
    most = (PIECES[0] if not points.has_one_current else 2, PIECES[1])
    made = Surface(
        base=base,
        flux_knots=space_knots(lam, 0.0, float(lam.max()), most[0]),
        gap_knots=space_knots(h, min(low, float(h.min())), max(high, float(h.max())), most[1]),
        factors=np.zeros((0, 0)),
    )
    modelled, steep = current(base, lam, h)
    by_gap, size = splines(made.gap_knots, h), float(points.current.max())
    rows = [products(splines(made.flux_knots, lam)[:, 1:], by_gap) * size / (steep * scale(lam))[:, None]]
    left = [(points.current - modelled) / (steep * scale(lam))]
    if has_force and points.force is not None:
        energy, slope = splines(made.flux_knots, lam, -1)[:, 1:], splines(made.gap_knots, h, 1)
        rows.append(-products(energy, slope) * size / scale(points.force)[:, None])
        left.append((points.force - force(base, lam, h)) / scale(points.force))
    shape = (made.flux_knots.size - 5, made.gap_knots.size - 4)
    root = cholesky(penalty(*shape), lower=True)
    errors = [max(rms(part), CERTAIN) for part in left]
    for _ in range(3):  # how certain flux linkage and force are follows from what is left of each
        found = solve_penalised(rows, left, errors, root)
        errors = [max(error, CERTAIN) for error in found.errors]
    while True:
        made = made._replace(
            factors=size * found.at(found.penalty).reshape(shape),
            numbers=found.freedom(found.penalty),
            apart=tuple(found.apart(*each) for each in zip(rows, left, found.weights)),
        )
        if to_map(made).is_device or found.penalty > 1e8 * found.values.max():
            return made
        found = found._replace(penalty=MORE * found.penalty)


def products(a: Matrix, b: Matrix) -> Matrix:
    """All products of columns, (n, columns of a times those of b)."""
    return np.asarray((a[:, :, None] * b[:, None, :]).reshape(len(a), -1))


def penalty(by_flux: int, by_gap: int) -> Matrix:
    """Of second differences in both directions; before the first by flux linkage there is one that is 0."""
    D = np.diff(np.eye(by_flux + 1), 2, axis=0)[:, 1:] if by_flux > 1 else np.eye(by_flux)
    E = np.diff(np.eye(by_gap), 2, axis=0)
    wide = np.kron(D.T @ D, np.eye(by_gap)) + np.kron(np.eye(by_flux), E.T @ E)
    return np.asarray(wide + RIDGE * np.eye(by_flux * by_gap))


class Penalised(NamedTuple):
    """Least squares with a penalty of any size, in coordinates in which both are diagonal."""

    directions: Matrix
    values: Vector  # eigenvalues
    along: Vector  # what the data say along each direction
    penalty: float  # that foretells best
    errors: list[float]  # standard deviations of each kind of data, with it
    weights: list[float]  # of each kind, that were used

    def apart(self, rows: Matrix, left: Vector, weight: float) -> Vector:
        """How far each datum is from what all others predict."""
        used = ((weight * rows @ self.directions) ** 2 / (self.values + self.penalty)).sum(axis=1)
        return np.asarray((left - rows @ self.at(self.penalty)) / np.maximum(1.0 - used, TINY))

    def at(self, penalty: float) -> Vector:
        """The factors."""
        return np.asarray(self.directions @ (self.along / (self.values + penalty)))

    def freedom(self, penalty: float) -> float:
        """How many numbers are free."""
        return float((self.values / (self.values + penalty)).sum())


def solve_penalised(rows: list[Matrix], left: list[Vector], errors: list[float], root: Matrix) -> Penalised:
    """Solve for several kinds of data with errors of their own; `root` times its transpose is the penalty."""
    A = np.vstack([part / error for part, error in zip(rows, errors)])
    r = np.concatenate([part / error for part, error in zip(left, errors)])
    B = solve_triangular(root, A.T, lower=True)
    values, U = eigh(B @ B.T)
    values = np.maximum(values, 0.0)
    found = Penalised(
        directions=solve_triangular(root.T, U),
        values=values,
        along=U.T @ (B @ r),
        penalty=0.0,
        errors=[],
        weights=[1.0 / e for e in errors],
    )

    def cross_validate(penalty: float) -> float:
        shares = 1.0 / (values + penalty)
        misfit = r @ r - (found.along**2 * shares * (2.0 - values * shares)).sum()
        return float(misfit / max(1.0 - found.freedom(penalty) / r.size, TINY) ** 2)

    sizes = values.max() * np.geomspace(1e-9, 1e3, 49)
    best = float(sizes[int(np.argmin([cross_validate(size) for size in sizes]))])
    found, made = found._replace(penalty=best), list[float]()
    for part, rest, error in zip(rows, left, errors):
        used = float(((part / error @ found.directions) ** 2 / (values + best)).sum())
        made.append(float(np.sqrt(((part @ found.at(best) - rest) ** 2).sum() / max(rest.size - used, 1.0))))
    return found._replace(errors=made)


class Map(NamedTuple):
    """Currents on a grid, which a plant reads: between its rows a cubic spline in both directions."""

    gap: Vector  # [m]
    flux_linkage: Vector  # from 0 on [Wb]
    current: Matrix  # (gaps, flux linkages) [A]

    @property
    def is_device(self) -> bool:
        """Whether the current rises with the flux linkage and with the gap, between the rows too."""
        lam, i = self.flux_linkage, self.current
        odd = CubicSpline([*-lam[:0:-1], *lam], np.hstack((-i[:, :0:-1], i)), axis=1)
        fine = CubicSpline(self.gap, odd(refine_values(lam)), axis=0)(refine_values(self.gap))
        return bool((np.diff(fine, axis=1) > 0.0).all() and (np.diff(fine[:, 1:], axis=0) > 0.0).all())


def refine_values(x: Vector) -> Vector:
    """Refine with more values between."""
    return np.interp(np.linspace(0.0, x.size - 1.0, FINE * (x.size - 1) + 1), np.arange(x.size), x)


def to_map(s: Surface) -> Map:
    """The surface on a grid whose flux linkages are denser where the current of the smallest gap bends."""
    h, most = np.linspace(s.gap_knots[0], s.gap_knots[-1], GAPS), float(s.flux_knots[-1])
    fine = np.linspace(0.0, most, 20 * FLUXES)
    i = s.current(fine, np.full(fine.size, h[0]))
    way = fine / most + np.maximum.accumulate(i) / max(float(i.max()), TINY)
    lam = np.interp(np.linspace(0.0, way[-1], FLUXES), way, fine)
    lam[0], lam[-1] = 0.0, most
    return Map(h, lam, s.current(np.tile(lam, GAPS), np.repeat(h, FLUXES)).reshape(GAPS, FLUXES))


class Left(NamedTuple):
    """What a model leaves of a table, at each point."""

    flux: Vector  # relative to the flux linkage
    current: Vector  # [A]
    force: Vector | None  # relative to the force


def left_of(points: Solved, model: Surface | Reduced) -> Left:
    """Values of the model less those of the table."""
    lam, h = points.flux_linkage, points.gap
    base = model.base if isinstance(model, Surface) else model
    i = model.current(lam, h) if isinstance(model, Surface) else current(model, lam, h)[0]
    F = model.force(lam, h) if isinstance(model, Surface) else force(model, lam, h)
    e = i - points.current
    return Left(
        flux=-e / (current(base, lam, h)[1] * scale(lam)),
        current=e,
        force=None if points.force is None else (F - points.force) / scale(points.force),
    )
