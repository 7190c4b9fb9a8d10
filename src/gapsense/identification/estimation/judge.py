"""Whether what an estimator says can be right: its last operation against what the record itself tells.

Resistance and flux linkage of an operation follow from voltage and current alone, (23) and (21), and an estimator that
has the device's parameters predicts the current.  Its own `health` knows neither: a filter that takes a wrong model for
an error of the current is content, and one that is sure of a sound model doubts each edge of the voltage.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from gapsense.identification.estimation.run import Estimate
from gapsense.identification.measurements.flux import Flux
from gapsense.identification.measurements.flux import estimate as integral
from gapsense.identification.measurements.operations import operations
from gapsense.identification.measurements.record import Record, Vector
from gapsense.identification.measurements.refusals import begins_at_rest
from gapsense.identification.residual import noise_of
from gapsense.report.table import quantity

FAR = {
    "resistance": 0.1,
    "flux linkage": 0.15,
    "current": 0.2,
}  # relative to what the record tells, RMS; a warm coil has 0.1
FLOWS = 0.1  # of the largest current: less is none
HEALTHY = 0.5  # part of the samples


class Truth(NamedTuple):
    """What the last complete operation of a record from rest on tells; without one its second half, and no flux."""

    samples: slice
    resistance: float | None  # [Ohm], (23)
    flux_linkage: Vector | None  # [Wb], (21)
    current: Vector  # [A]
    noise: float  # of it [A]


def doubts(record: Record, estimates: Sequence[Estimate]) -> list[str]:
    """Sentences on the estimators whose outputs cannot be right."""
    told = truth(record)
    if told.resistance is not None and told.resistance <= 0.0:
        return [
            f"{record.name}: voltage and current have opposite signs, so that the resistance would be {_ohm(told)}: no"
            " estimate of it is right. Change the sign of a column."
        ]
    return [text for estimate in estimates if (text := verdict(told, estimate))]


def truth(record: Record) -> Truth:
    """What a record tells of the device whatever its model."""
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
    off = unexplained(told, estimate)
    if off > FAR["current"]:
        yield f"its model leaves {_percent(off)} of the current unexplained in the last operation"
    if "flux_linkage" not in outputs and _healthy(told, estimate) < HEALTHY:
        yield "its `health` is 0 most of the time in the last operation"


def unexplained(told: Truth, estimate: Estimate) -> float:
    """RMS of what the model does not predict of the current, beyond noise, relative to the current."""
    names = [name for name in ("innovation", "current_error") if estimate.units.get(name) == "A"]
    most = max((rms(estimate.outputs[name][told.samples]) for name in names), default=0.0)
    return float(np.sqrt(max(most**2 - told.noise**2, 0.0))) / max(rms(told.current), 1e-300)


def _healthy(told: Truth, estimate: Estimate) -> float:
    """Part of the samples with current in which an estimator trusts itself."""
    flows = np.abs(told.current) > FLOWS * np.abs(told.current).max()
    return float(estimate.outputs["health"][told.samples][flows].mean())


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


def rms(x: Vector) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(x**2)))


def _ohm(told: Truth) -> str:
    return quantity(float(told.resistance or 0.0), "Ohm")


def _percent(share: float) -> str:
    return f"{100.0 * share:.2g} %" if share < 0.995 else f"{100.0 * share:.3g} %"
