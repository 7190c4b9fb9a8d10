"""Soft landing: voltages that move a reluctance actuator without impact, [RTS] Fig. 5."""

from gapsense.studies.soft_landing.cycle import Samples, run, sampled, soft_landing
from gapsense.studies.soft_landing.phases import Cycle
from gapsense.studies.soft_landing.trajectory import FIG_5, Trajectory

__all__ = ["FIG_5", "Cycle", "Samples", "Trajectory", "run", "sampled", "soft_landing"]
