"""The command line: one module per group of commands, each registered by its import."""

from gapsense.cli import (
    components,
    estimators,
    hybrid_ekf,
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
    "components",
    "estimators",
    "hybrid_ekf",
    "observability",
    "profiles",
    "reduced_fit",
    "scenarios",
    "smoother",
    "soft_landing",
]
