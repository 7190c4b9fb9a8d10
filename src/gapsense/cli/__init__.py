"""The command line: one module per group of commands, each registered by its import."""

from gapsense.cli import (
    bounded_ukf,
    components,
    estimators,
    hybrid_ekf,
    identify,
    observability,
    profiles,
    reduced_fit,
    scenarios,
    smoother,
    soft_landing,
)
from gapsense.cli.common import app

__all__ = [
    "app",
    "bounded_ukf",
    "components",
    "estimators",
    "hybrid_ekf",
    "identify",
    "observability",
    "profiles",
    "reduced_fit",
    "scenarios",
    "smoother",
    "soft_landing",
]
