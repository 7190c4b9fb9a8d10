"""The coil of one or more records: the form that the evidence is for, its parameters, and how well it explains them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from gapsense._os.workers import Progress
from gapsense.identification.coil import evidence
from gapsense.identification.coil.device import Parameters
from gapsense.identification.coil.forms import FORMS, RICHEST, Form
from gapsense.identification.coil.problem import Matrix, Minimum, Problem, minimum, simulate
from gapsense.identification.coil.runs import driving, run, scale
from gapsense.identification.measurements.flux import mean_resistance
from gapsense.identification.measurements.record import Record
from gapsense.identification.residual import Residual, residual
from gapsense.identification.valve.errors import long_run
from gapsense.identification.valve.model import Trajectory
from gapsense.identification.valve.prepared import without_causes

POOR = 0.25  # relative standard error from which a parameter counts as not identified: of losses 10 % is good


class Tried(NamedTuple):
    """One form."""

    form: Form
    rms: float  # of the residual over the noise
    against: float  # what speaks against it, beside the one taken


class Coil(NamedTuple):
    """What was found, and how well."""

    parameters: Parameters
    form: Form
    names: list[str]  # fields that were fitted, in the order of the covariance
    covariance: Matrix  # of their logarithms, with the misfit in it; infinite without effect
    held: list[str]  # fields at a limit of the search
    offsets: list[tuple[float, float]]  # of voltage [V] and current [A] in each record, which the rest does not show
    models: list[Trajectory]  # from the first operation of each record on; the current as it would be measured
    residuals: list[Residual]
    tried: list[Tried]
    convention: str  # the voltage between samples, see `record.halves`
    records: Sequence[Record]  # with that voltage
    balanced: float | None  # (23), of the voltage as it was read, if its converter may hide an offset [Ohm]

    @property
    def errors(self) -> dict[str, float]:
        """Relative standard errors by field, but for those at a limit."""
        return dict(zip(self.names, np.sqrt(np.diag(self.covariance)).tolist()))

    @property
    def is_explained(self) -> bool:
        """Whether the coil explains all records."""
        return all(found.is_explained for found in self.residuals)

    @property
    def poor(self) -> list[str]:
        """Fields that the records do not identify, but for those at a limit."""
        return [name for name, error in self.errors.items() if not error < POOR]

    @property
    def inductance(self) -> float:
        """Without flux, of the first small change [H]."""
        par = self.parameters
        return float(1.0 / (par.air + par.core + par.hysteresis / par.turnover))

    @property
    def inductance_error(self) -> float:
        """Its relative standard error."""
        par = self.parameters
        turned = par.hysteresis / par.turnover
        slopes = {"air": par.air, "core": par.core, "hysteresis": turned, "turnover": -turned}
        w = self.inductance * np.array([slopes.get(name, 0.0) for name in self.names])
        return float(np.sqrt(w @ self.covariance @ w))


def identify(
    records: Sequence[Record],
    period: float | None = None,
    conventions: Sequence[str] = (),
    wanted: bool = True,
    progress: Progress = lambda done, total: None,
) -> Coil:
    """The coil that fits records best.

    Parameters
    ----------
    records : sequence of Record
        Each begins at rest and has complete operations.
    period : float, optional
        See `operations`.
    conventions : sequence of str
        What the voltage between samples may be: the one that fits best is taken.  None: as the records have it.
    wanted : bool
        Whether all forms are tried even if not even the richest one explains the records.
    progress : callable
        Called with fits done and fits in all.
    """
    richest = candidates([problem(records, period, name) for name in conventions or ("",)])
    likely = min(richest, key=lambda c: c.minimum.power)
    if not wanted and not (coil := _coil(likely, [likely])).is_explained:
        return coil
    found = list[Candidate]()
    for k, form in enumerate(FORMS):
        progress(k, len(FORMS))
        others = [(name, m.problem._replace(form=form)) for name, m in richest]
        found += richest if form is RICHEST else candidates(others)
    chosen = found[evidence.best([c.minimum for c in found])[0]]
    return _coil(chosen, [c for c in found if c.convention == chosen.convention])


class Candidate(NamedTuple):
    """A form with one reading of the voltage between samples."""

    convention: str
    minimum: Minimum


def problem(records: Sequence[Record], period: float | None, convention: str) -> tuple[str, Problem]:
    """The richest form, for a reading of the voltage; an empty one leaves the records as they are."""
    read = [without_causes(record, convention) for record in records]
    return convention, Problem(RICHEST, scale(read, period), [run(record, period) for record in read])


def candidates(problems: Sequence[tuple[str, Problem]]) -> list[Candidate]:
    """The minima of some problems that hardly differ, each from that of the first one on."""
    found = list[Candidate]()
    for convention, each in problems:
        found.append(Candidate(convention, minimum(each, found[0].minimum.point if found else None)))
    return found


def _coil(chosen: Candidate, found: Sequence[Candidate]) -> Coil:
    m = chosen.minimum
    names, is_held, runs = m.problem.form.names, m.held, m.problem.runs
    par, offsets = m.problem.parameters(m.point, runs[0]), [m.problem.offset(m.point, k) for k in range(len(runs))]
    models = [trajectory(par, r.record, r.first, *offset) for r, offset in zip(runs, offsets)]
    _, against = evidence.best([c.minimum for c in found])
    balanced = mean_resistance(*(r.record for r in runs)) if m.problem.offsets else None
    return Coil(
        parameters=par,
        form=m.problem.form,
        names=[name for name, at_limit in zip(names, is_held) if not at_limit],
        covariance=covariance(m) + unbalanced(m, balanced),
        held=[name for name, at_limit in zip(names, is_held) if at_limit],
        offsets=offsets,
        models=models,
        residuals=[residual(r.record, model, r.first) for r, model in zip(runs, models)],
        tried=[Tried(c.minimum.problem.form, c.minimum.rms, more) for c, more in zip(found, against)],
        convention=chosen.convention,
        records=[r.record for r in runs],
        balanced=balanced,
    )


def covariance(m: Minimum) -> Matrix:
    """Covariance of the logarithms that are not at a limit, with the misfit in it."""
    is_free = ~m.held
    A = np.linalg.pinv(m.problem.jacobian(m.point)[:, is_free], rcond=1e-9).astype(np.float64)
    ends = np.cumsum([run.current.size for run in m.problem.runs])
    parts = zip(np.split(A, ends[:-1], axis=1), m.parts())
    cov = np.sum([long_run(W, r) for W, r in parts], axis=0)
    count = int(is_free[: len(m.problem.form.names)].sum())
    return np.asarray(cov[:count, :count])


def unbalanced(m: Minimum, balanced: float | None) -> Matrix:
    """What hidden offsets add to the variance of the resistance, which (23) takes in another way than the fit."""
    free = [name for name, is_held in zip(m.problem.form.names, m.held) if not is_held]
    R = m.problem.parameters(m.point, m.problem.runs[0]).resistance
    off = float(np.log(balanced / R)) if balanced else 0.0
    return np.diag(np.array([off**2 if name == "resistance" else 0.0 for name in free]))


def trajectory(par: Parameters, record: Record, first: int, voltage: float = 0.0, current: float = 0.0) -> Trajectory:
    """The coil from a sample at rest on, with offsets of what is measured."""
    i, lam = simulate(par._replace(sample_time=record.dt), driving(record, first) + voltage).T
    return Trajectory(i + current, lam, np.zeros(i.size))
