"""Of random records with disturbances, what is identified lies within its stated errors, or the cause is told."""

from __future__ import annotations

import numpy as np
import pytest
from random_records import DISTURBANCES, draw, identified, off

from gapsense.identification.valve.show import remarks

SEEDS = (5001, 5003, 5005, 7320)  # late, both channels filtered, warming; eddy currents, refused before
WITHIN = {2.0: 0.85, 3.0: 0.99}  # standard errors, and part of the parameters, which are but 20 here


@pytest.mark.slow
def test_parameters_of_random_records_lie_within_their_errors_or_the_cause_is_told():
    errors, untold = list[float](), list[str]()
    for seed in SEEDS:
        name, condition = draw(seed)
        result = identified(condition, seed)
        said = " ".join(remarks(result))
        if result.is_explained:
            errors += off(condition, result).values()
        elif not any(word in said for word in DISTURBANCES[name][1].split("|") if word):
            untold.append(f"{seed}, {name}: {said}")
    sizes = np.abs(errors)
    assert not untold
    assert sizes.size > 15
    assert all(np.mean(sizes < most) >= part for most, part in WITHIN.items()), np.sort(sizes)[-8:]
