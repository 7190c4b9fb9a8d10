"""What the voltage was between two samples: the reading that explains the records best."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gapsense.identification.measurements.record import Vector
from gapsense.identification.valve.evidence import Trial, is_quiet, larger_trial, trial
from gapsense.identification.valve.forms import Sought, larger
from gapsense.identification.valve.minimise import Fit
from gapsense.identification.valve.prepared import First


def best_reading(fit: Fit, ratios: Vector, readings: Sequence[list[First]], sought: Sought) -> tuple[int, Vector]:
    """The reading with which the first operations fit best, by its place, and the minimum there.

    Eddy currents too act where the voltage jumps, and the best reading without them may be a wrong one: each is tried
    with the first of the larger forms.
    """
    found = [_fitted(fit, ratios, firsts) for firsts in readings]
    best = int(np.argmin([t.cost for t in found]))
    forms = larger(fit.form, sought)
    if forms and not is_quiet(found[best], readings[best]):
        others = [larger_trial(fit, forms[0], t, firsts) for t, firsts in zip(found, readings)]
        best = int(np.argmin([t.cost for t in others]))
    return best, found[best].ratios


def _fitted(fit: Fit, ratios: Vector, firsts: Sequence[First]) -> Trial:
    return trial(fit, fit.least_squares(ratios, [first.experiment for first in firsts]), firsts)
