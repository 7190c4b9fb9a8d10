"""The numbers of [RTS] Section IV-F beside those of the runs, as text."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from gapsense.studies.profiles.experiment import ESTIMATORS, LEVELS, OPERATIONS, PUBLISHED, Errors, Profile, Vector

UNITS = {"position": "1", "velocity": "1/s"}
ALIKE = 1e-2  # difference of positions, in strokes, by which two motions are the same
CHOSEN = "ERTSS"  # the estimator that the paper gives numbers of


def text(profiles: Sequence[Profile], errors: Errors) -> str:
    """How many motions there were, percentiles of the absolute errors, and what the paper says of the smoother."""
    return "\n".join([*counts(profiles), *percentiles(errors), *published(errors)])


def counts(profiles: Sequence[Profile]) -> Iterator[str]:
    """Motions by operation, what became of them, and how many differ from each other."""
    yield f"{len(profiles)} profiles"
    for operation in OPERATIONS:
        found = [m for profile in profiles for m in profile.motions if m.operation == operation]
        back, late = sum(m.returns for m in found), sum(not m.published for m in found)
        samples = sum(m.landed - m.first for m in found)
        yield (
            f"  {operation}: {len(found) - back} motions from stop to stop, {different(profiles, operation)} of them "
            f"different; {back} back to the stop they left; {samples} samples"
        )
        yield f"    {late} were cut off by a landing before they were published, and are smoothed from the record"
    worst = max((profile.difference for profile in profiles), default=0.0)
    yield f"  largest difference between what was published and the same from the records: {worst:.3g}"


def different(profiles: Sequence[Profile], operation: str) -> int:
    """Number of motions from stop to stop of which none before was the same within `ALIKE`."""
    known: list[Vector] = []
    for profile in profiles:
        for m in profile.motions:
            z = profile.true.position[m.first : m.landed]
            is_known = any(z.size == other.size and np.max(np.abs(z - other)) < ALIKE for other in known)
            if m.operation == operation and not m.returns and not is_known:
                known.append(z)
    return len(known)


def percentiles(errors: Errors) -> Iterator[str]:
    """One line per estimator and operation, for each quantity."""
    for quantity, of_quantity in zip(UNITS, errors):
        levels = "".join(f"{f'{level:g} %':>10}" for level in LEVELS)
        yield f"{f'absolute error of the {quantity} / ({UNITS[quantity]})':36}{levels}"
        for operation in OPERATIONS:
            for estimator in ESTIMATORS:
                values = of_quantity[estimator, operation]
                numbers = np.percentile(values, LEVELS) if values.size else np.full(len(LEVELS), np.nan)
                yield f"  {operation:10}{estimator:24}" + "".join(f"{number:10.4g}" for number in numbers)


def published(errors: Errors) -> Iterator[str]:
    """Share of the smoother's errors below the limits that the paper gives for about 75 % of them."""
    for quantity, of_quantity in zip(UNITS, errors):
        values = np.concatenate([of_quantity[CHOSEN, operation] for operation in OPERATIONS])
        share = 100.0 * np.mean(values < PUBLISHED[quantity]) if values.size else np.nan
        limit = f"{PUBLISHED[quantity]:g} {UNITS[quantity]}".removesuffix(" 1")
        yield f"{CHOSEN}, {quantity} errors smaller than {limit}: published about 75 %, here {share:.1f} %"
