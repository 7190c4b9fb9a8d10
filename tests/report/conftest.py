"""Results of scenarios, computed once; the helpers of this folder can be imported by its tests."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from gapsense.cosim import Result, run

sys.path.insert(0, str(Path(__file__).parent))
SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"


@pytest.fixture(scope="session")
def valve(quickest: Path) -> Result:
    """The scenario of the valve."""
    return run(SCENARIOS / "semera_valve", fmus=quickest)


@pytest.fixture(scope="session")
def relay(quickest: Path) -> Result:
    """The scenario of the relay."""
    return run(SCENARIOS / "semera_relay", fmus=quickest)


@pytest.fixture(scope="session")
def magnet(quickest: Path) -> Result:
    """The scenario of the pot magnet, when it is switched off."""
    return run(SCENARIOS / "pot_magnet", "off", quickest)
