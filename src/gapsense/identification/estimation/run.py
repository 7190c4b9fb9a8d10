"""Estimators on a measured record, through their FMUs."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from gapsense._os.files import write_atomically, write_columns
from gapsense._os.workers import Progress
from gapsense.cosim.fmu.descriptions import describe
from gapsense.cosim.fmu.feed import feed
from gapsense.fmi.components import find_components, load_component
from gapsense.fmi.ports import Component
from gapsense.fmi.values import problems
from gapsense.identification.assumptions import is_device
from gapsense.identification.measurements.record import UNITS, Record, Vector
from gapsense.identification.transfer import values_for
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
    units: Mapping[str, str]  # of the outputs; empty where the FMU states none
    resistance: float | None = None  # that its model has, given or not [Ohm]
    unset: Mapping[str, Value] = {}  # start values that describe the device or the noise, and that nobody gave


def offered(record: Record) -> dict[str, Vector]:
    """Signals of a record that an estimator may take as inputs."""
    signals = {"voltage": record.voltage, "current": record.current, "mode": record.mode, "position": record.position}
    return {name: samples for name, samples in signals.items() if samples is not None}


def shifted(record: Record, offsets: Sequence[str]) -> Record:
    """The record less what `QUANTITY=VALUE` says that voltage or current are off by."""
    for text in offsets:
        name, _, value = text.partition("=")
        try:
            if name not in ("voltage", "current"):
                raise ValueError
            record = record._replace(**{name: getattr(record, name) - float(value)})
        except ValueError:
            raise ValueError(f"--offset: `{text}` found, `voltage=VALUE` or `current=VALUE` expected.") from None
    return record


def missing(record: Record, found: Mapping[str, Component], name: str) -> str | None:
    """Why an estimator cannot run on a record, and what to do; None if it can."""
    lacks = {n: [i for i in needed(c) if i not in offered(record)] for n, c in found.items()}
    if not lacks[name]:
        return None
    lacking = ", ".join(f"`{i}`" for i in lacks[name])
    remedy = "; ".join(REMEDY.get(i, f"Add a column `{i}`") for i in lacks[name])
    others = ", ".join(n for n, inputs in lacks.items() if not inputs)
    able = f", or choose an estimator that needs none: {others}" if others else ""
    return f"{name} needs {lacking}, which {record.name} does not have. {remedy}{able}."


def needed(component: Component) -> list[str]:
    """Inputs that an estimator cannot do without."""
    return [port.name for port in component.of("input") if not port.is_optional]


def foreign(component: Component, values: Mapping[str, Value]) -> str | None:
    """Why an estimator models another device than the one that `values` describe; None if it does not."""
    names = {port.name for port in component.of("parameter")}
    said = ""
    if "gap.law" in values and "core.permeability" in names - set(values):
        said = f"{component.name} models a pot magnet, not a valve with a gap law."
    elif "prior.inductance" in values and "mover.mass" in names and not {"gap.law", "mover.mass"} & set(values):
        said = f"{component.name} models a mover, of which the parameters of a coil tell nothing."
    return f"{said} Name it with `--estimator` to run it all the same." if said else None


def unfit(component: Component, record: Record, values: Mapping[str, Value]) -> str | None:
    """Why an estimator does not take the sampling period of a record; None if it does."""
    names = [port.name for port in component.of("parameter")]
    given = values_for(names, values)
    before = problems(component, given)
    wrong = [text for text in problems(component, given_time(names, given, record)) if text not in before]
    return f"{component.name}, every {1e6 * record.dt:.4g} us: {wrong[0]}" if wrong else None


def given_time(names: Collection[str], given: Mapping[str, Value], record: Record) -> dict[str, Value]:
    """Values, with the sample time of a record where there is such a parameter."""
    return {**given, **({"sample_time": record.dt} if "sample_time" in names else {})}


def estimators(folder: Path) -> dict[str, Component]:
    """The estimators in a folder of components, by name."""
    found = map(load_component, find_components(folder))
    return {c.name: c for c in found if c.kernel.startswith("gapsense.estimators.")}


def chosen(
    wanted: str | None, found: Mapping[str, Component], record: Record, values: Mapping[str, Value]
) -> tuple[list[str], list[str]]:
    """Names of the estimators to run, and why others cannot.

    Those wanted, or all that can run and model the device that `values` describe; a ValueError says why one that is
    wanted cannot.
    """
    plain = {name.lower(): name for name in found}
    asked = [word.strip().replace("_", "").lower() for word in wanted.split(",")] if wanted else list(plain)
    if unknown := [word for word in asked if word not in plain]:
        raise ValueError(f"--estimator: no estimator `{unknown[0]}`; there are {', '.join(found)}.")
    reasons = {}
    for name in (plain[word] for word in asked):
        component, lacks = found[name], missing(record, found, name)
        reasons[name] = (None if wanted else foreign(component, values)) or lacks or unfit(component, record, values)
    refused = [reason for reason in reasons.values() if reason]
    if refused and (wanted or len(refused) == len(reasons)):
        raise ValueError("\n".join(refused))
    return [name for name, reason in reasons.items() if not reason], refused


def run_all(
    fmus: Sequence[Path], record: Record, values: Mapping[str, Value], progress: Progress = lambda done, total: None
) -> list[Estimate]:
    """Estimators over a record, one after the other; `progress` is called with those done and all."""
    estimates = []
    for k, fmu in enumerate(fmus):
        progress(k, len(fmus))
        estimates.append(run_estimator(fmu, record, values))
    return estimates


def run_estimator(fmu: Path, record: Record, values: Mapping[str, Value]) -> Estimate:
    """An estimator over a record with all inputs that this has, with its sample time and those values that it has."""
    description = describe(fmu)
    names = [v.name for v in description.of("parameter")]
    own = given_time(names, values_for(names, values), record)
    signals = offered(record)
    inputs = {v.name: signals[v.name] for v in description.of("input") if v.name in signals}
    outputs = feed(fmu, fmu.stem, own, float(record.times[0]), record.dt, inputs)
    coil = description.variables.get("coil.resistance")
    resistance = None if coil is None else float(own.get("coil.resistance", coil.start or 0.0))
    units = {n: description.variables[n].unit or "" for n in outputs}
    starts = {v.name: v.start for v in description.of("parameter") if v.start is not None}
    return Estimate(
        name=fmu.stem, outputs=outputs, values=own, units=units, resistance=resistance, unset=unset(starts, own)
    )


def unset(starts: Mapping[str, Value], given: Mapping[str, Value]) -> dict[str, Value]:
    """Start values for the device and the noise that an estimator uses because nobody gave others."""
    laws = {"gap.reluctance", "gap.slope", "gap.fringing", "gap.window", "gap.area"}
    values = {**starts, **given}
    law = values.get("gap.law")
    idle = {"table": laws, "linear": laws - {"gap.slope"} | {"gap.file"}}.get(str(law), {"gap.file"} if law else set())
    idle = idle | ({"gap.window"} if values.get("gap.fringing") == 0.0 else set())
    priors = ("prior.resistance", "prior.inductance") if "prior.inductance" in starts else ()
    names = [name for name in starts if is_device(name) or name.startswith("noise.") or name in priors]
    return {name: starts[name] for name in names if name not in given and name not in idle}


def save(path: Path, record: Record, estimates: Sequence[Estimate]) -> Path:
    """CSV file of all outputs."""
    columns = {"time": record.times, "voltage": record.voltage, "current": record.current}
    columns |= {f"{e.name}.{name}": samples for e in estimates for name, samples in e.outputs.items()}
    units = {**UNITS, **{f"{e.name}.{name}": unit for e in estimates for name, unit in e.units.items()}}
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(path, lambda file: write_columns(file, columns, units))
    return path
