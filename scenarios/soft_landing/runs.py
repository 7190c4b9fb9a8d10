"""Filter, smoother and open loop of [RTS] over a whole record, for many runs at once.

Currents, parameters and estimates stand for those of all runs in a plan (`gapsense.kernels.lanes`), or are one run's.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

from gapsense.estimators.reduced_model import Model, is_moving, limit
from gapsense.kernels.lanes import Row

from . import batch
from .batch import Tuning, Variant, Varied
from .rts import Floats, motions


class Estimator(NamedTuple):
    """The same for all runs: error states, standard deviations, and what does not vary of the model."""

    variant: Variant
    tuning: Tuning
    model: Model


class Motion(NamedTuple):
    """One motion as the filter saw it: samples `first`, `first + 1`, ... and the landing after the last of them."""

    first: int
    filtered: list[Row]
    landing: Row


def filtered(record: Any, current: Sequence[Any] | Floats, varied: Varied, estimator: Estimator) -> Iterator[Motion]:
    """Run the filter over a record, and give every motion when it has landed.

    The voltage and the mode of the record, which starts at rest, are the inputs of all runs; the measured currents
    (N, runs) [A] and the parameters in `varied` are those of each.
    """
    variant, tuning, m = estimator
    v, q, end = record.voltage.tolist(), record.mode.tolist(), _end(record)
    row, kept = batch.start(m, variant, q[0])(varied), list[Row]()
    for k in range(1, end):
        row = batch.forward_step(m, variant, q[k - 1], q[k])(row, (v[k - 1], current[k]), varied, tuning)
        if is_moving(q[k]):
            kept.append(row)
        elif is_moving(q[k - 1]):
            yield Motion(k - len(kept), kept, row)
            row, kept = batch.landed(row, variant, q[k]), []


def smoothed(motion: Motion, record: Any, varied: Varied, estimator: Estimator) -> Iterator[Row]:
    """Smoothed estimates of the samples of a motion, from the last one back to the first."""
    back, later = batch.backward_step(estimator.model, estimator.variant), motion.landing
    voltages = record.voltage[motion.first : motion.first + len(motion.filtered)].tolist()
    for row, voltage in zip(reversed(motion.filtered), reversed(voltages)):
        later = back(row, (voltage,), later, varied, estimator.tuning)
        yield later


def open_loop(record: Any, varied: Varied, m: Model) -> Iterator[tuple[int, Row]]:
    """Samples in motion and states (z, z_prev, lambda) of the model without e_i and e_F, never corrected."""
    v, q = record.voltage.tolist(), record.mode.tolist()
    row: Row = (limit(q[0]), limit(q[0]), 0.0)
    for k in range(1, _end(record)):
        row = batch.open_step(m, q[k - 1], q[k])(row, (v[k - 1],), varied)
        if is_moving(q[k]):
            yield k, row


def _end(record: Any) -> int:
    """One more than the sample of the last landing."""
    return max((landing + 1 for _, landing in motions(record.mode)), default=1)
