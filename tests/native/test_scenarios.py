"""Every scenario gives the same bits with native FMUs as with Python ones."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scenarios_of_ours import EVERY

from gapsense import cosim

OFTEN = "semera_valve"
SCENARIOS = [
    pytest.param(file.parent, id=file.parent.name, marks=() if file.parent.name == OFTEN else pytest.mark.slow)
    for file, variant in EVERY
    if not variant
]


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_scenario_gives_the_same_bits(scenario: Path, fmus: Path, natives: Path) -> None:
    variants = (None,) if scenario.name == OFTEN else (None, *cosim.load(scenario).variants)
    for variant in variants:
        if any(component.board for component in cosim.load(scenario, variant).components.values()):
            continue  # a board's firmware is built first: tests/mcu/test_loop_emulated.py
        python, native = (
            cosim.run(scenario, variant, folder, isolation="process").signals for folder in (fmus, natives)
        )
        assert python.keys() == native.keys()
        assert [name for name in python if not np.array_equal(python[name], native[name], equal_nan=True)] == []
