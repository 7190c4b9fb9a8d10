"""Of records in which all is drawn, what is identified lies within its stated errors, or they are refused.

Seeds 401 to 489 chose terms of the errors; those that are judged elsewhere begin at 500, see the page.
"""

from __future__ import annotations

import numpy as np
import pytest
from drawn_records import is_right, judged

TOLD = (440, 451, 454, 457, 462, 466, 470, 478, 481, 484)  # one has a resistance in series, one has a slope that jumps
REFUSED = (461,)  # slow PWM; that in step is among the conditions of test_identification_conditions.py
PARTS = {2.0: 0.85, 3.0: 0.97}  # of the parameters, which are about 55, within so many stated errors


@pytest.mark.slow
def test_parameters_of_drawn_records_lie_within_their_errors(tmp_path):
    found = [judged(seed, tmp_path)[1] for seed in TOLD]
    sizes = np.abs([x for one in found if one.is_explained for x in one.off.values()])
    assert sum(one.is_explained for one in found) >= 9 and sizes.size > 45
    assert all(np.mean(sizes < most) >= part for most, part in PARTS.items()), np.sort(sizes)[-8:]
    assert 0.5 < np.sqrt(np.mean(sizes**2)) < 1.4


@pytest.mark.slow
def test_errors_include_a_form_that_evidence_does_not_clearly_exclude(tmp_path):
    _, found = judged(628, tmp_path)  # eddy currents stand for a resistance that is another one at the stop
    assert found.is_explained and "does not clearly exclude" in found.text
    assert len(found.off) >= 5 and max(map(abs, found.off.values())) < 3.0, found.off


@pytest.mark.slow
def test_ends_of_clamps_that_noise_hides_are_sought_as_other_edges_are(tmp_path):
    _, found = judged(764, tmp_path)  # was refused: 2.1 times the noise, for its mechanics
    assert found.is_explained and len(found.off) >= 5 and max(map(abs, found.off.values())) < 3.0, found.off


@pytest.mark.slow
@pytest.mark.parametrize("seed", REFUSED)
def test_drawn_records_that_cannot_be_explained_are_refused_with_a_right_cause(seed, tmp_path):
    case, found = judged(seed, tmp_path)
    assert not found.is_explained and is_right(case, found.text), found.text
