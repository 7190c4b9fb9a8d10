"""What balanced resistances and the other parameters do to each other where a core stays magnetised.

The resistance of an operation is (V - d) / C, with the sum V of its voltage, the sum C of its current and the flux
linkage d that stays afterwards, which the model tells.  So an error of the parameters returns through the resistances,
by a third larger for the valve with hysteresis of a few percent.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gapsense.identification.causes import Matrix
from gapsense.identification.measurements.record import Vector
from gapsense.identification.valve import model
from gapsense.identification.valve.form import FACTOR, Form
from gapsense.identification.valve.many import responses
from gapsense.identification.valve.model import Experiment

STEP = 1e-4  # relative change of a parameter for a difference quotient


def feedback(inverse: Matrix, form: Form, ratios: Vector, experiments: Sequence[Experiment]) -> Matrix:
    """What becomes of errors x of what is fitted, first the parameters, in the end: y = x - A B y, with `inverse` A."""
    one = np.eye(len(inverse))
    if FACTOR not in form.fitted:
        return one
    B = np.concatenate([_by_balance(form, ratios, e) for e in experiments])
    one[:, : ratios.size] += inverse @ B
    return np.linalg.inv(one).astype(np.float64)


def _by_balance(form: Form, ratios: Vector, experiment: Experiment) -> Matrix:
    """Derivatives of the weighted residuals by the parameters that only balance the resistances."""
    steps = STEP * np.eye(ratios.size)
    above, below = ([_balanced(form, ratios, ratios + side * s, experiment) for s in steps] for side in (1.0, -1.0))
    return (np.array(above) - np.array(below)).T / (2.0 * STEP)


def _balanced(form: Form, ratios: Vector, others: Vector, experiment: Experiment) -> Vector:
    """The weighted residuals with the resistances of other parameters."""
    now = model.balanced(form, others, experiment)
    return model.weighted(now, responses([form.at(ratios)], now)[0])
