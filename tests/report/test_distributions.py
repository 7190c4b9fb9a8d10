"""Values of a parameter on an axis: to scale, with labels that do not overlap."""

from __future__ import annotations

import numpy as np
import pytest

from gapsense.report.distributions import Bars, places_of


def bars(values: list) -> Bars:
    return Bars([str(value) for value in values], np.zeros((len(values), 3)), places_of(values))


@pytest.mark.parametrize(
    ("values", "places"),
    [
        ([1, 2, 10], [1.0, 2.0, 10.0]),
        ([1e-6, 3e-6], [1e-6, 3e-6]),
        (["fast", "slow"], [0.0, 1.0]),
        ([False, True], [0.0, 1.0]),
        ([1, "two"], [0.0, 1.0]),
        ([7.0], [0.0]),
    ],
)
def test_numbers_stand_to_scale_and_texts_one_after_the_other(values, places):
    assert places_of(values).tolist() == places


def test_labels_leave_out_those_that_would_overlap():
    assert bars([0.0, 0.1, 0.2, 5.0, 10.0]).labelled == [0, 3, 4]
    assert bars([*range(12)]).labelled == [0, 2, 4, 6, 8, 10]
    assert bars([10.0, 0.0, 5.0]).labelled == [1, 2, 0]
    assert bars(["a", "b"]).labelled == [0, 1] and bars([7.0]).labelled == [0]
