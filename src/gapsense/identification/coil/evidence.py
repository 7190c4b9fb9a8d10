"""What speaks for a form: its residual, with a penalty for each of its parameters.

Of neighbouring samples whose residuals go together, only some count.  Theirs is n_e = n / (1 + 2 sum rho_h), with the
autocorrelations rho_h of the form that leaves least, tapered as for standard errors.  The form with the smallest

    sum n_e log(max(1, mean (e/sigma)^2)) + k log(sum n_e)

over the records is taken, the criterion of Schwarz (BIC), with the noise sigma and the k parameters of the form.  What
is below the noise counts as noise: to fit the noise, or what little the edges leave, speaks for nothing.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gapsense.identification.coil.problem import Minimum
from gapsense.identification.measurements.record import Vector

DIGITS, PERCENT = 1, 2  # of the criterion, and of what is left, that count; where both are the same the first is taken

SMALLEST = 1e-12  # what is left of a record that the model has made


def best(found: Sequence[Minimum]) -> tuple[int, list[float]]:
    """Which of several forms is taken, and what speaks against each; 0 for the one that is taken."""
    least = min(found, key=lambda m: m.power)
    sizes = [effective(part) for part in least.parts()]
    against = [criterion(m, sizes) for m in found]
    left = [round(m.power / max(least.power, SMALLEST), PERCENT) for m in found]
    chosen = min(range(len(found)), key=lambda k: (round(against[k], DIGITS), left[k]))
    return chosen, [value - against[chosen] for value in against]


def criterion(found: Minimum, sizes: Sequence[float]) -> float:
    """The penalised residual, for so many samples of each run that count."""
    misfit = sum(n * np.log(max(1.0, float(np.mean(part**2)))) for n, part in zip(sizes, found.parts()))
    return float(misfit + len(found.problem.form.names) * np.log(sum(sizes)))


def effective(r: Vector) -> float:
    """How many independent residuals tell as much."""
    lags, power = int(np.cbrt(r.size)), float(r @ r)
    if power == 0.0:
        return float(r.size)
    rho = [(1.0 - h / lags) * float(r[h:] @ r[:-h]) / power for h in range(1, lags)]
    return float(np.clip(r.size / max(1.0 + 2.0 * sum(rho), 1e-9), 1.0, r.size))
