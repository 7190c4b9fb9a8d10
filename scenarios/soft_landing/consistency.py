"""Consistency of the smoother's covariances, [RTS] Section IV-D: normalised estimation errors over many runs."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice
from typing import Any, NamedTuple

import numpy as np
from scipy.stats import chi2, norm

from gapsense._os.workers import Progress
from gapsense.kernels.lanes import Plan, Row, plan

from .batch import Tuning, Variant, Varied, normalised_errors
from .cycle import Samples
from .reference import reference_state
from .rts import Floats
from .runs import Estimator, filtered, smoothed
from .setting import Study, chunks, drawn, moving, noise_of_width, operation_of, tuning

CONFIDENCE = 0.9
STATES = ("z_k*", "z_(k-1)*", "lambda_k", "e_i,k", "e_F,k")
INTERVAL = chi2.ppf([0.5 - CONFIDENCE / 2, 0.5 + CONFIDENCE / 2], len(STATES))  # of NEES
BOUND = norm.ppf(0.5 + CONFIDENCE / 2)  # of NEE, on either side
PUBLISHED = {"inside": 0.8956, "mean": 4.9477}
LEFT_OUT = 1  # samples of a motion at its end: the covariance of the last one has rank 4


class Band(NamedTuple):
    """Mean over the runs and the interval from 5 to 95 %, each (samples,)."""

    mean: Floats
    low: Floats
    high: Floats


class Operation(NamedTuple):
    """Normalised errors of one motion."""

    time: Floats  # [s]
    nees: Band
    nee: list[Band]  # of each state


class Consistency(NamedTuple):
    """What the covariances are worth: `operations` is a making and a breaking."""

    operations: list[Operation]
    inside: float  # part of all NEES inside `INTERVAL`
    mean: float  # of all NEES
    inside_full_rank: float  # both without the first sample of each motion: its past position is known exactly
    mean_full_rank: float
    nee_inside: list[float]  # part of all NEE of each state within `BOUND`
    runs: int


def consistency(study: Study, width: float = 0.01, runs: int = 10_000, progress: Progress | None = None) -> Consistency:
    """Normalised errors squared (62) and normalised errors (63) of the smoothed states in motion.

    The `width` is that of the interval of the relative parameter errors (55).
    """
    tuned = tuning(noise_of_width(study.facts(), {"width": width, "runs": runs}), study)
    parts, (recorded, motions) = chunks(runs), plan_of(study)
    found: list[list[Floats]] = [[], []]  # for each operation, (6, samples, runs) of each chunk
    for done, (chunk, size) in enumerate(parts):
        if progress:
            progress(done, len(parts))
        varied, measured = drawn(study, width, chunk, size)
        values = recorded.run(size, varied=np.array(varied), current=measured, tuning=np.array(tuned))
        for (operation, samples), part in zip(motions, _by_motion(values, [count for _, count in motions])):
            found[operation].append(part.reshape(samples, -1, size).swapaxes(0, 1))
    whole = [np.concatenate(values, axis=2) for values in found]
    nees = np.concatenate([values[0] for values in whole])
    full_rank = np.concatenate([values[0][1:] for values in whole])
    nee = np.concatenate([values[1:] for values in whole], axis=1)
    nee_inside = [float(np.mean(np.abs(e[np.isfinite(e)]) <= BOUND)) for e in nee]
    operations = [_summary(study.samples, k, values) for k, values in enumerate(whole)]
    return Consistency(operations, *_inside_and_mean(nees), *_inside_and_mean(full_rank), nee_inside, runs)


def _inside_and_mean(nees: Floats) -> tuple[float, float]:
    return float(np.mean((nees >= INTERVAL[0]) & (nees <= INTERVAL[1]))), float(np.mean(nees))


def _by_motion(values: Floats, counts: list[int]) -> list[Floats]:
    """The rows of each motion."""
    return np.split(values, (1 + len(STATES)) * np.cumsum(counts)[:-1])


def plan_of(study: Study) -> tuple[Plan, list[tuple[int, int]]]:
    """The plan of the normalised errors of all motions, sample by sample; operation and number of samples of each."""
    samples, m, operations = study.samples, study.model, list[tuple[int, int]]()

    def normalised(varied: Row, current: Row, tuning: Row) -> Iterator[Any]:
        """Normalised errors of every motion, the last sample first."""
        model, estimator = Varied(*varied), Estimator(Variant(), Tuning(*tuning), m)
        for motion in filtered(samples, current, model, estimator):
            operations.append((operation_of(samples, motion.first), len(motion.filtered) - LEFT_OUT))
            rows = [*islice(smoothed(motion, samples, model, estimator), LEFT_OUT, None)]
            for k, row in enumerate(reversed(rows), motion.first):
                yield from normalised_errors(estimator.variant)(row, reference_state(samples, k, model, m))

    sizes = {"varied": len(Varied._fields), "current": samples.time.size, "tuning": len(Tuning._fields)}
    return plan(lambda **rows: [*normalised(**rows)], **sizes), operations


def _summary(samples: Samples, operation: int, values: Floats) -> Operation:
    tail = 0.5 - CONFIDENCE / 2
    low, high = np.quantile(values, [tail, 1.0 - tail], axis=2)
    bands = [Band(*rows) for rows in zip(values.mean(axis=2), low, high)]
    return Operation(samples.time[moving(samples, operation)[:-LEFT_OUT]], bands[0], bands[1:])
