"""The soft-landing cycle of [RTS], and the reduced model fitted to it."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.extend(str(Path(__file__).parents[1] / folder) for folder in ("kernels", "oracles", "estimators", "studies"))

from gapsense.scenarios.soft_landing.cycle import Samples, reference, sampled
from gapsense.scenarios.soft_landing.setting import Study, fitted, nominal


@pytest.fixture(scope="session")
def cycle() -> Samples:
    return sampled(reference())


@pytest.fixture(scope="session")
def study(cycle: Samples) -> Study:
    return Study(cycle, fitted(cycle, nominal()))


@pytest.fixture(scope="session")
def coarse() -> Study:
    """The same with a fifth of the samples."""
    samples = sampled(reference(), 100e-6)
    return Study(samples, fitted(samples, nominal()._replace(T_s=100e-6)))
