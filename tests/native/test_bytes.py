"""Bytes of saved states that somebody has changed, checksum and all: refused, or at least nothing is harmed by them."""

from __future__ import annotations

import random
import struct

import pytest
from core import Core

HEAD = 56  # bytes before the content: word, build, length, checksum
FLAGS, TIMES = HEAD, HEAD + 32


def sealed(data: bytes) -> bytes:
    """The same with the length and the checksum that belong to it."""
    total = 14695981039346656037
    for byte in data[HEAD:]:
        total = (total ^ byte) * 1099511628211 % 2**64
    return data[:40] + struct.pack("<QQ", len(data), total) + data[HEAD:]


def with_word(data: bytes, place: int, word: int | float) -> bytes:
    """The same with another number at a place."""
    packed = struct.pack("<d" if isinstance(word, float) else "<Q", word)
    return sealed(data[:place] + packed + data[place + 8 :])


def test_what_was_written_is_read(core: Core) -> None:
    data = core.fresh_bytes()
    assert sealed(data) == data
    assert core.read_bytes(data) == ""


def test_harm_is_found_by_the_checksum(core: Core) -> None:
    data = core.fresh_bytes()
    for place in range(0, len(data), 7):
        changed = data[:place] + bytes([data[place] ^ 64]) + data[place + 1 :]
        assert "the saved state is" in core.read_bytes(changed), place
    for other in (b"", b"GAPSENSE", data[:-1], data + b"\0", data[:HEAD], data[8:]):
        assert "damaged: its checksum" in core.read_bytes(other)


@pytest.mark.parametrize(
    ("place", "word", "part"),
    [
        (FLAGS, 5, "phase"),
        (FLAGS, 2**63, "phase"),
        (FLAGS, 2, "parameters"),  # running, without tables
        (FLAGS + 8, 2, "phase"),
        (TIMES, float("nan"), "time"),
        (TIMES + 8, float("inf"), "time"),
        (TIMES + 24, -1.0, "time"),
    ],
)
def test_what_cannot_be_is_found_without_it(core: Core, place: int, word: int | float, part: str) -> None:
    assert f"damaged: its {part} cannot be right" in core.read_bytes(with_word(core.fresh_bytes(), place, word))


def test_other_builds_are_told(core: Core) -> None:
    data = core.fresh_bytes()
    assert "is of build " + "x" * 32 in core.read_bytes(sealed(data[:8] + b"x" * 32 + data[40:]))


def test_anything_behind_a_right_checksum_ends_well(core: Core) -> None:
    rng, data = random.Random(3), core.fresh_bytes()
    for _ in range(300):
        cut = rng.randrange(HEAD, len(data) + 1)
        words = b"".join(struct.pack("<Q", rng.choice((0, 1, 2, 2**31, 2**64 - 1))) for _ in range(rng.randrange(4)))
        core.read_bytes(sealed(data[:cut] + words + data[cut + len(words) :]))
        core.read_bytes(sealed(data[:cut] + rng.randbytes(rng.randrange(40))))
