"""Signatures of causes for `gapsense.estimators.monitor.signatures`, from runs of the study's faults.

python -m gapsense.scenarios.condition.fit [DEVICES [SEED ...]]

The seeds are below 100; the study judges by others.
"""

from __future__ import annotations

import sys

import numpy as np
import numpy.typing as npt

from gapsense.estimators.monitor.records import Moved, Profile
from gapsense.estimators.monitor.signatures import MISSING
from gapsense.studies.runs import signals

from .cases import CASES, COURSE, Case, devices, document, times
from .judge import EACH, SHIFT, times_of

NAMES = [f"monitor.{name}" for name in ("faults", *Profile._fields, *Moved._fields[1:])]
LEAST, GROUPS, FEW, ROUNDS = 0.05, 8, 0.02, 20  # spread, groups, share of the rows that is none, rounds of the search
NEAR = 0.9  # cosine from which a direction is in a group
SEEDS = (21, 22, 23)
FAR = 2.0  # usual wanderings from which a device counts

Array = npt.NDArray[np.float64]


def found(case: Case, count: int, seed: int) -> tuple[Array, Array]:
    """Profiles of the faults that were told, and what has moved at the end of the last one."""
    shifts = [SHIFT * seed + k for k in range(count)]
    profiles, moved = [], []
    for _, rows in signals(document(case, NAMES, COURSE, EACH), None, NAMES, devices(count, seed), shifts):
        if rows is not None:
            t, faults = times_of(len(rows)), rows[:, 0]
            for begin, end in times(case, COURSE):
                told = np.flatnonzero((t > begin) & (t < end) & (faults > faults[np.searchsorted(t, begin) - 1]))
                profiles += [rows[told[0], 1 : 1 + len(Profile._fields)]] if told.size else []
            moved.append(rows[np.searchsorted(t, end) - 1, 1 + len(Profile._fields) :])
    return np.array(profiles), np.array(moved)


def directions(rows: Array) -> Array:
    """Rows of length 1."""
    return np.asarray(rows / np.linalg.norm(rows, axis=1, keepdims=True))


def groups(rows: Array, count: int) -> list[Array]:
    """Directions in groups, by the means that are nearest; small ones are left out."""
    means = rows[[int(np.argmax(rows @ np.median(rows, axis=0)))]]
    while len(means) < count and np.min(nearness := np.max(rows @ means.T, axis=1)) < NEAR:
        means = np.vstack([means, rows[np.argmin(nearness)]])
    for _ in range(ROUNDS):
        nearest = np.argmax(rows @ means.T, axis=1)
        own = [rows[nearest == k] for k in range(len(means))]
        means = directions(np.array([rows.mean(axis=0) for rows in own if len(rows)]))
    return [group for group in own if len(group) > FEW * sum(map(len, own))]


def said(cause: str, rows: Array) -> str:
    """A signature in the words of the table."""
    mean = directions(rows.mean(axis=0, keepdims=True))[0]
    spreads = np.maximum(LEAST, np.sqrt(np.mean((rows - mean) ** 2, axis=0)))
    return f'    Signature("{cause}", {hundredths(mean)}, {hundredths(spreads)}),  # {len(rows)}'


def hundredths(entries: Array) -> tuple[int, ...]:
    """The nearest ones."""
    return tuple(int(x) for x in np.rint(100.0 * entries))


def main(count: int = 24, *seeds: int) -> None:
    """Print both tables."""
    sudden, gradual = [], []
    for case in CASES.values():
        profiles, moved = map(np.vstack, zip(*(found(case, count, seed) for seed in seeds or SEEDS)))
        if case.causes[0] not in MISSING:
            sudden += [said(case.causes[0], rows) for rows in groups(directions(profiles), GROUPS)]
        far = moved[np.linalg.norm(moved, axis=1) > FAR]
        gradual += [said(case.causes[0], directions(far))] if len(far) > len(moved) // 2 else []
    print("SUDDEN", *sudden, "GRADUAL", *gradual, sep="\n")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
