"""Which gap law: the one that foretells best what it has not seen.

Each gap between the smallest and the largest is left out once, and foretold by the law that fits the others.  That
takes no noise for known, compares laws of any form, and a law that follows the noise foretells worse.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gapsense.identification.gap_law.laws import Family, Law, Vector, families, total

FEWEST = 3  # gaps
MOST = 8  # numbers of a law
AS_GOOD = 1.15  # ratio of two errors that are called equal
FINE = 1e-3  # relative error that needs no finer law


class Candidate(NamedTuple):
    """A law, how well it fits, and how well it foretells."""

    law: Law
    size: int  # numbers fitted
    misfit: float  # RMS, relative
    foretold: float  # the same of gaps that were left out
    others: list[Law]  # without each gap in turn


def candidates(h: Vector, R: Vector) -> list[Candidate]:
    """All laws that so many points can tell, fitted to gaps [m] and reluctances [1/H]."""
    span, count = (float(h.min()), float(h.max())), np.unique(h).size
    return [candidate(family, h, R) for family in families(min(MOST, max(count - 1, 2)), span)]


def candidate(family: Family, h: Vector, R: Vector) -> Candidate:
    """A law of a family, judged."""
    law, gaps, errors, others = family.fit(h, R), np.unique(h), list[Vector](), list[Law]()
    for gap in gaps:
        left_out = h == gap
        others.append(family.fit(h[~left_out], R[~left_out]))
        if gaps[0] < gap < gaps[-1]:
            errors.append(total(others[-1], h[left_out]) / R[left_out] - 1.0)
    return Candidate(
        law=law,
        size=family.size,
        misfit=rms(total(law, h) / R - 1.0),
        foretold=rms(np.concatenate(errors)),
        others=others,
    )


def best(found: list[Candidate]) -> Candidate:
    """The one with the fewest numbers of those that foretell as well as any."""
    limit = max(FINE, AS_GOOD * min(each.foretold for each in found))
    return min((each for each in found if each.foretold <= limit), key=lambda each: (each.size, each.foretold))


def rms(x: Vector) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(x**2)))


def jackknife(values: Vector) -> Vector:
    """Standard errors of what follows from all gaps, from what follows without each of them in turn (gaps, values)."""
    n = len(values)
    return np.asarray(np.sqrt((n - 1) / n * ((values - values.mean(axis=0)) ** 2).sum(axis=0)))
