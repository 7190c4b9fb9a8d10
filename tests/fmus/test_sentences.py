"""The table of sentences: printf reads every text as Python does, and every text is said by somebody."""

from __future__ import annotations

import ctypes
import re
import sys
from pathlib import Path

import pytest

import gapsense.fmi
from gapsense.fmi.life import ALLOWED, PHASES, phases_of
from gapsense.fmi.sentences import SENTENCES, say

CONVERSIONS = {
    "s": ("für 100 %s", ctypes.c_char_p("für 100 %s".encode())),
    "d": (-7, ctypes.c_int(-7)),
    "u": (2**32 - 1, ctypes.c_uint(2**32 - 1)),
    "g": (1e-3 / 3.0, ctypes.c_double(1e-3 / 3.0)),
}
WORDS = re.compile(r"%(?:(?:\.[39])?g|[sdu])")


@pytest.mark.parametrize("key", SENTENCES)
def test_texts_have_only_conversions_that_both_languages_read_alike(key: str) -> None:
    assert "%" not in WORDS.sub("", SENTENCES[key])


@pytest.mark.skipif(sys.platform == "win32", reason="needs snprintf of the C library")
@pytest.mark.parametrize("key", SENTENCES)
def test_printf_says_the_same(key: str) -> None:
    values = [CONVERSIONS[word[-1]] for word in WORDS.findall(SENTENCES[key])]
    buffer = ctypes.create_string_buffer(1000)
    ctypes.CDLL(None).snprintf(buffer, 1000, SENTENCES[key].encode(), *(value for _, value in values))
    assert buffer.value.decode() == say(key, *(value for value, _ in values))


def test_phases_are_named_as_a_sentence_names_them() -> None:
    assert {phase for phases in ALLOWED.values() for phase in phases} == set(PHASES)
    assert phases_of("fmi2DoStep") == "`running`"
    assert phases_of("fmi2SetReal") == "`instantiated`, `initializing` or `running`"


def test_shell_says_nothing_that_is_not_in_the_table() -> None:
    """Every key that the sources name is there."""
    folder = Path(gapsense.fmi.__file__).parent
    for name in ("slave.py", "tables.py", "values.py"):
        keys = re.findall(r'\bsay\(\s*"(\w+)"', (folder / name).read_text(encoding="utf-8"))
        assert keys and set(keys) <= set(SENTENCES), name
