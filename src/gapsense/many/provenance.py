"""What the results of many runs tell of them beside the numbers: enough to understand and to repeat each run."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from gapsense.cosim.result.sidecar import relative
from gapsense.cosim.run.recording import versions
from gapsense.cosim.scenario.records import Scenario

EVENTS = "events."  # before the name of a key of an event, where others have the name of their component


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
