"""Timed events and faults: what a scenario says of them, whether that fits, and what they do to a run."""
