"""The command line: one module per group of commands, each registered by its import."""

from gapsense.cli import components, identify, observability, scenarios
from gapsense.cli.common import app

__all__ = ["app", "components", "identify", "observability", "scenarios"]
