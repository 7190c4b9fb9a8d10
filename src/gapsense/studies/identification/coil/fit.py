"""The coil of one or more records: the form that the evidence is for, its parameters, and how well it explains them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from gapsense.studies.identification.coil import evidence
from gapsense.studies.identification.coil.device import Parameters
from gapsense.studies.identification.coil.forms import FORMS, RICHEST, Form
from gapsense.studies.identification.coil.problem import Matrix, Minimum, Problem, minimum, simulate
from gapsense.studies.identification.coil.runs import run, scale
from gapsense.studies.identification.errors import long_run
from gapsense.studies.identification.model import Trajectory
from gapsense.studies.identification.record import Record, between
from gapsense.studies.identification.residual import Residual, residual
from gapsense.workers import Progress

POOR = 0.25  # relative standard error from which a parameter counts as not identified: of losses 10 % is good


class Tried(NamedTuple):
    """One form."""

    form: Form
    free: int  # parameters and offsets that no limit holds
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
    read, convention, first = best_convention(RICHEST, records, conventions, period)
    if not wanted and not _result(first, [first], convention, read).is_explained:
        return _result(first, [first], convention, read)
    found = forms(first, progress)
    chosen = found[evidence.best(found)[0]]
    again, better, other = best_convention(chosen.problem.form, records, conventions, period)
    if better != convention:
        read, convention, found = again, better, forms(other, progress)
        chosen = found[evidence.best(found)[0]]
    return _result(chosen, found, convention, read)


def forms(found: Minimum, progress: Progress) -> list[Minimum]:
    """The minimum of each form, with the records of one of them."""
    made = []
    for k, form in enumerate(FORMS):
        progress(k, len(FORMS))
        made.append(found if form is found.problem.form else minimum(found.problem._replace(form=form)))
    return made


def best_convention(
    form: Form, records: Sequence[Record], conventions: Sequence[str], period: float | None
) -> tuple[Sequence[Record], str, Minimum]:
    """Records with the voltage between samples with which a form fits best, its name, and the minimum."""
    tried: list[tuple[Sequence[Record], str, Minimum]] = []
    for name in conventions or ("",):
        read = [between(record, name) for record in records] if name else records
        problem = Problem(form, scale(read, period), [run(record, period) for record in read])
        tried.append((read, name, minimum(problem, tried[0][2].point if tried else None)))
    return min(tried, key=lambda entry: float(entry[2].residuals @ entry[2].residuals))


def _result(m: Minimum, found: Sequence[Minimum], convention: str, records: Sequence[Record]) -> Coil:
    problem, names = m.problem, m.problem.form.names
    _, against = evidence.best(found)
    offsets = [problem.offset(m.point, k) for k in range(len(records))]
    pairs = list(zip(problem.runs, offsets))
    par = problem.parameters(m.point, problem.runs[0])
    models = [trajectory(par, r.record, r.first, *offset) for r, offset in pairs]
    held = [name for name, is_held in zip(names, m.held) if is_held]
    return Coil(
        parameters=par,
        form=problem.form,
        names=[name for name in names if name not in held],
        covariance=covariance(m),
        held=held,
        offsets=offsets,
        models=models,
        residuals=[residual(r.record, model, r.first) for r, model in zip(problem.runs, models)],
        tried=[
            Tried(f.problem.form, evidence.free(f), float(np.sqrt(np.mean(f.residuals**2))), more)
            for f, more in zip(found, against)
        ],
        convention=convention,
        records=records,
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


def trajectory(par: Parameters, record: Record, first: int, voltage: float = 0.0, current: float = 0.0) -> Trajectory:
    """The coil from a sample at rest on, with offsets of what is measured."""
    volts = np.stack((record.applied[first:], record.voltage[first:]), axis=1) + voltage
    i, lam = simulate(par._replace(sample_time=record.dt), volts).T
    return Trajectory(i + current, lam, np.zeros(i.size))
