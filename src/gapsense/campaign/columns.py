"""Columns of a campaign's result, and lines of its journal as tables of Arrow with these."""

from __future__ import annotations

from base64 import b64decode
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
import pyarrow as pa

from gapsense.campaign.prepare import OWN_COLUMNS, Prepared
from gapsense.cosim.fmu.variables import Variable
from gapsense.cosim.result.metrics import unit_of
from gapsense.cosim.scenario.signals import matching, recorded_signals
from gapsense.tables import Value

TYPES = {"Real": pa.float64(), "Integer": pa.int64(), "Boolean": pa.bool_(), "String": pa.string()}
NAMES = {str(kind): kind for kind in TYPES.values()}
UNIT = b"unit"
SIGNALS = "trajectory"  # of a line: time and signals, as bytes of numbers
Line = Mapping[str, Any]  # of the journal


@dataclass(frozen=True)
class Columns:
    """What a result has of each run: parameters, metrics, signals, each with its unit."""

    factors: Mapping[str, tuple[str, str]]  # type and unit
    metrics: Mapping[str, str]  # unit
    signals: Mapping[str, str] = field(default_factory=dict)  # unit

    @property
    def runs(self) -> pa.Schema:
        """Of the table with one row per run."""
        own = [pa.field(name, NAMES[kind], metadata={UNIT: unit}) for name, (kind, unit) in self.factors.items()]
        own += [pa.field(name, pa.float64(), metadata={UNIT: unit}) for name, unit in self.metrics.items()]
        texts = [pa.field(name, pa.string()) for name in ("error", "ended")]
        ends = [pa.field("wall", pa.float64(), metadata={UNIT: "s"}), *texts]
        return pa.schema([pa.field("run", pa.int64()), pa.field("seed", pa.int64()), *own, *ends])

    @property
    def trajectories(self) -> pa.Schema:
        """Of the table with the rows of all runs."""
        own = [pa.field(name, pa.float64(), metadata={UNIT: unit}) for name, unit in self.signals.items()]
        return pa.schema([pa.field("run", pa.int64()), pa.field("time", pa.float64(), metadata={UNIT: "s"}), *own])

    def table(self, lines: Iterable[Line]) -> pa.Table:
        """A row for each line."""
        schema, rows = self.runs, [flat(line) for line in lines]
        texts = {name for name, (kind, _) in self.factors.items() if kind == "string"}
        arrays = [
            pa.array([text(row.get(f.name)) if f.name in texts else row.get(f.name) for row in rows], f.type)
            for f in schema
        ]
        return pa.Table.from_arrays(arrays, schema=schema)

    def trajectory(self, line: Line) -> pa.Table:
        """The signals of one run."""
        data = np.frombuffer(b64decode(line[SIGNALS]), dtype="<f8").reshape(1 + len(self.signals), -1)
        runs = np.full(data.shape[1], line["run"], dtype=np.int64)
        return pa.Table.from_arrays([pa.array(runs), *map(pa.array, data)], schema=self.trajectories)

    def facts(self) -> dict[str, Any]:
        """The same as JSON."""
        return asdict(self)


def from_facts(facts: Mapping[str, Any]) -> Columns:
    """Columns of their JSON."""
    factors = {name: (kind, unit) for name, (kind, unit) in facts["factors"].items()}
    return Columns(factors, facts["metrics"], facts["signals"])


def columns_of(prepared: Prepared) -> Columns:
    """Columns of the result of a campaign."""
    scenario, descriptions, plan = prepared.scenario, prepared.descriptions, prepared.plan
    units = {name: signal.unit or "" for name, signal in recorded_signals(scenario, descriptions).items()}
    kept = matching(prepared.study.signals, units)
    variables = {port: descriptions[port.component].variables[port.variable] for port in plan.ports}
    return Columns(
        factors={str(p): (kind_of(v, plan.values_of(p)), v.unit or "") for p, v in variables.items()},
        metrics={metric.name: unit_of(metric, units) for metric in scenario.metrics},
        signals={name: units[name] for name in kept},
    )


def kind_of(variable: Variable, values: Iterable[Value]) -> str:
    """Type of a column; items of an enumeration may be given by name."""
    if variable.type == "Enumeration":
        return "string" if any(isinstance(value, str) for value in values) else "int64"
    return str(TYPES[variable.type])


def flat(line: Line) -> dict[str, Any]:
    """What a line says, by column."""
    return {**line["values"], **line.get("metrics", {}), **{name: line.get(name) for name in OWN_COLUMNS}}


def text(value: Value | None) -> str | None:
    """A value of a column of texts."""
    return None if value is None else str(value)
