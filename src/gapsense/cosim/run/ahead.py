"""The engines, and a process for a run, which loads what it needs while its task is prepared."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from gapsense._os.processes import ahead
from gapsense.shipped import COMPONENTS

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


@contextmanager
def runs_ahead(workers: int, engine: str, scenario: Path | None) -> Iterator[None]:
    """Start the processes now; but not if vectors will do the runs, as far as the names of the FMUs tell."""
    if likely_vectors(engine) and (scenario is None or has_names_of_ours(scenario)):
        return (yield)
    with ahead("gapsense.many.worker", count=workers):
        yield


def has_names_of_ours(scenario: Path) -> bool:
    """Whether the FMUs of a scenario are called like components that come with this package."""
    from gapsense.tables import read_toml  # here, so that a run starts fast

    ours = {folder.parent.name.replace("_", "") for folder in COMPONENTS.glob("*/component.py")}
    components = (read_toml(scenario, []) or {}).get("components")
    found = components.values() if isinstance(components, dict) else ()
    return {Path(str(own.get("fmu"))).stem.lower() for own in found if isinstance(own, dict)} <= ours
