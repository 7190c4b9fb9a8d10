"""Worker processes for many runs, started while these are prepared."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from gapsense._os.prestart import ahead
from gapsense.cosim.run.ahead import likely_vectors
from gapsense.shipped import COMPONENTS
from gapsense.tables import read_toml


@contextmanager
def runs_ahead(workers: int, engine: str, scenario: Path | None) -> Iterator[None]:
    """Start the processes now, unless vectors will do the runs: where all FMUs have names of ours, as it seems."""
    if likely_vectors(engine) and (scenario is None or has_names_of_ours(read_toml(scenario, []) or {})):
        return (yield)
    with ahead("gapsense.many.worker", count=workers):
        yield


def has_names_of_ours(data: Mapping[str, Any]) -> bool:
    """Whether the FMUs of a scenario are called like components that come with this package."""
    ours = {folder.parent.name.replace("_", "") for folder in COMPONENTS.glob("*/component.py")}
    components = data.get("components")
    found = components.values() if isinstance(components, dict) else ()
    names = {Path(str(own.get("fmu"))).stem.lower() for own in found if isinstance(own, dict)}
    return names <= ours
