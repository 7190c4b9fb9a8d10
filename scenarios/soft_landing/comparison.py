"""Monte Carlo comparison of the estimators of [RTS], Section IV-E: errors against the width of the parameter errors."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cache
from itertools import chain, product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from gapsense._os.workers import Progress
from gapsense.estimators.reduced_model import Model
from gapsense.kernels.lanes import Plan, Row, plan
from gapsense.studies.runs import Facts, compute

from . import batch
from .batch import Tuning, Variant, Varied
from .cycle import Samples
from .rts import Floats, motions
from .runs import Estimator, filtered, open_loop, smoothed
from .setting import OPERATIONS, Study, chunks, drawn, noise_of_width, operation_of, study_of, tuning

WIDTHS = (0.001, 0.002, 0.003, 0.005, 0.007, 0.01, 0.02, 0.03, 0.05, 0.07, 0.1, 0.2, 0.3)  # nearly log spaced
VARIANTS = {"ERTSS": Variant(), "ERTSS without e_i": Variant(0.0, 1.0), "ERTSS without e_F": Variant(1.0, 0.0)}
ESTIMATORS = ("EKF", *VARIANTS, "open loop")
WORST = "ERTSS"  # estimator whose worst run is looked for
QUANTITIES = ("position", "velocity")


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

    The `widths` are lengths of the interval of the relative parameter errors (55), each with so many `runs`; results do
    not depend on the number of `workers`. The `file` takes what is computed, chunk by chunk: another call goes on from
    there.
    """
    if runs < 1 or not widths or not all(0.0 <= width < 2.0 for width in widths):
        raise ValueError(
            f"{runs} runs, widths {[*widths]}: at least one run and one width, none negative, all below 200 % (no"
            " parameter changes its sign). Correct them."
        )
    parts, tell = chunks(runs), progress or (lambda done, total: None)
    facts = {**study.facts(), "in C": plan_of(study).library is not None}  # compiled before workers look for it
    tasks: list[Facts] = [{"width": width, "runs": runs} for width in widths]
    count, total = len(tasks), len(tasks) * (1 + len(parts))
    noises = compute(noise_of_width, facts, tasks, workers, file, lambda done, _: tell(done, total))
    tunings = [tuning(variances, study) for variances in noises.results]
    tasks = [
        {"width": width, "chunk": chunk, "runs": size, "tuning": [*tuned]}
        for width, tuned in zip(widths, tunings)
        for chunk, size in parts
    ]
    found = compute(errors_of_chunk, facts, tasks, workers, file, lambda done, _: tell(count + done, total))
    groups = [found.results[k : k + len(parts)] for k in range(0, len(tasks), len(parts))]
    squares = np.array([np.sum([part["squares"] for part in group], axis=0) for group in groups])
    worst = [max(Worst(*part["worst"]) for part in group) for group in groups]
    nrmse = np.sqrt(squares / (runs * reference_squares(study.samples, study.model)))
    return Comparison(
        widths=(*widths,),
        runs=runs,
        tunings=tunings,
        nrmse=nrmse,
        worst=worst,
        computed=noises.computed + found.computed,
    )


def errors_of_chunk(facts: Facts, task: Facts) -> dict[str, Any]:
    """Task: squared errors, summed over the runs of a chunk, (estimators, operations, quantities); the worst run."""
    study = study_of(facts)
    varied, measured = drawn(study, task["width"], task["chunk"], task["runs"])
    squares = squared_errors(study, varied, measured, Tuning(*task["tuning"]))
    positions = squares[ESTIMATORS.index(WORST), :, 0] / reference_squares(study.samples, study.model)[:, :1]
    operation, run = map(int, np.unravel_index(np.argmax(positions), positions.shape))
    worst = Worst(float(np.sqrt(positions[operation, run])), operation, task["chunk"], run)
    return {"squares": squares.sum(axis=-1).tolist(), "worst": [*worst]}


def squared_errors(study: Study, varied: Varied, measured: Floats, tuned: Tuning) -> Floats:
    """Squared errors of each run summed over the samples in motion: (estimators, operations, quantities, runs)."""
    runs = measured.shape[1]
    found = plan_of(study).run(runs, varied=np.array(varied), current=measured, tuning=np.array(tuned))
    return found.reshape(len(ESTIMATORS), len(OPERATIONS), len(QUANTITIES), runs)


def plan_of(study: Study) -> Plan:
    """The plan of the squared errors; the first call in a process takes a second."""
    return _plan(tuple(tuple(values.tolist()) for values in study.samples), study.model)


@cache
def _plan(record: tuple[tuple[float, ...], ...], m: Model) -> Plan:
    """The same for samples as tuples, by which it is found again."""
    study = Study(Samples(*map(np.array, record)), m)
    z = positions(study.samples, m).tolist()

    def sums(varied: Row, current: Row, tuning: Row) -> Row:
        """Sums of squared errors, by estimator and operation."""
        rows = dict.fromkeys(product(ESTIMATORS, range(len(OPERATIONS))), (0.0, 0.0))
        for name, k, row in estimates(study, Varied(*varied), current, Tuning(*tuning)):
            case = name, operation_of(study.samples, k)
            rows[case] = batch.squared_errors()(rows[case], row[:2], (z[k], z[k - 1]))
        return (*chain.from_iterable(rows.values()),)

    return plan(sums, varied=len(Varied._fields), current=study.samples.time.size, tuning=len(Tuning._fields))


def estimates(study: Study, varied: Varied, measured: Floats | Row, tuned: Tuning) -> Iterator[tuple[str, int, Row]]:
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
    found = {name: np.full(study.samples.time.size, np.nan) for name in ESTIMATORS}
    varied, measured = drawn(study, width, worst.chunk, worst.run + 1, slice(-1, None))
    alone = Varied(*(float(value[0]) for value in varied)), measured[:, 0].tolist()
    for name, k, row in estimates(study, *alone, tuned):
        found[name][k] = row[0]
    return found


def reference_squares(samples: Samples, m: Model) -> Floats:
    """Sums of z^2 and of (z_k - z_(k-1))^2 over the samples in motion, (operations, quantities), below (67)."""
    z = positions(samples, m)
    steps = np.diff(z, prepend=z[0])
    found = np.zeros((len(OPERATIONS), len(QUANTITIES)))
    for first, landed in motions(samples.mode):
        found[operation_of(samples, first)] += [np.sum(x[first:landed] ** 2) for x in (z, steps)]
    return found


def positions(samples: Samples, m: Model) -> Floats:
    """Normalised position of the reference (47a)."""
    return np.asarray((samples.position - m.z_min) / m.l_z)
