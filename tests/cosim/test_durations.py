"""The median of a histogram is that of what was counted."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gapsense.cosim.run.recording import BINS, bin_edge, bin_of, median

WITHIN = st.floats(bin_edge(0), bin_edge(BINS), exclude_max=True)


@given(WITHIN)
def test_bin_holds_what_is_placed_in_it_and_is_what_the_leading_bits_say(seconds):
    k = bin_of(seconds)
    assert bin_edge(k) <= seconds < bin_edge(k + 1)
    assert k == (struct.unpack("<Q", struct.pack("<d", seconds))[0] >> 48) - (1023 - 26) * 16  # as loop.c has it


@pytest.mark.parametrize(("seconds", "k"), [(0.0, 0), (-1e-9, 0), (1e-12, 0), (64.0, BINS - 1), (1e9, BINS - 1)])
def test_what_is_shorter_or_longer_than_all_bins_is_in_the_first_or_the_last(seconds, k):
    assert bin_of(seconds) == k


def counted(durations):
    return np.bincount([bin_of(t) for t in durations], minlength=BINS)


@given(st.lists(WITHIN, min_size=1, max_size=60))
def test_median_lies_in_the_bin_of_that_of_the_durations(durations):
    ordered = sorted(durations)
    low, high = ordered[(len(ordered) - 1) // 2], ordered[len(ordered) // 2]
    found = median(counted(durations), max(durations))
    assert bin_edge(bin_of(low)) <= found <= bin_edge(bin_of(high) + 1) and found <= max(durations)


def test_median_of_many_durations_is_exact_to_a_hundredth():
    durations = np.random.default_rng(4).lognormal(np.log(2e-6), 0.3, 20_000)
    assert median(counted(durations), durations.max()) == pytest.approx(np.median(durations), rel=0.01)


def test_nothing_counted_has_no_median():
    assert median(np.zeros(BINS, dtype=np.int64), 0.0) is None
