"""Processes for runs and sweeps, which load what they need while their task is prepared."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from gapsense.spare import ahead


@contextmanager
def run_ahead(again: bool = False) -> Iterator[None]:
    """Start the process of a run in a process of its own now, and `again` that of the next one when it is taken."""
    with ahead("gapsense.cosim.apart_child", "fmpy.fmi2", again=again):
        yield


@contextmanager
def sweep_ahead(workers: int) -> Iterator[None]:
    """Start the processes of a sweep now."""
    with ahead("gapsense.cosim.worker", "fmpy.fmi2", count=workers):
        yield
