"""Results of scenarios, computed once."""

from __future__ import annotations

from pathlib import Path

import pytest

from gapsense.cosim import Result, run

SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"


@pytest.fixture(scope="session")
def valve(fmus: Path) -> Result:
    """The scenario of the valve."""
    return run(SCENARIOS / "semera_valve", fmus=fmus)


@pytest.fixture(scope="session")
def relay(fmus: Path) -> Result:
    """The scenario of the relay."""
    return run(SCENARIOS / "semera_relay", fmus=fmus)


@pytest.fixture(scope="session")
def magnet(fmus: Path) -> Result:
    """The scenario of the pot magnet, when it is switched off."""
    return run(SCENARIOS / "pot_magnet", "off", fmus)
