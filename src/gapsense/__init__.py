"""Gapsense: FMI co-simulation components for short-stroke reluctance actuators."""

__version__ = "0.1.0"
