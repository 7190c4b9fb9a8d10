"""What of a scenario decides the numbers of its runs: all but the words and what is held against them."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gapsense._os.files import sha256
from gapsense.cosim.scenario.records import Component, Connection, Event, Experiment, Metric, Scenario

# What is not in this table decides: a field that somebody adds is no danger, at worst it computes too often.
WORDS: Mapping[type, frozenset[str]] = {
    Scenario: frozenset(
        {"path", "called", "title", "description", "figure", "variant", "variants", "tested", "baseline", "files"}
        | {"hashes", "rows_columns", "settings", "page"}
    ),
    Experiment: frozenset({"pace", "isolation", "step_limit"}),
    Component: frozenset({"origin", "sets", "isolation"}),
    Connection: frozenset({"place"}),
    Event: frozenset({"description", "given"}),
    Metric: frozenset({"bounds", "description", "published", "table", "label"}),
}


def deciding(scenario: Scenario) -> Any:
    """What decides, of JSON: values however they are written down, and the content of files that they name."""
    return facts(scenario, {str(file.resolve()): file for file in scenario.files})


def facts(value: Any, files: Mapping[str, Path]) -> Any:
    """A value in JSON, with the hash of a file in place of its name; the order of tables is kept."""
    if is_dataclass(value):
        left_out = WORDS.get(type(value), frozenset())
        return {f.name: facts(getattr(value, f.name), files) for f in fields(value) if f.name not in left_out}
    if isinstance(value, Mapping):
        return [[str(name), facts(item, files)] for name, item in value.items()]
    if isinstance(value, (list, tuple)):
        return [facts(item, files) for item in value]
    if isinstance(value, np.ndarray):
        return hashlib.sha256(value.tobytes()).hexdigest()
    if isinstance(value, (str, Path)):
        return {"sha256": sha256(files[str(value)])} if str(value) in files else str(value)
    return value
