"""Columns of many runs, and how a run is packed into bytes."""

from __future__ import annotations

import json
import math
from base64 import b64decode
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from functools import cached_property
from struct import Struct
from typing import Any

import numpy as np
import numpy.typing as npt

from gapsense.cosim.fmu.descriptions import Descriptions
from gapsense.cosim.result.result import unit_of
from gapsense.cosim.scenario.records import TIMES, Plan, Port, Scenario, matching, recorded_signals
from gapsense.many.store import BITS, ERRORS, SIGNALS, WORDS
from gapsense.tables import Value

TYPES = {"Real": "double", "Integer": "int64", "Boolean": "bool", "String": "string"}
ARRAYS = {"double": np.float64, "int64": np.int64, "bool": np.bool_}
OWN = ("run", "seed", "wall", "error", "ended")  # beside parameters and metrics
ERROR, ENDED = "error", "ended"
Vector = npt.NDArray[Any]
Contents = dict[int, bytes]  # by run


@dataclass(frozen=True)
class Columns:
    """The columns of each run: parameters, metrics, signals, each with its unit."""

    factors: Mapping[str, tuple[str, str]]  # type and unit
    metrics: Mapping[str, str]  # unit
    signals: Mapping[str, str] = field(default_factory=dict)  # unit
    texts: Mapping[str, list[str]] = field(default_factory=dict)  # values of parameters that are texts

    @property
    def names(self) -> list[str]:
        """Of all columns, in order."""
        return ["run", "seed", *self.factors, *self.metrics, "wall", ERROR, ENDED]

    @property
    def units(self) -> dict[str, str]:
        """Unit of each column that may have one."""
        return {**{name: unit for name, (_, unit) in self.factors.items()}, **self.metrics, "wall": "s"}

    @cached_property
    def numbers(self) -> dict[str, int]:
        """Place of each column that is kept as a number."""
        return {name: k for k, name in enumerate((*self.factors, *self.metrics, "wall"))}

    @cached_property
    def layout(self) -> Struct:
        """Bytes of a run."""
        return Struct(f"<q{len(self.numbers)}d")

    @cached_property
    def record(self) -> np.dtype[Any]:
        """The same with the head and the checksum that a store adds."""
        own = [("place", "<i8"), ("bits", "u1"), ("seed", "<i8"), ("numbers", "<f8", (len(self.numbers),))]
        return np.dtype([*own, ("crc", "<u4")])

    @cached_property
    def codes(self) -> dict[str, dict[str, int]]:
        """Number of each text."""
        return {name: {text: k for k, text in enumerate(texts)} for name, texts in self.texts.items()}

    def pack(self, seed: int, values: Mapping[str, Any], metrics: Mapping[str, Any], wall: float | None) -> bytes:
        """Bytes of a run; a metric that is missing is NaN."""
        given = [self.codes[n][str(values[n])] if n in self.codes else values[n] for n in self.factors]
        found = [metrics.get(name) for name in self.metrics]
        return self.layout.pack(seed, *(math.nan if x is None else float(x) for x in (*given, *found, wall)))

    def array(self, name: str, data: npt.NDArray[Any]) -> Vector:
        """A column of some runs; not one of errors or ends."""
        if name == "run":
            return np.asarray(data["place"] & (2**BITS - 1))
        if name == "seed":
            return data["seed"].copy()
        numbers = data["numbers"][:, self.numbers[name]].copy()
        if name in self.texts:
            return np.array(self.texts[name], dtype=object)[numbers.astype(np.intp)]
        kind = self.factors[name][0] if name in self.factors else "double"
        return np.asarray(numbers.astype(ARRAYS[kind], copy=False))

    def facts(self) -> dict[str, Any]:
        """The same as JSON."""
        return asdict(self)


def from_facts(facts: Mapping[str, Any]) -> Columns:
    """Read columns from their JSON."""
    return Columns(**{**facts, "factors": {name: (kind, unit) for name, (kind, unit) in facts["factors"].items()}})


def contents(columns: Columns, entries: Iterable[Mapping[str, Any]]) -> tuple[Contents, dict[str, Contents]]:
    """Runs as a store takes them: numbers, and where they exist a failure, what has ended the run, and signals."""
    runs: Contents = {}
    more: dict[str, Contents] = {ERRORS: {}, WORDS: {}, SIGNALS: {}}
    for entry in entries:
        run, metrics = entry["index"], entry.get("metrics", {})
        runs[run] = columns.pack(entry["shift"], entry["values"], metrics, entry.get("wall"))
        others = {name: value for name, value in metrics.items() if name not in columns.metrics}
        words = {**({ENDED: entry[ENDED]} if ENDED in entry else {}), **({"metrics": others} if others else {})}
        if ERROR in entry:
            more[ERRORS][run] = json.dumps(entry[ERROR]).encode()
        if words:
            more[WORDS][run] = json.dumps(words).encode()
        if "trajectory" in entry:
            more[SIGNALS][run] = b64decode(entry["trajectory"])
    return runs, more


def columns_of(scenario: Scenario, descriptions: Descriptions, plan: Plan, signals: tuple[str, ...] = ()) -> Columns:
    """Columns of many runs of a scenario."""
    units = {name: signal.unit or "" for name, signal in recorded_signals(scenario, descriptions).items()}
    kinds = {port: kind_of(port, plan, descriptions) for port in plan.ports}
    return Columns(
        factors={str(port): (kind, unit_of_varied(port, scenario, descriptions)) for port, kind in kinds.items()},
        metrics={metric.name: unit_of(metric, units) for metric in scenario.metrics},
        signals={name: units[name] for name in matching(signals, units)} if signals else {},
        texts={
            str(port): list(dict.fromkeys(map(str, plan.values_of(port))))
            for port, kind in kinds.items()
            if kind == "string"
        },
    )


def kind_of(port: Port, plan: Plan, descriptions: Descriptions) -> str:
    """Type of a column; items of an enumeration may be given by name."""
    if port.component not in descriptions:  # of an event
        return kind(plan.values_of(port))
    variable = descriptions[port.component].variables[port.variable]
    if variable.type == "Enumeration":
        return "string" if any(isinstance(value, str) for value in plan.values_of(port)) else "int64"
    return TYPES[variable.type]


def kind(values: Iterable[Value]) -> str:
    """Type of a column of values."""
    kinds = {type(value) for value in values}
    if kinds <= {bool}:
        return "bool"
    if kinds <= {int}:
        return "int64"
    return "double" if kinds <= {int, float} else "string"


def unit_of_varied(port: Port, scenario: Scenario, descriptions: Descriptions) -> str:
    """Unit of a parameter that is varied, or of the key of an event."""
    if port.component in descriptions:
        return descriptions[port.component].variables[port.variable].unit or ""
    name, _, key = port.variable.partition(".")
    event = scenario.events[name]
    of = event.target if key == "value" and event.action != "scale" else None
    if event.when and key in ("when.above", "when.below"):
        of = event.when.signal
    return unit_of_varied(of, scenario, descriptions) if of else "s" if key in TIMES else ""
