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


@pytest.mark.slow
def test_an_edge_that_crossed_a_sample_wrongly_is_started_again():
    """Eddy currents: without that the turns are uncertain to 0.7 %, and 1.2 mA are left of 1 mA of noise."""
    _, condition = draw(9549)
    result = identified(condition, 9549)
    assert result.is_explained and max(each.rms for each in result.residuals) < 1.08e-3
    assert result.errors["coil_turns"] < 3e-3
    assert max(map(abs, off(condition, result).values())) < 3.0
