"""Estimators on a measured record, through their FMUs, and whether what they say can be right.

Resistance and flux linkage of an operation follow from voltage and current alone, (23) and (21), and an estimator that
has the device's parameters predicts the current.  Its own `health` knows neither: a filter that takes a wrong model for
an error of the current is content, and one that is sure of a sound model doubts each edge of the voltage.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure
from rich.table import Table

from gapsense._os.files import write_atomically, write_columns
from gapsense._os.workers import Progress
from gapsense.cosim.fmu.descriptions import describe
from gapsense.cosim.fmu.feed import feed
from gapsense.estimators.readings import CAUSES
from gapsense.fmi.components import find_components, kernel_parameters, load_component, own
from gapsense.fmi.ports import Component
from gapsense.fmi.values import problems
from gapsense.identification.actuator.edges import place_edges
from gapsense.identification.assumptions import is_device, list_values, meanings
from gapsense.identification.least_squares import rms
from gapsense.identification.measurements.checks import begins_at_rest
from gapsense.identification.measurements.operations import Flux, operations, starts
from gapsense.identification.measurements.operations import estimate as integral
from gapsense.identification.measurements.prepare import average_blocks
from gapsense.identification.measurements.record import UNITS, Record, Vector
from gapsense.identification.parameter_set import values_for
from gapsense.identification.residual import noise_of
from gapsense.identification.valve.show import BY_NAME
from gapsense.problems import listing, suggest
from gapsense.report.plot import FIRST, SECOND, THIRD, TRUE, legend, line, scale_axis, stack
from gapsense.report.table import quantity, table
from gapsense.tables import Value

REMEDY = {
    "mode": "Add a column `mode [1]` with 1: closed, 2: moving, 3: open, from contact sensors on the stops",
    "position": "Add a column `position [m]`",
}


MOST_MEANS = 50  # samples of a mean


class Estimate(NamedTuple):
    """Outputs of one estimator at each sample, and the parameters that were set."""

    name: str
    outputs: Mapping[str, Vector]
    values: Mapping[str, Value]
    units: Mapping[str, str]  # of the outputs; empty where the FMU states none
    resistance: float | None = None  # that its model has, given or not [Ohm]
    unset: Mapping[str, Value] = {}  # start values of the device or the noise, which were not given


def signals_of(record: Record) -> dict[str, Vector]:
    """Signals of a record that an estimator may take as inputs."""
    signals = {"voltage": record.voltage, "current": record.current, "mode": record.mode, "position": record.position}
    return {name: samples for name, samples in signals.items() if samples is not None}


def subtract_given(record: Record, offsets: Sequence[str]) -> Record:
    """The record less what `QUANTITY=VALUE` says that voltage or current are off by."""
    for text in offsets:
        name, _, value = text.partition("=")
        try:
            if name not in ("voltage", "current") or not math.isfinite(float(value)):
                raise ValueError
            record = record._replace(**{name: getattr(record, name) - float(value)})
        except ValueError:
            raise ValueError(f"--offset: `{text}` found, `voltage=VALUE` or `current=VALUE` expected.") from None
    return record


def missing(record: Record, found: Mapping[str, Component], name: str) -> str | None:
    """Why an estimator cannot run on a record, and what to do; None if it can."""
    known = signals_of(record)
    lacks = {n: [p.name for p in c.of("input") if not (p.is_optional or p.name in known)] for n, c in found.items()}
    if not lacks[name]:
        return None
    lacking = ", ".join(f"`{i}`" for i in lacks[name])
    remedy = "; ".join(REMEDY[i] for i in lacks[name])
    others = ", ".join(n for n, inputs in lacks.items() if not inputs)
    able = f", or choose an estimator that needs none: {others}" if others else ""
    return f"{name} needs {lacking}, which {record.name} does not have. {remedy}{able}."


def foreign(component: Component, values: Mapping[str, Value]) -> str | None:
    """Why an estimator models another device than the one that `values` describe; None if it does not."""
    names = {port.name for port in component.of("parameter")}
    said = ""
    if "gap.law" in values and "core.permeability" in names - set(values):
        said = f"{component.name} models a pot magnet, not a valve with a gap law."
    elif "prior.inductance" in values and "mover.mass" in names and not {"gap.law", "mover.mass"} & set(values):
        said = f"{component.name} models a mover, which the parameters of a coil do not describe."
    return f"{said} Name it with `--estimator` to run it anyway." if said else None


def unfit(component: Component, record: Record, values: Mapping[str, Value]) -> str | None:
    """Why an estimator does not take the sampling period of a record; None if it does."""
    names = [port.name for port in component.of("parameter")]
    given = values_for(names, values)
    before = problems(component, given)
    wrong = [text for text in problems(component, given_time(names, given, record)) if text not in before]
    return f"{component.name}, every {1e6 * record.dt:.4g} us: {wrong[0]}" if wrong else None


def given_time(names: Collection[str], given: Mapping[str, Value], record: Record) -> dict[str, Value]:
    """Values, with the sample time of a record, and that its voltages are means, where there are such parameters."""
    told = {"sample_time": record.dt, **({"option.mean": True} if record.is_mean else {})}
    return {**given, **{name: value for name, value in told.items() if name in names}}


def coarsen(record: Record, wanted: str | None, found: Mapping[str, Component], values: Mapping[str, Value]) -> Record:
    """Means of as few samples as all estimators that are wanted take; the record itself where none, or no means, do."""
    names = [word.lower() for word in _parse_names(wanted)]
    asked = [c for name, c in found.items() if name.lower() in names]
    for size in range(1, MOST_MEANS):
        made = average_blocks(record, size) if size > 1 else record
        if not any(unfit(c, made, values) for c in asked):
            said = (
                f"means of {size} samples, every {1e6 * made.dt:.4g} us, are taken: {listing([c.name for c in asked])}"
                " cannot hold an operation of more samples."
            )
            return made._replace(remarks=(*made.remarks, said)) if size > 1 else record
    return record


def estimators(folder: Path) -> dict[str, Component]:
    """The estimators in a folder of components whose inputs a record can have, by name."""
    found = [c for c in map(load_component, find_components(folder)) if c.kernel.startswith("gapsense.estimators.")]
    needs = {c.name: {p.name for p in c.of("input") if not p.is_optional} for c in found}
    return {c.name: c for c in found if needs[c.name] <= {"voltage", "current", *REMEDY}}


def _parse_names(wanted: str | None) -> list[str]:
    """Parse names of estimators; they are compared in lower case."""
    return [word.strip().replace("_", "") for word in wanted.split(",")] if wanted else []


def choose_estimators(
    wanted: str | None, found: Mapping[str, Component], record: Record, values: Mapping[str, Value]
) -> tuple[list[str], list[str]]:
    """Names of the estimators to run, and why others cannot.

    Those wanted, or all that can run and model the device that `values` describe; a ValueError says why one that is
    wanted cannot.
    """
    plain = {name.lower(): name for name in found}
    asked = _parse_names(wanted) or list(plain)
    if unknown := [word for word in asked if word.lower() not in plain]:
        raise ValueError(f"--estimator: there is no estimator `{unknown[0]}`. {suggest(unknown[0], found)}")
    reasons = {}
    for name in (plain[word.lower()] for word in asked):
        component, lacks = found[name], missing(record, found, name)
        reasons[name] = (None if wanted else foreign(component, values)) or lacks or unfit(component, record, values)
    refused = [reason for reason in reasons.values() if reason]
    if refused and (wanted or len(refused) == len(reasons)):
        raise ValueError("\n".join(refused))
    return [name for name, reason in reasons.items() if not reason], refused


def with_placed_edges(record: Record, values: Mapping[str, Value]) -> Record:
    """Give the record that `Mhe` is to have: with edges of the voltage where its currents tell."""
    mhe = own("mhe")
    names = [port.name for port in load_component(mhe).of("parameter")]
    return place_edges(record, kernel_parameters(mhe, values_for(names, values)))


def run_all(
    fmus: Sequence[Path],
    record: Record,
    values: Mapping[str, Value],
    progress: Progress = lambda done, total: None,
    means: Record | None = None,
) -> list[Estimate]:
    """Estimators over a record, or `Mhe` over its mean voltages; `progress` is called with those done and all."""
    estimates = []
    for k, fmu in enumerate(fmus):
        progress(k, len(fmus))
        estimates.append(run_estimator(fmu, means if means and fmu.stem == "Mhe" else record, values))
    return estimates


def run_estimator(fmu: Path, record: Record, values: Mapping[str, Value]) -> Estimate:
    """Run an estimator over a record, with all inputs and parameters that the record can give, and its sample time."""
    description = describe(fmu)
    names = [v.name for v in description.of("parameter")]
    mine = given_time(names, values_for(names, values), record)
    signals = signals_of(record)
    inputs = {v.name: signals[v.name] for v in description.of("input") if v.name in signals}
    outputs = feed(fmu, fmu.stem, mine, float(record.times[0]), record.dt, inputs)
    coil = description.variables.get("coil.resistance")
    resistance = None if coil is None else float(mine.get("coil.resistance", coil.start or 0.0))
    units = {n: description.variables[n].unit or "" for n in outputs}
    left = unset(description.starts, mine)
    return Estimate(name=fmu.stem, outputs=outputs, values=mine, units=units, resistance=resistance, unset=left)


def unset(starts: Mapping[str, Value], given: Mapping[str, Value]) -> dict[str, Value]:
    """Start values for the device and the noise that an estimator uses because no others were given."""
    laws = {"gap.reluctance", "gap.slope", "gap.fringing", "gap.window", "gap.area"}
    values = {**starts, **given}
    law = values.get("gap.law")
    idle = {"table": laws, "linear": laws - {"gap.slope"} | {"gap.file"}}.get(str(law), {"gap.file"} if law else set())
    idle = idle | ({"gap.window"} if values.get("gap.fringing") == 0.0 else set())
    priors = ("prior.resistance", "prior.inductance") if "prior.inductance" in starts else ()
    names = [name for name in starts if is_device(name) or name.startswith("noise.") or name in priors]
    return {name: starts[name] for name in names if name not in given and name not in idle}


def columns_of(record: Record, estimates: Sequence[Estimate]) -> dict[str, Vector]:
    """What was recorded, and all outputs by `Estimator.output`."""
    columns = {"time": record.times, "voltage": record.voltage, "current": record.current}
    return columns | {f"{e.name}.{name}": samples for e in estimates for name, samples in e.outputs.items()}


def save(path: Path, record: Record, estimates: Sequence[Estimate]) -> Path:
    """CSV file of all outputs."""
    units = {**UNITS, **{f"{e.name}.{name}": unit for e in estimates for name, unit in e.units.items()}}
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(path, lambda file: write_columns(file, columns_of(record, estimates), units))
    return path


FAR = {
    "resistance": 0.1,
    "flux linkage": 0.15,
    "current": 0.2,
}  # relative to what the record tells, RMS; a warm coil has 0.1
FLOWS = 0.1  # of the largest current: less does not count
HEALTHY = 0.5  # part of the samples
INNOVATION = 10.0  # times the noise: more is left by a model that is another one


class Truth(NamedTuple):
    """What the last complete operation of a record from rest on tells; without one its second half, and no flux."""

    samples: slice
    resistance: float | None  # [Ohm], (23)
    flux_linkage: Vector | None  # [Wb], (21)
    current: Vector  # [A]
    noise: float  # of it [A]


def doubts(record: Record, estimates: Sequence[Estimate]) -> list[str]:
    """Sentences on the estimators whose outputs cannot be right."""
    if not starts(record):
        return [
            f"{record.name}: the current does not rise above its noise, so no estimate can be judged."
            " Record at least one operation, from rest."
        ]
    told = truth(record)
    if told.resistance is not None and told.resistance <= 0.0:
        return [
            f"{record.name}: voltage and current have opposite signs, so that the resistance would be {_ohm(told)}: no"
            " estimate of it is right. Change the sign of a column."
        ]
    return [text for estimate in estimates if (text := verdict(told, estimate))]


def truth(record: Record) -> Truth:
    """What a record says about the device, whatever its model."""
    found = operations(record) if begins_at_rest(record) else []
    flux: Flux | None = integral(record, found) if found else None
    at = found[-1].inside if found else slice(record.times.size // 2, record.times.size)
    return Truth(
        samples=at,
        resistance=None if flux is None else float(flux.resistances[-1]),
        flux_linkage=None if flux is None else flux.flux_linkage[at],
        current=record.current[at],
        noise=noise_of(record, found[0].start if found else 0),
    )


def verdict(told: Truth, estimate: Estimate) -> str:
    """Sentence on an estimator whose outputs cannot be right, with where and what to do; empty for one that may be."""
    wrong = [*_wrong(told, estimate)]
    return f"{estimate.name}: {'; '.join(wrong)}. {remedy(told, estimate)}" if wrong else ""


def _wrong(told: Truth, estimate: Estimate) -> Iterator[str]:
    at, outputs = told.samples, estimate.outputs
    if told.resistance is not None and "resistance" in outputs:
        found = float(outputs["resistance"][-1])
        if abs(found / told.resistance - 1.0) > FAR["resistance"]:
            yield f"its resistance is {quantity(found, 'Ohm')} at the end, that of the record, (23), {_ohm(told)}"
    if told.flux_linkage is not None and "flux_linkage" in outputs:
        off = rms(outputs["flux_linkage"][at] - told.flux_linkage) / rms(told.flux_linkage)
        if off > FAR["flux linkage"]:
            yield f"its flux linkage is {_percent(off)} off that of the record, (21), in the last operation"
    names = [name for name in ("innovation", "current_error") if estimate.units.get(name) == "A"]
    most = max((rms(outputs[name][at]) for name in names), default=0.0)  # not foretold of the current
    off = float(np.sqrt(max(most**2 - told.noise**2, 0.0))) / max(rms(told.current), 1e-300)
    if off > FAR["current"]:
        yield f"its model leaves {_percent(off)} of the current unexplained in the last operation"
    if "windows" in outputs and told.resistance is not None and float(outputs["windows"][-1]) == 0.0:
        off = rms(outputs["innovation"][at])
        if off > INNOVATION * told.noise:
            yield (
                f"it has not solved one window, so that it has learnt nothing, and its innovation is"
                f" {off / max(told.noise, 1e-300):.2g} times the noise, whatever its `health` says"
            )
    flows = np.abs(told.current) > FLOWS * np.abs(told.current).max()
    if "flux_linkage" not in outputs and float(outputs["health"][at][flows].mean()) < HEALTHY:
        yield "its `health` is 0 most of the time in the last operation"


def remedy(told: Truth, estimate: Estimate) -> str:
    """What to do."""
    if estimate.resistance is None:
        return "Record more operations, or choose an estimator that suits this drive."
    if told.resistance is not None and abs(estimate.resistance / told.resistance - 1.0) > FAR["resistance"]:
        return (
            f"Its `coil.resistance` is {quantity(estimate.resistance, 'Ohm')}, that of the record {_ohm(told)}: it is"
            " another device, or very warm. Give the parameters of this one, from `gapsense identify`."
        )
    return (
        "Its parameters, or the voltage, are not those of this device: identify it with `gapsense identify`, and see"
        " what `gapsense inspect` says of the record."
    )


def _ohm(told: Truth) -> str:
    return quantity(float(told.resistance or 0.0), "Ohm")


def _percent(share: float) -> str:
    return f"{100.0 * share:.2g} %" if share < 0.995 else f"{100.0 * share:.3g} %"


QUANTITIES = {"position": "m", "flux_linkage": "Wb", "resistance": "Ohm", "inductance": "H"}  # of estimators
COLORS = (FIRST, SECOND, THIRD, "#8250df", "#9a6700", "#cf222e")
ASSUMED = "Only assumed in the parameter file: {}. Results that depend on them are as uncertain as they are."
THICKEST = 2.0  # points; thinner and thinner, so that estimates that coincide are all seen
SHOWN = (2.0, 98.0)  # percentiles of the estimates that the axes show at least


def estimate_tables(estimates: Sequence[Estimate]) -> list[Table | str]:
    """Last values of every estimator, whether it trusts them, and the parameters that were set."""
    rows, said = [], []
    for e in estimates:
        last = {q: quantity(float(e.outputs[q][-1]), u) for q, u in QUANTITIES.items() if q in e.outputs}
        rows.append([e.name, *(last.get(q, "") for q in QUANTITIES)])
        given = ", ".join(f"{name} = {value:.6g}" for name, value in e.values.items() if not isinstance(value, str))
        said.append(f"{e.name}: {given}")
        if e.unset:
            starts = list_values(e.unset, BY_NAME, e.unset)
            said.append(f"{e.name}, not given, so the component's own start values are used: {starts}.")
    trusted = [trust(e) for e in estimates if "health_causes" in e.outputs]
    return [table("Estimates at the end of the record", ("estimator", *QUANTITIES), rows), *trusted, *said]


def trust(estimate: Estimate) -> str:
    """In how many samples an estimator trusts itself, and why it does not in the others."""
    is_fine, causes = estimate.outputs["health"] > HEALTHY, estimate.outputs["health_causes"].astype(int)
    shares = {text: float(np.mean(causes & int(bit) > 0)) for bit, text in CAUSES.items()}
    why = ", ".join(f"{text} ({_percent(share)})" for text, share in shares.items() if share)
    said = f"{estimate.name}: `health` is 1 in {_percent(float(is_fine.mean()))} of the samples"
    said = f"{said}; 0 for: {why}." if why else f"{said}."
    if "windows" in estimate.outputs and not estimate.outputs["windows"][-1]:
        said += (
            " No window was solved, so that there are no smoothed values, and `landing_time` and `impact_speed` say"
            " nothing: the record ends too early after its landing, or nothing moved, or the model is another one."
        )
    return said


def repeat_assumed(values: Mapping[str, Value], assumed: Sequence[str]) -> list[str]:
    """What the parameter files mark as assumed, and what that means for the estimates."""
    return [ASSUMED.format(list_values(values, BY_NAME, assumed)), *meanings(assumed)] if assumed else []


def estimate_figure(record: Record, estimates: Sequence[Estimate]) -> Figure:
    """What was measured, then one panel per estimated quantity with all estimators."""
    names = [q for q in QUANTITIES if any(q in e.outputs for e in estimates)]
    label, scale = scale_axis("current", "A", record.current)
    scales = {name: _scale(estimates, name) for name in names}
    figure, axes = stack(record.name, ["voltage / V", label, *(label for label, _ in scales.values())])
    line(axes[0], record.times, record.voltage, TRUE)
    line(axes[1], record.times, scale * record.current, TRUE)
    for axis, name in zip(axes[2:], names):
        _panel(axis, record, estimates, name, scales[name][1])
    return figure


def _scale(estimates: Sequence[Estimate], name: str) -> tuple[str, float]:
    """Label and factor of a quantity, by the values of most of the time."""
    usual = [np.percentile(e.outputs[name], SHOWN) for e in estimates if name in e.outputs]
    label, scale = scale_axis(name.replace("_", " "), QUANTITIES[name], *usual)
    return label.replace(" / ", "\n/ "), scale  # longer than its panel is high


def _panel(axis: Any, record: Record, estimates: Sequence[Estimate], name: str, scale: float) -> None:
    """One quantity; smoothed values at the times that they belong to."""
    drawn = []
    for k, (estimate, color) in enumerate(zip(estimates, COLORS * len(estimates))):
        if name in estimate.outputs:
            drawn.append(scale * estimate.outputs[name])
            line(axis, record.times, drawn[-1], color, estimate.name, linewidth=THICKEST * 0.8**k)
        if f"smoothed_{name}" in estimate.outputs:
            published = estimate.outputs["smoothed_published"] > 0.5  # at the times that these belong to
            at, values = (estimate.outputs[f"smoothed_{signal}"][published] for signal in ("time", name))
            if at.size:
                axis.plot(1e3 * at, scale * values, ".", color=color, markersize=2, label=f"{estimate.name}, smoothed")
    if name == "position" and record.position is not None:
        line(axis, record.times, scale * record.position, TRUE, "recorded", linestyle="--")
    low, high = np.percentile(np.concatenate(drawn), SHOWN)
    margin = 0.25 * (high - low) or abs(high) or 1.0
    axis.set_ylim(low - margin, high + margin)  # a transient at the start must not hide the rest
    legend(axis)
