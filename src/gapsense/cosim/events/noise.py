"""Random numbers of events: each belongs to an event, a seed and a base step, whoever asks for it, and how often."""

from __future__ import annotations

from functools import lru_cache
from hashlib import sha256
from struct import unpack


@lru_cache(maxsize=64)
def noise(name: str, seed: int, k: int) -> float:
    """Number of standard normal distribution for an event at a base step; the same bits everywhere."""
    from gapsense.kernels.random import M1, M2, normal  # here, so that what has no noise starts fast

    words = unpack("<6I", sha256(f"{name} {seed} {k}".encode()).digest()[:24])
    state = [float(word % int(m)) for word, m in zip(words, (M1, M1, M1, M2, M2, M2))]
    return float(normal(state)[1])
