"""A coil whose core does not move, from recorded voltage and current: the form of its core, and its parameters.

Sought are the logarithms of the parameters of a form, each with a range, and the offsets that the converters of the
records hide.  What speaks for a form is its residual, with a penalty for each of its parameters.

Of neighbouring samples whose residuals go together, only some count.  Theirs is n_e = n / (1 + 2 sum rho_h), with the
autocorrelations rho_h of the form that leaves least, tapered as for standard errors.  The form with the smallest

    sum n_e log(max(1, mean (e/sigma)^2)) + k log(sum n_e)

over the records is taken, the criterion of Schwarz (BIC), with the noise sigma and the k parameters of the form.  What
is below the noise counts as noise: to fit the noise, or what little the edges leave, speaks for nothing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from itertools import combinations
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import scipy

from gapsense._os.workers import Progress
from gapsense.identification.coil import kernel as device
from gapsense.identification.coil.kernel import NO_SATURATION, Outputs, Parameters
from gapsense.identification.least_squares import differences, finite, long_run, minimise, rms, sample_outputs, square
from gapsense.identification.measurements.operations import coil, estimate, mean_resistance, operations, starts
from gapsense.identification.measurements.record import Record, Vector
from gapsense.identification.measurements.signals import noise, resolution
from gapsense.identification.residual import FLOOR, REST, Residual, noise_of, residual
from gapsense.identification.show import Validation
from gapsense.identification.valve.model import Trajectory, take_out_causes
from gapsense.kernels.kernel import Kernel

ALWAYS = ("resistance", "air")
PARTS = {"core": ("core", "saturation"), "eddy": ("eddy",), "hysteresis": ("hysteresis", "turnover")}
WORDS = {"core": "saturation", "eddy": "eddy currents", "hysteresis": "hysteresis"}


class Form(NamedTuple):
    """Some of the parts."""

    parts: tuple[str, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Fields of the device that are fitted."""
        return (*ALWAYS, *(name for part in self.parts for name in PARTS[part]))

    @property
    def words(self) -> str:
        """What it is called."""
        return " + ".join(WORDS[part] for part in self.parts) or "constant inductance"


FORMS = [Form(parts) for count in range(len(PARTS) + 1) for parts in combinations(PARTS, count)]  # plain ones first
RICHEST = FORMS[-1]


class Size(NamedTuple):
    """What records have without any model."""

    resistance: float  # (23) [ohm]
    inductance: float  # of the nearest coil of constant inductance [H]
    current: float  # largest [A]
    flux_linkage: float  # largest [Wb]


@cache
def ranges(s: Size) -> dict[str, tuple[float, float, float]]:
    """Start, low and high by field: a bend far beyond the flux linkage, or a turnover beyond it, is not seen."""
    R, r, lam = s.resistance, 1.0 / s.inductance, s.flux_linkage
    return {
        "resistance": (R, R / 3.0, 3.0 * R),
        "air": (0.8 * r, 0.02 * r, 5.0 * r),
        "core": (0.2 * r, 1e-3 * r, 5.0 * r),
        "saturation": (2.0 * lam, 1.02 * lam, 3.0 * lam),
        "eddy": (0.01 / R, 1e-4 / R, 1.0 / R),
        "hysteresis": (0.02 * s.current, 1e-4 * s.current, 2.0 * s.current),
        "turnover": (0.3 * lam, 0.02 * lam, lam),
    }


OWN = 0.3 * FLOOR  # of the largest current: what the sampling leaves of a record without noise
COARSEST = 0.05  # half a step of a converter, of the largest value: more are the levels of a voltage that is commanded
SIGNALS = ("voltage", "current")


class Run(NamedTuple):
    """One record from its first operation on."""

    record: Record
    first: int  # the last sample at rest
    current: Vector  # measured [A]
    voltages: Vector  # what drives the coil (n, 3) [V]
    noise: float  # of the current [A]
    hidden: tuple[float, float]  # largest offset of voltage [V] and current [A] that the rest does not show


def run(record: Record, period: float | None = None) -> Run:
    """A record prepared."""
    first = operations(record, period)[0].start
    i = record.current[first:]
    sigma = max(noise_of(record, first), OWN * float(np.abs(i).max()))
    voltage, current = (hidden(getattr(record, name), first) for name in SIGNALS)
    return Run(
        record=record, first=first, current=i, voltages=driving(record, first), noise=sigma, hidden=(voltage, current)
    )


def driving(record: Record, first: int) -> Vector:
    """Inputs of the coil from a sample on (n, 3) [V]."""
    return np.concatenate((record.halves[first:], record.voltage[first:, None]), axis=1)


def hidden(x: Vector, first: int) -> float:
    """Half a step of a converter whose noise at rest is less: the mean at rest then says little of other values."""
    step = resolution(x)
    spread = float(x[:first].std()) if first >= REST else noise(x)
    is_coarse = spread < 0.5 * step and FLOOR < 0.5 * step / np.abs(x).max() < COARSEST
    return 0.5 * step if is_coarse else 0.0


def size_of(records: Sequence[Record], period: float | None = None) -> Size:
    """What the records have without any model; the largest values of all of them."""
    found = []
    for record in records:
        each = operations(record, period)
        flux = estimate(record, each)
        largest = (float(np.abs(x).max()) for x in (record.current, flux.flux_linkage))
        found.append(Size(float(np.median(flux.resistances)), abs(coil(record, each[0])[0]), *largest))
    R, L, i, lam = np.array(found).T
    return Size(float(np.median(R)), float(np.median(L)), float(i.max()), float(lam.max()))


KERNEL = Kernel(device)
LONGEST, LENGTH = 60, 0.1  # steps, and the length by which they are damped
AT_LIMIT = 1e-3  # of the range of a logarithm

Matrix = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Problem:
    """The cost of a form; a point is the logarithms, then offsets in parts of what is hidden."""

    form: Form
    size: Size
    runs: Sequence[Run]
    convention: str = ""  # the reading of the voltage between samples; none leaves the records as they are

    @cached_property
    def offsets(self) -> list[tuple[int, int]]:
        """Run and signal of each offset."""
        return [(k, j) for k, run in enumerate(self.runs) for j, most in enumerate(run.hidden) if most > 0.0]

    @property
    def scale(self) -> Vector:
        """Steps are damped alike in all logarithms: in the valley of reluctances and saturation others creep."""
        return np.full(self.start.size, LENGTH)

    @cached_property
    def ends(self) -> Matrix:
        """Usual, lowest and highest point."""
        logs = np.log([ranges(self.size)[name] for name in self.form.names])
        return np.vstack([logs, np.tile([0.0, -1.0, 1.0], (len(self.offsets), 1))]).T

    @property
    def limits(self) -> tuple[Vector, Vector]:
        """Lowest and highest point."""
        return self.ends[1], self.ends[2]

    @property
    def start(self) -> Vector:
        """The usual point."""
        return np.asarray(self.ends[0])

    def parameters(self, point: Vector, run: Run) -> Parameters:
        """The device of a point."""
        none = {"core": 0.0, "saturation": NO_SATURATION, "eddy": 0.0, "hysteresis": 0.0}
        none["turnover"] = ranges(self.size)["turnover"][0]
        found = dict(zip(self.form.names, np.exp(point).tolist()))
        return Parameters(sample_time=run.record.dt, **{**none, **found})

    def offset(self, point: Vector, k: int) -> tuple[float, float]:
        """Offsets of voltage and current in a run."""
        found = dict(zip(self.offsets, point[len(self.form.names) :].tolist()))
        voltage, current = (found.get((k, j), 0.0) * most for j, most in enumerate(self.runs[k].hidden))
        return voltage, current

    def models(self, points: Sequence[Vector], k: int) -> Matrix:
        """Currents that each point gives in a run, as they would be measured (points, samples)."""
        run = self.runs[k]
        offsets = np.array([self.offset(point, k) for point in points])
        voltages: Matrix = run.voltages[:, :, None] + offsets[:, 0]
        return np.asarray(
            sample_outputs(KERNEL, [self.parameters(point, run) for point in points], voltages) + offsets[:, 1:]
        )

    def residuals(self, points: Sequence[Vector]) -> Matrix:
        """Residuals over the noise (points, samples of all runs)."""
        parts = [(run.current - self.models(points, k)) / run.noise for k, run in enumerate(self.runs)]
        return finite(np.concatenate(parts, axis=1))

    def jacobian(self, point: Vector, at: Vector | None = None, /) -> Matrix:
        """Derivatives of the residuals."""
        return differences(self.residuals, point, self.limits[1], at)


class Fitted(NamedTuple):
    """Where a form fits best."""

    problem: Problem
    point: Vector
    residuals: Vector  # over the noise, of all runs

    @property
    def held(self) -> npt.NDArray[np.bool_]:
        """Of each parameter and offset, whether it ends at a limit."""
        low, high = self.problem.limits
        margin = AT_LIMIT * (high - low)
        return np.asarray((self.point < low + margin) | (self.point > high - margin))

    @property
    def power(self) -> float:
        """Sum of the squares of the residuals."""
        return square(self.residuals)

    @property
    def rms(self) -> float:
        """Of the residuals."""
        return rms(self.residuals)

    def parts(self) -> list[Vector]:
        """Residuals of each run over its noise."""
        return np.split(self.residuals, np.cumsum([run.current.size for run in self.problem.runs])[:-1])


def minimum(problem: Problem, start: Vector | None = None) -> Fitted:
    """The minimum next to the usual start, or to a point."""
    found = minimise(problem, problem.start if start is None else start, LONGEST)
    return Fitted(problem, found.point, found.residuals)


def simulate(par: Parameters, voltages: Matrix) -> Matrix:
    """Outputs of one coil from rest on (samples, outputs)."""
    return np.array(KERNEL.run(voltages.tolist(), par)[1]).reshape(-1, len(Outputs._fields))


DIGITS, PERCENT = 1, 2  # of the criterion, and of what is left, that count; where both are the same the first is taken

SMALLEST = 1e-12  # residual of a record that the model itself has made


def best(found: Sequence[Fitted]) -> tuple[int, list[float]]:
    """Which of several forms is taken, and what speaks against each; 0 for the one that is taken."""
    least = min(found, key=lambda m: m.power)
    sizes, against = [effective(part) for part in least.parts()], list[float]()
    for m in found:
        misfit = sum(n * np.log(max(1.0, float(np.mean(part**2)))) for n, part in zip(sizes, m.parts()))
        against.append(float(misfit + len(m.problem.form.names) * np.log(sum(sizes))))
    left = [round(m.power / max(least.power, SMALLEST), PERCENT) for m in found]
    chosen = min(range(len(found)), key=lambda k: (round(against[k], DIGITS), left[k]))
    return chosen, [value - against[chosen] for value in against]


def effective(r: Vector) -> float:
    """How many independent residuals tell as much."""
    lags, power = int(np.cbrt(r.size)), float(r @ r)
    if power == 0.0:
        return float(r.size)
    rho = [(1.0 - h / lags) * float(r[h:] @ r[:-h]) / power for h in range(1, lags)]
    return float(np.clip(r.size / max(1.0 + 2.0 * sum(rho), 1e-9), 1.0, r.size))


CHANCE = 6e-5  # that records disagree by more; for two that is four standard errors
POOR = 0.25  # relative standard error from which a parameter counts as not identified: of losses 10 % is good


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
    tried: list[tuple[Form, float, float]]  # RMS of its residual over the noise, what speaks against it beside this one
    convention: str  # the voltage between samples, see `record.halves`
    records: Sequence[Record]  # with that voltage
    balanced: float | None  # (23), of the voltage as it was read, if its converter may hide an offset [Ohm]
    contrary: Mapping[str, float]  # fields on which records disagree, and by what their errors were multiplied

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


def fit_coil(
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
    richest = minima([problem(records, period, name) for name in conventions or ("",)])
    likely = min(richest, key=lambda m: m.power)
    if not wanted and not (coil := _coil(likely, [likely])).is_explained:
        return coil
    found = list[Fitted]()
    for k, form in enumerate(FORMS):
        progress(k, len(FORMS))
        found += richest if form is RICHEST else minima([replace(m.problem, form=form) for m in richest])
    chosen = found[best(found)[0]]
    return _coil(chosen, [m for m in found if m.problem.convention == chosen.problem.convention])


def problem(records: Sequence[Record], period: float | None, convention: str) -> Problem:
    """The richest form, for a reading of the voltage."""
    read = [take_out_causes(record, convention) for record in records]
    return Problem(RICHEST, size_of(read, period), [run(record, period) for record in read], convention)


def minima(problems: Sequence[Problem]) -> list[Fitted]:
    """Those of some problems that hardly differ, each from that of the first one on."""
    first, *others = problems
    found = minimum(first)
    return [found, *(minimum(each, found.point) for each in others)]


def _coil(m: Fitted, found: Sequence[Fitted]) -> Coil:
    names, is_held, runs = m.problem.form.names, m.held, m.problem.runs
    par, offsets = m.problem.parameters(m.point, runs[0]), [m.problem.offset(m.point, k) for k in range(len(runs))]
    models = [trajectory(par, r.record, r.first, *offset) for r, offset in zip(runs, offsets)]
    _, against = best(found)
    balanced = mean_resistance(*(r.record for r in runs)) if m.problem.offsets else None
    free = [name for name, at_limit in zip(names, is_held) if not at_limit]
    A = np.linalg.pinv(m.problem.jacobian(m.point)[:, ~is_held], rcond=1e-9)[: len(free)].astype(np.float64)
    ends = np.cumsum([r.current.size for r in runs])[:-1]
    parts = [*zip(np.split(A, ends, axis=1), m.parts())]
    each = [long_run(W, r) for W, r in parts]  # with the misfit
    wider = disagreement([W @ r for W, r in parts], [np.diag(one) for one in each])
    cov = np.sum(each, axis=0) * np.outer(wider, wider)
    if balanced and "resistance" in free:  # hidden offsets: (23) takes them in another way than the fit
        cov[free.index("resistance"), free.index("resistance")] += np.log(balanced / par.resistance) ** 2
    return Coil(
        parameters=par,
        form=m.problem.form,
        names=free,
        covariance=cov,
        held=[name for name, at_limit in zip(names, is_held) if at_limit],
        offsets=offsets,
        models=models,
        residuals=[residual(r.record, model, r.first) for r, model in zip(runs, models)],
        tried=[(each.problem.form, each.rms, more) for each, more in zip(found, against)],
        convention=m.problem.convention,
        records=[r.record for r in runs],
        balanced=balanced,
        contrary={name: by for name, by in zip(free, wider.tolist()) if by > 1.0},
    )


def disagreement(pulls: Sequence[Vector], variances: Sequence[Vector]) -> Vector:
    """By what the errors are to be multiplied, for records that move the minimum by `pulls`, each its own way.

    It is the root of chi-square of the combination by its degrees of freedom (R. T. Birge 1932); 1 within chance.
    """
    free = max(1, len(pulls) - 1)  # one record disagrees with none
    squares = np.sum(np.square(pulls) / np.maximum(variances, 1e-300), axis=0)
    return np.where((len(pulls) > 1) & (squares > scipy.special.chdtri(free, CHANCE)), np.sqrt(squares / free), 1.0)


def trajectory(par: Parameters, record: Record, first: int, voltage: float = 0.0, current: float = 0.0) -> Trajectory:
    """The coil from a sample at rest on, with offsets of what is measured."""
    i, lam = simulate(par._replace(sample_time=record.dt), driving(record, first) + voltage).T
    return Trajectory(i + current, lam, np.zeros(i.size))


def validate_coil(result: Coil, record: Record) -> Validation:
    """The coil beside a record that begins at rest, with what the instruments hid in the records used."""
    first = starts(record)[0]
    voltage, current = np.mean(result.offsets, axis=0).tolist()
    return Validation(record, trajectory(result.parameters, record, first, voltage, current), first)
