"""What decides the results of many runs, as a key, and what they tell beside the numbers, to repeat each run."""

from __future__ import annotations

import math
import os
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from gapsense._os.files import fingerprint, sha256
from gapsense.cosim.result.sidecar import relative
from gapsense.cosim.run.recording import versions
from gapsense.cosim.scenario.records import Scenario
from gapsense.shipped import COMPONENTS, INSTALLED, PACKAGE, SCENARIOS

EVENTS = "events."  # before the name of a key of an event, where others have the name of their component
SOURCES = (".py", ".c", ".h", ".csv", ".toml")


def key(facts: Any) -> str:
    """Hash of all that decides results: facts (of JSON), our sources, the version of numpy."""
    return fingerprint([facts, sources(), np.__version__])


def sources() -> dict[str, str]:
    """Hash of every source file of this package, of the port tables, whose start values studies take, and of studies.

    Taken anew each time, since it may be edited while a program runs. A checkout and what is installed from it agree.
    """
    return {**hashes(PACKAGE, but=INSTALLED), **hashes(COMPONENTS), **hashes(SCENARIOS, (".py",))}


def hashes(folder: Path, endings: Collection[str] = SOURCES, but: Path | None = None) -> dict[str, str]:
    """Hash of every source file below a folder, by its path from there on, `but` those of a folder inside."""
    files, above = [], len(folder.parent.as_posix().rstrip("/")) + 1
    for where, folders, names in os.walk(folder):
        here = Path(where).as_posix() + "/"  # of texts, for a path of each file takes longer than its hash
        folders[:] = [name for name in folders if name != "__pycache__" and not (but and here + name == but.as_posix())]
        files += [here + name for name in names if name[name.rfind(".") :] in endings]
    return {file[above:]: sha256(Path(file)) for file in sorted(files, key=lambda file: file.split("/"))}


def provenance(scenario: Scenario, folder: Path) -> dict[str, Any]:
    """Of JSON; the scenario's file is seen from the folder of the result, and empty if it has none."""
    file = scenario.path.resolve()
    return {
        "title": scenario.title,
        "description": scenario.description,
        "scenario": scenario.name,
        "variant": scenario.variant,
        "source": relative(str(file) if file.is_file() else "", folder),
        "seeds": dict(scenario.seeds),
        "has_random_events": any(event.is_random for event in scenario.events.values()),
        "versions": versions(),
        "labels": {metric.name: [metric.table, metric.label] for metric in scenario.metrics},
        "bounds": {m.name: [b if math.isfinite(b) else str(b) for b in m.bounds] for m in scenario.metrics if m.bounds},
    }


def bounds(about: Mapping[str, Any], metric: str) -> tuple[float, float] | None:
    """Bounds of a metric, as a result tells them; older ones tell none."""
    found = about.get("bounds", {}).get(metric)
    return None if found is None else (float(found[0]), float(found[1]))
