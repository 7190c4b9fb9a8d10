"""`python -m gapsense.cli`."""

from gapsense.cli import app

app()
