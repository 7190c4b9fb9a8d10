"""Processes for runs and sweeps that load what they need while it is prepared what they are to do."""

from __future__ import annotations

from contextlib import AbstractContextManager

from gapsense.spare import ahead


def run_ahead(again: bool = False) -> AbstractContextManager[None]:
    """Start the process of a run in a process of its own now, and `again` that of the next one when a run begins."""
    return ahead("gapsense.cosim.apart_child", "fmpy.fmi2", again=again)


def sweep_ahead(workers: int) -> AbstractContextManager[None]:
    """Start the processes of a sweep now."""
    return ahead("gapsense.cosim.worker", "fmpy.fmi2", count=workers)
