"""The keys of a study file, from their table `keys.toml`."""

from __future__ import annotations

from pathlib import Path

from gapsense.cosim.scenario.keys import read_sections
from gapsense.many.draws import DISTRIBUTIONS, METHODS

NOISES = ("own", "common")
SPACINGS = ("linear", "log")
CHOICES = {"distributions": DISTRIBUTIONS, "methods": METHODS, "noises": NOISES, "spacings": SPACINGS}
SECTIONS = read_sections(Path(__file__).with_name("keys.toml"), CHOICES)
STUDY = SECTIONS["study"]
