"""Estimators on a measured record, through their FMUs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from gapsense.cosim.descriptions import describe
from gapsense.cosim.feed import feed
from gapsense.studies.identification.record import Record, Vector
from gapsense.studies.identification.transfer import values_for
from gapsense.tables import Value

REMEDY = {
    "mode": "Add a column `mode [1]` with 1: closed, 2: moving, 3: open, from contact sensors on the stops",
    "position": "Add a column `position [m]`",
}


class Estimate(NamedTuple):
    """Outputs of one estimator at each sample, and the parameters that were set."""

    name: str
    outputs: Mapping[str, Vector]
    values: Mapping[str, Value]


def offered(record: Record) -> dict[str, Vector]:
    """Signals of a record that an estimator may take as inputs."""
    signals = {"voltage": record.voltage, "current": record.current, "mode": record.mode, "position": record.position}
    return {name: samples for name, samples in signals.items() if samples is not None}


def missing(record: Record, inputs: Mapping[str, Sequence[str]], name: str) -> str | None:
    """Why an estimator cannot run on a record, and what to do; None if it can.

    Parameters
    ----------
    record : Record
        What was measured.
    inputs : mapping
        Inputs of every estimator.
    name : str
        The one in question.
    """
    lacking = [i for i in inputs[name] if i not in offered(record)]
    if not lacking:
        return None
    others = [n for n, needs in inputs.items() if all(i in offered(record) for i in needs)]
    remedy = "; ".join(REMEDY.get(i, f"Add a column `{i}`") for i in lacking)
    able = f", or choose an estimator that needs none: {', '.join(others)}" if others else ""
    return f"{name} needs {', '.join(f'`{i}`' for i in lacking)}, which {record.name} does not have. {remedy}{able}."


def foreign(name: str, parameters: Sequence[str], values: Mapping[str, Value]) -> str | None:
    """Why an estimator models another device than the one that `values` describe; None if it does not."""
    if "gap.law" not in values or "core.permeability" not in parameters or "core.permeability" in values:
        return None
    return f"{name} models a pot magnet, not a valve with a gap law. Name it with `--estimator` to run it all the same."


def run_estimator(fmu: Path, record: Record, values: Mapping[str, Value]) -> Estimate:
    """One estimator over a record; its sample time is that of the record.

    Parameters
    ----------
    fmu : Path
        FMU of the estimator.
    record : Record
        With all inputs that it needs.
    values : mapping
        Parameters, for instance of the identified valve; those that it has are taken.
    """
    description = describe(fmu)
    names = [v.name for v in description.parameters]
    own = {**values_for(names, values), **({"sample_time": record.dt} if "sample_time" in names else {})}
    signals = offered(record)
    inputs = {v.name: signals[v.name] for v in description.inputs}
    return Estimate(fmu.stem, feed(fmu, fmu.stem, own, float(record.times[0]), record.dt, inputs), own)
