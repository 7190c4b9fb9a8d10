"""The command line: one module per group of commands, each registered by its import."""

from gapsense.cli import components, observability, reduced_fit, scenarios
from gapsense.cli.common import app

__all__ = ["app", "components", "observability", "reduced_fit", "scenarios"]
