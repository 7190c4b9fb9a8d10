"""The engines, and a process for a run, which loads what it needs while its task is prepared."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from gapsense._os.prestart import ahead

AUTO, FMU, NATIVE, VECTORS = ENGINES = ("auto", "fmu", "native", "vectors")


def likely_vectors(engine: str) -> bool:
    """True if an engine hardly needs processes: a scenario may turn out to need FMUs all the same."""
    if engine not in (AUTO, VECTORS):
        return False
    from gapsense._os.native import own_compiler  # here, so that a run starts fast

    return own_compiler() is not None


@contextmanager
def run_ahead(again: bool = False, engine: str = FMU) -> Iterator[None]:
    """Start the process of a run in a process of its own now, and `again` that of the next one when it is taken."""
    if likely_vectors(engine):
        return (yield)
    with ahead("gapsense.cosim.run.apart", "gapsense.cosim.run.master", again=again):
        yield
