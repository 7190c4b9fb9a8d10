"""Monte Carlo comparison of the estimators of [RTS], Section IV-E: errors against the width of the parameter errors."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapsense.estimators.reduced_model import Model
from gapsense.estimators.rts import motions
from gapsense.studies.smoother.batch import Row, Tuning, Variant, Varied
from gapsense.studies.smoother.nominal import fitted, nominal
from gapsense.studies.smoother.perturbation import chunks, errors, noise, perturbed
from gapsense.studies.smoother.reference import process_noise
from gapsense.studies.smoother.runs import Estimator, filtered, open_loop, smoothed
from gapsense.studies.soft_landing.cycle import Samples, sampled, soft_landing
from gapsense.studies.tasks import Facts, compute
from gapsense.workers import Progress

Floats = NDArray[np.float64]
WIDTHS = (0.001, 0.002, 0.003, 0.005, 0.007, 0.01, 0.02, 0.03, 0.05, 0.07, 0.1, 0.2, 0.3)  # nearly log spaced
NOISE = 2e-3  # sigma_i (58) [A]
VARIANTS = {"ERTSS": Variant(), "ERTSS without e_i": Variant(0.0, 1.0), "ERTSS without e_F": Variant(1.0, 0.0)}
ESTIMATORS = ("EKF", *VARIANTS, "open loop")
WORST = "ERTSS"  # estimator whose worst run is looked for
OPERATIONS = ("making", "breaking")
QUANTITIES = ("position", "velocity")


class Study(NamedTuple):
    """What all runs share: the reference, the nominal model, and the randomness."""

    samples: Samples
    model: Model
    seed: int = 1
    noise_current: float = NOISE

    def facts(self) -> dict[str, Any]:
        """The same for JSON."""
        samples = {name: values.tolist() for name, values in self.samples._asdict().items()}
        return {**self._asdict(), "samples": samples, "model": [*self.model]}


def studied(core: str, seed: int) -> Study:
    """The soft-landing cycle of Fig. 5, with the core of the reduced model as asked for: fitted, or published."""
    if core not in ("fitted", "published"):
        raise ValueError(f"`--core {core}`: `fitted` or `published` expected. Correct it.")
    samples = sampled(soft_landing())
    return Study(samples, fitted(samples, nominal()) if core == "fitted" else nominal(), seed)


def study_of(facts: Facts) -> Study:
    """The study of `Study.facts`."""
    samples = Samples(**{name: np.array(values) for name, values in facts["samples"].items()})
    model = Model(*(tuple(value) if isinstance(value, list) else value for value in facts["model"]))
    return Study(samples, model, facts["seed"], facts["noise_current"])


class Worst(NamedTuple):
    """The run of an estimator with the largest error of the position in one operation."""

    nrmse: float
    operation: int
    chunk: int
    run: int  # in its chunk


class Comparison(NamedTuple):
    """Errors of all estimators (67), and what they depend on."""

    widths: tuple[float, ...]
    runs: int
    tunings: list[Tuning]  # for each width
    nrmse: Floats  # (widths, estimators, operations, quantities)
    worst: list[Worst]  # of the ERTSS, for each width
    computed: int  # tasks computed now; the others were known


def compare(
    study: Study,
    widths: Sequence[float] = WIDTHS,
    runs: int = 10_000,
    workers: int = 2,
    file: Path | None = None,
    progress: Progress | None = None,
) -> Comparison:
    """Compare the estimators over widths of the parameter errors, each with its own process noise (60).

    Parameters
    ----------
    study : Study
        What all runs share.
    widths : sequence of float
        Lengths of the interval of the relative parameter errors (55).
    runs : int
        Number of runs at each width.
    workers : int
        Processes; the numbers do not depend on it.
    file : Path, optional
        Takes what is computed, chunk by chunk; another call goes on from there.
    progress : callable, optional
        Called with tasks done and tasks in all.

    Returns
    -------
    Comparison
    """
    if runs < 1 or not widths or min(widths) < 0.0 or max(widths) >= 2.0:
        raise ValueError(
            f"{runs} runs, widths {[*widths]}: at least one run and one width, none negative, all below 200 % (no"
            " parameter changes its sign). Correct them."
        )
    parts = chunks(runs)
    tasks: list[Facts] = [{"width": width, "runs": runs} for width in widths]
    total = len(tasks) * (1 + len(parts))
    noises = compute(noise_of_width, study.facts(), tasks, workers, file, _shifted(progress, 0, total))
    tunings = [tuning(variances, study) for variances in noises.results]
    tasks = [
        {"width": width, "chunk": chunk, "runs": size, "tuning": [*tuned]}
        for width, tuned in zip(widths, tunings)
        for chunk, size in parts
    ]
    found = compute(errors_of_chunk, study.facts(), tasks, workers, file, _shifted(progress, len(widths), total))
    groups = [found.results[k : k + len(parts)] for k in range(0, len(tasks), len(parts))]
    squares = np.array([np.sum([part["squares"] for part in group], axis=0) for group in groups])
    worst = [max(Worst(*part["worst"]) for part in group) for group in groups]
    nrmse = np.sqrt(squares / (runs * reference_squares(study.samples, study.model)))
    return Comparison((*widths,), runs, tunings, nrmse, worst, noises.computed + found.computed)


def tuning(variances: Sequence[float], study: Study) -> Tuning:
    """Standard deviations of the filter from the diagonal of Q."""
    _, _, flux_linkage, current_error, force_error = np.sqrt(variances).tolist()
    return Tuning(flux_linkage, current_error, force_error / study.model.l_z, study.noise_current)


def noise_of_width(facts: Facts, task: Facts) -> list[float]:
    """Task: the diagonal of Q (60) for one width."""
    study = study_of(facts)
    relative = [errors(study.seed, chunk, size) for chunk, size in chunks(task["runs"])]
    varied = perturbed(study.model, task["width"] * np.concatenate(relative, axis=1))
    return process_noise(study.samples, varied, study.model).tolist()  # type: ignore[no-any-return]


def errors_of_chunk(facts: Facts, task: Facts) -> dict[str, Any]:
    """Task: squared errors, summed over the runs of a chunk, (estimators, operations, quantities); the worst run."""
    study, runs = study_of(facts), task["runs"]
    varied = perturbed(study.model, task["width"] * errors(study.seed, task["chunk"], runs))
    measured = noise(study.seed, task["chunk"], runs, study.samples.time.size, study.noise_current)
    measured += study.samples.current[:, None]
    squares = squared_errors(study, varied, measured, Tuning(*task["tuning"]))
    positions = squares[ESTIMATORS.index(WORST), :, 0] / reference_squares(study.samples, study.model)[:, :1]
    operation, run = map(int, np.unravel_index(np.argmax(positions), positions.shape))
    worst = Worst(float(np.sqrt(positions[operation, run])), operation, task["chunk"], run)
    return {"squares": squares.sum(axis=-1).tolist(), "worst": [*worst]}


def squared_errors(study: Study, varied: Varied, measured: Floats, tuned: Tuning) -> Floats:
    """Squared errors of each run summed over the samples in motion: (estimators, operations, quantities, runs)."""
    z = positions(study.samples, study.model)
    squares = np.zeros((len(ESTIMATORS), len(OPERATIONS), len(QUANTITIES), measured.shape[1]))
    for name, k, row in estimates(study, varied, measured, tuned):
        at = squares[ESTIMATORS.index(name), operation_of(study.samples, k)]
        at[0] += (row[0] - z[k]) ** 2
        at[1] += ((row[0] - row[1]) - (z[k] - z[k - 1])) ** 2
    return squares


def estimates(study: Study, varied: Varied, measured: Floats, tuned: Tuning) -> Iterator[tuple[str, int, Row]]:
    """Estimator, sample in motion, and the estimates of all runs, which begin with z and z_prev."""
    samples, m = study.samples, study.model
    for name, variant in VARIANTS.items():
        estimator = Estimator(variant, tuned, m)
        for motion in filtered(samples, measured, varied, estimator):
            rows, last = motion.filtered, motion.first + len(motion.filtered) - 1
            if name == "ERTSS":
                yield from (("EKF", motion.first + k, row) for k, row in enumerate(rows))
            yield from ((name, last - k, row) for k, row in enumerate(smoothed(motion, samples, varied, estimator)))
    yield from (("open loop", k, row) for k, row in open_loop(samples, varied, m))


def trajectories(study: Study, width: float, tuned: Tuning, worst: Worst) -> dict[str, Floats]:
    """Normalised positions of all estimators in one run, NaN at rest: (N,) by estimator."""
    runs = worst.run + 1
    relative = errors(study.seed, worst.chunk, runs)[:, -1:]
    measured = noise(study.seed, worst.chunk, runs, study.samples.time.size, study.noise_current)[:, -1:]
    found = {name: np.full(study.samples.time.size, np.nan) for name in ESTIMATORS}
    varied = perturbed(study.model, width * relative)
    for name, k, row in estimates(study, varied, measured + study.samples.current[:, None], tuned):
        found[name][k] = np.squeeze(row[0])
    return found


def reference_squares(samples: Samples, m: Model) -> Floats:
    """Sums of z^2 and of (z_k - z_(k-1))^2 over the samples in motion, (operations, quantities), below (67)."""
    z = positions(samples, m)
    steps = np.diff(z, prepend=z[0])
    found = np.zeros((len(OPERATIONS), len(QUANTITIES)))
    for first, landed in motions(samples.mode):
        moving = slice(first, landed)
        found[operation_of(samples, first)] += [np.sum(z[moving] ** 2), np.sum(steps[moving] ** 2)]
    return found


def positions(samples: Samples, m: Model) -> Floats:
    """Normalised position of the reference (47a)."""
    return np.asarray((samples.position - m.z_min) / m.l_z)


def operation_of(samples: Samples, k: int) -> int:
    """0 for a making, 1 for a breaking: by the stop on which the motion of sample `k` lands."""
    landed = next(after for first, after in motions(samples.mode) if first <= k < after)
    return 0 if samples.mode[landed] == 1.0 else 1


def _shifted(progress: Progress | None, done: int, total: int) -> Progress | None:
    return None if progress is None else lambda now, _: progress(done + now, total)
