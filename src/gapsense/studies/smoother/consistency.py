"""Consistency of the smoother's covariances, [RTS] Section IV-D: normalised estimation errors over many runs."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice
from typing import Any, NamedTuple

import numpy as np
from scipy.stats import chi2, norm

from gapsense.estimators.rts import Floats
from gapsense.studies.smoother.batch import MOVING, Row, Tuning, Variant, squared_error, uncertain
from gapsense.studies.smoother.models import chunks
from gapsense.studies.smoother.reference import reference_states
from gapsense.studies.smoother.runs import Estimator, filtered, smoothed
from gapsense.studies.smoother.study import Study, drawn, moving, noise_of_width, operation_of, tuning
from gapsense.studies.soft_landing.cycle import Samples
from gapsense.workers import Progress

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

    Parameters
    ----------
    study : Study
        What all runs share.
    width : float
        Length of the interval of the relative parameter errors (55).
    runs : int
        Number of runs.
    progress : callable, optional
        Called with chunks done and chunks in all.

    Returns
    -------
    Consistency
    """
    tuned = tuning(noise_of_width(study.facts(), {"width": width, "runs": runs}), study)
    parts = chunks(runs)
    found: list[list[Floats]] = [[], []]  # for each operation, (6, samples, runs) of each chunk
    for done, (chunk, size) in enumerate(parts):
        if progress:
            progress(done, len(parts))
        for operation, values in _normalised(study, width, tuned, chunk, size):
            found[operation].append(values)
    whole = [np.concatenate(values, axis=2) for values in found]
    nees = np.concatenate([values[0] for values in whole])
    full_rank = np.concatenate([values[0][1:] for values in whole])
    nee = np.concatenate([values[1:] for values in whole], axis=1)
    nee_inside = [float(np.mean(np.abs(e[np.isfinite(e)]) <= BOUND)) for e in nee]
    operations = [_summary(study.samples, k, values) for k, values in enumerate(whole)]
    return Consistency(operations, *_inside_and_mean(nees), *_inside_and_mean(full_rank), nee_inside, runs)


def _inside_and_mean(nees: Floats) -> tuple[float, float]:
    return float(np.mean((nees >= INTERVAL[0]) & (nees <= INTERVAL[1]))), float(np.mean(nees))


def normalised_errors(row: Row, true: Row, variant: Variant) -> tuple[Any, list[Any]]:
    """NEES (62) and the NEE (63) of each uncertain state of an estimate in motion; NaN for one known exactly."""
    with np.errstate(all="ignore"):
        (nees,) = squared_error(variant)(row, true)
        states = uncertain(variant, MOVING)
        diagonal = 5 + np.cumsum([0, *range(len(states), 1, -1)])  # of the triangle behind the five means
        return nees, [(row[k] - true[k]) / np.sqrt(row[place]) for k, place in zip(states, diagonal)]


def _normalised(study: Study, width: float, tuned: Tuning, chunk: int, runs: int) -> Iterator[tuple[int, Floats]]:
    """Operation and its (6, samples, runs) of NEES and NEE, for a chunk of runs."""
    samples = study.samples
    varied, measured = drawn(study, width, chunk, runs)
    estimator = Estimator(Variant(), tuned, study.model)
    truth = reference_states(samples, varied, study.model)
    for motion in filtered(samples, measured, varied, estimator):
        count = len(motion.filtered) - LEFT_OUT
        values = np.empty((1 + len(STATES), count, runs))
        rows = islice(smoothed(motion, samples, varied, estimator), LEFT_OUT, None)
        for place, row in zip(range(count - 1, -1, -1), rows):
            true = tuple(a[..., motion.first + place] for a in truth)
            values[0, place], values[1:, place] = normalised_errors(row, true, estimator.variant)
        yield operation_of(samples, motion.first), values


def _summary(samples: Samples, operation: int, values: Floats) -> Operation:
    tail = 0.5 - CONFIDENCE / 2
    low, high = np.quantile(values, [tail, 1.0 - tail], axis=2)
    bands = [Band(*rows) for rows in zip(values.mean(axis=2), low, high)]
    return Operation(samples.time[moving(samples, operation)[:-LEFT_OUT]], bands[0], bands[1:])
