"""Estimators on a measured record, through their FMUs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from gapsense.cosim.descriptions import describe
from gapsense.cosim.feed import feed
from gapsense.files import write_atomically, write_columns
from gapsense.fmi.components import find_components, load_component
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


def estimators(root: Path, causality: str = "input") -> dict[str, list[str]]:
    """Inputs, or other ports, of every estimator in fmus/."""
    found = [load_component(folder) for folder in find_components(root / "fmus")]
    mine = [c for c in found if c.kernel.startswith("gapsense.estimators.")]
    return {c.name: [port.name for port in c.of(causality)] for c in mine}


def unfit(root: Path, values: dict[str, Any]) -> dict[str, str]:
    """Why estimators do not fit the device that the parameters describe."""
    found = {name: foreign(name, own, values) for name, own in estimators(root, "parameter").items()}
    return {name: reason for name, reason in found.items() if reason}


def chosen(
    wanted: str | None, inputs: Mapping[str, Sequence[str]], record: Record, excluded: Mapping[str, str]
) -> tuple[list[str], list[str]]:
    """Names of the estimators to run, and why others cannot.

    Those wanted, or all that can run and are not `excluded` for a reason; a ValueError says why one that is wanted
    cannot.
    """
    plain = {name.lower(): name for name in inputs}
    asked = [word.strip().replace("_", "").lower() for word in wanted.split(",")] if wanted else list(plain)
    if unknown := [word for word in asked if word not in plain]:
        raise ValueError(f"--estimator: no estimator `{unknown[0]}`; there are {', '.join(inputs)}.")
    reasons = {name: excluded.get(name) or missing(record, inputs, name) for name in (plain[word] for word in asked)}
    refused = [reason for reason in reasons.values() if reason]
    if refused and (wanted or len(refused) == len(reasons)):
        raise ValueError("\n".join(refused))
    return [name for name, reason in reasons.items() if not reason], refused


def run_estimators(
    fmus: Path, names: Sequence[str], record: Record, values: Mapping[str, Value], progress: Callable[[int, int], None]
) -> list[Estimate]:
    """Estimators, by name from a folder of FMUs, over a record."""
    estimates = []
    for k, name in enumerate(names):
        progress(k, len(names))
        estimates.append(run_estimator(fmus / f"{name}.fmu", record, values))
    return estimates


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
    names = [v.name for v in description.of("parameter")]
    own = {**values_for(names, values), **({"sample_time": record.dt} if "sample_time" in names else {})}
    signals = offered(record)
    inputs = {v.name: signals[v.name] for v in description.of("input")}
    return Estimate(fmu.stem, feed(fmu, fmu.stem, own, float(record.times[0]), record.dt, inputs), own)


def save(path: Path, record: Record, estimates: Sequence[Estimate]) -> Path:
    """CSV file of all outputs."""
    columns = {"time": record.times, "voltage": record.voltage, "current": record.current}
    columns |= {f"{e.name}.{name}": samples for e in estimates for name, samples in e.outputs.items()}
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(path, lambda file: write_columns(file, columns))
    return path
