"""What each residual does to what is fitted, and to the resistance of (23), which comes from the same currents."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from gapsense.identification.causes import Matrix
from gapsense.identification.measurements.flux import trapezoid
from gapsense.identification.measurements.operations import Operation
from gapsense.identification.measurements.record import Vector
from gapsense.identification.valve import model
from gapsense.identification.valve.device import Device
from gapsense.identification.valve.form import Form
from gapsense.identification.valve.linear import STEP, Linear
from gapsense.identification.valve.many import responses
from gapsense.identification.valve.model import Experiment, Response


class Influence(NamedTuple):
    """What each residual of an experiment does to each of some numbers."""

    current: Matrix  # (numbers, samples)
    position: Matrix | None  # likewise, where it is fitted


def influences(form: Form, ratios: Vector, experiments: Sequence[Experiment], at: Linear) -> list[Influence]:
    """Influence of each residual on what is fitted, on the values of the other causes, and on the resistance."""
    A, ends = np.vstack([at.feedback @ at.inverse, at.rows]), np.cumsum([e.size for e in experiments])
    parts, total = np.split(A, ends[:-1], axis=1), sum(model.charge(e) for e in experiments)
    found = [_weights(form, ratios, e, part, total) for e, part in zip(experiments, parts)]
    return [_with_causes(W, at.resistance) for W in found]


def _with_causes(W: Influence, by: Vector) -> Influence:
    """The influence with what fitted causes do to the resistance, the last."""
    of_current = np.vstack([W.current[:-1], W.current[-1] + by @ W.current[: by.size]])
    if W.position is None:
        return Influence(of_current, None)
    return Influence(of_current, np.vstack([W.position[:-1], W.position[-1] + by @ W.position[: by.size]]))


def _weights(form: Form, ratios: Vector, experiment: Experiment, A: Matrix, total: float) -> Influence:
    """The same of one experiment; the resistance is relative."""
    n = experiment.current.size
    c_i, c_lam = experiment.weights()
    R, half = experiment.resistance, 0.5 * experiment.dt
    later = np.cumsum(A[:, n : 2 * n][:, ::-1], axis=1)[:, ::-1] * R  # of the interval before each sample
    W = -c_i * A[:, :n] + c_lam * half * (later + np.roll(np.where(np.arange(n) > 0, later, 0.0), -1, axis=1))
    pooled, at = np.zeros(n), responses([form.at(ratios)], experiment)[0]
    for operation in experiment.operations:
        share = np.zeros(n)
        share[operation.start + 1 : operation.stop] = 1.0
        share[[operation.start, operation.stop]] = 0.5
        slope = _by_resistance(form.at(ratios), experiment, at, operation)
        W += np.outer(A @ slope, share / trapezoid(experiment.current)[operation.inside].sum())
        pooled -= share / total
    Z = None
    if experiment.position is not None:
        Z = np.vstack([-c_i * experiment.amperes * A[:, 2 * n :], np.zeros(n)])
    return Influence(np.vstack([W, pooled]), Z)


def _by_resistance(par: Device, experiment: Experiment, at: Response, operation: Operation) -> Vector:
    """Slope of the residuals by the logarithm of the resistance of one operation, after which the model is at rest."""
    alone, cut = model.part(experiment, operation), slice(operation.start, operation.stop + 1)

    def changed(factor: float) -> Vector:
        R = experiment.resistance.copy()
        R[operation.inside] *= factor
        (found,) = responses([par], alone._replace(resistance=R[cut]))
        whole = Response(*(_spliced(a, b, cut) for a, b in zip(at, found)))
        return model.weighted(model.with_resistance(experiment, R), whole)

    return (changed(1.0 + STEP) - changed(1.0 - STEP)) / (2.0 * STEP)


def _spliced(whole: Vector | None, piece: Vector | None, at: slice) -> Any:
    """The samples, with a piece in its place."""
    if whole is None:
        return None
    made = whole.copy()
    made[at] = piece
    return made
