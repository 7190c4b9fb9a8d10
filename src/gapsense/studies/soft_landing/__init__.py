"""Soft landing: voltages that move a reluctance actuator without impact, [RTS] Fig. 5."""

from gapsense.studies.soft_landing.cycle import FIG_5, Cycle, Samples, Trajectory, run, sampled, soft_landing

__all__ = ["FIG_5", "Cycle", "Samples", "Trajectory", "run", "sampled", "soft_landing"]
