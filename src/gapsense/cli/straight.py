"""The words of `gapsense run` as they are mostly given, understood without a parser."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

SCENARIO, NATIVE, SET = "scenario", "--native", "--set"
KINDS = {SCENARIO: Path, "--variant": str, "--fmus": Path, "--out": Path, SET: str, NATIVE: bool}
COMPLETES = "_GAPSENSE_COMPLETE"  # variable of the environment: the shell asks for completions


def parse_run(words: Sequence[str]) -> dict[str, Any] | None:
    """Parse the options of a run as they are mostly given; None for all else, which typer parses or explains."""
    given: dict[str, Any] = {}
    left = iter(words)
    for word in left:
        name = word if word.startswith("-") else SCENARIO
        is_named = name not in (SCENARIO, NATIVE)
        value = next(left, "") if is_named else word
        if name not in KINDS or not value or (is_named and value.startswith("-")) or (name in given and name != SET):
            return None
        given[name] = [*given.get(name, []), value] if name == SET else KINDS[name](value)
    return given if SCENARIO in given and COMPLETES not in os.environ else None
