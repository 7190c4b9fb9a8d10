"""Temperature coefficient of the resistance, from records at several temperatures.

Each record has a resistance by (23), R = R_20 (1 + alpha (T - 20)), and a temperature.  Its error is what the noise of
both signals leaves in the sums and in the offsets that were subtracted, or the spread over its operations, if that is
larger.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from rich.table import Table

from gapsense.identification.measurements.operations import Flux, trapezoid
from gapsense.identification.measurements.record import Record, Vector
from gapsense.identification.measurements.signals import hidden, noise
from gapsense.report.table import percent, quantity, table

REFERENCE = 20.0  # degC
LEAST = 10.0  # K between the coldest and the hottest record
METALS = (3.6e-3, 4.5e-3)  # 1/K, of the metals of coils: copper, aluminium, silver
SIGMAS = 3.0
EXACT = 1e-5  # relative error of a resistance without any noise: that of the sums
COLDEST, HOTTEST = -60.0, 350.0  # degC that a coil bears


class Value(NamedTuple):
    """A value and its standard error."""

    value: float
    error: float


class Coefficient(NamedTuple):
    """How the resistance changes with the temperature."""

    temperatures: Vector  # of the records [degC]
    resistances: Vector  # [Ohm]
    errors: Vector  # their standard errors [Ohm]
    alpha: Value  # relative to the resistance at the reference temperature [1/K]
    reference: Value  # resistance at the reference temperature [Ohm]

    @property
    def is_usual(self) -> bool:
        """Whether a metal of which coils are wound may have that coefficient."""
        margin = SIGMAS * self.alpha.error
        return METALS[0] - margin <= self.alpha.value <= METALS[1] + margin

    def at(self, temperature: float) -> float:
        """Resistance at a temperature in degC [Ohm]."""
        return self.reference.value * (1.0 + self.alpha.value * (temperature - REFERENCE))

    def temperature(self, resistance: float) -> float:
        """Temperature of a resistance [degC]."""
        return REFERENCE + (resistance / self.reference.value - 1.0) / self.alpha.value


def with_temperatures(text: str | None, records: Sequence[Record]) -> list[Record]:
    """The records, with temperatures of a text if there is one; a ValueError says what is wrong with it."""
    if text is None:
        return list(records)
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        raise ValueError(f"--temperature: `{text}` found, numbers in degC expected, such as 23,60,85.") from None
    if len(values) != len(records):
        raise ValueError(
            f"--temperature: {len(values)} found, {len(records)} expected, one for each record, in their order."
        )
    if wrong := [value for value in values if not COLDEST <= value <= HOTTEST]:
        raise ValueError(f"--temperature: {wrong[0]:g} degC found, {COLDEST:g} to {HOTTEST:g} degC expected.")
    made = [record._replace(temperature=value) for record, value in zip(records, values)]
    if reason := impossible(made):
        raise ValueError(f"--temperature: {reason}")
    return made


def impossible(records: Sequence[Record]) -> str:
    """Why the temperatures of records tell no coefficient, or nothing."""
    known = [record.temperature for record in records if record.temperature is not None]
    if len(known) < len(records):
        without = next(record.name for record in records if record.temperature is None)
        return f"{without} has no temperature. Give that of all records, or of none."
    if len(known) < 2:
        return "one record does not show the temperature coefficient of the resistance. Give two temperatures or more."
    if (span := max(known) - min(known)) < LEAST:
        return (
            f"{span:.3g} K from the coldest to the hottest record are too few for a temperature coefficient of the"
            f" resistance. At least {LEAST:g} K are expected, better 40."
        )
    return ""


def coefficient(records: Sequence[Record], fluxes: Sequence[Flux]) -> Coefficient | None:
    """Weighted regression of the resistances by the temperatures, where these tell it.

    Scatter beyond the errors of the resistances widens those of the result.
    """
    if impossible(records):
        return None
    T = np.array([record.temperature for record in records], dtype=float)
    R, errors = np.array([resistance(record, flux) for record, flux in zip(records, fluxes)]).T
    line, covariance = np.polyfit(T - REFERENCE, R, 1, w=1.0 / errors, cov="unscaled")
    left, (slope, R_20) = (R - np.polyval(line, T - REFERENCE)) / errors, line
    covariance = covariance * max(1.0, float(left @ left) / max(1, T.size - 2))
    by = np.array([1.0, -slope / R_20]) / R_20  # derivatives of alpha
    alpha = Value(float(slope / R_20), float(np.sqrt(by @ covariance @ by)))
    return Coefficient(
        temperatures=T,
        resistances=R,
        errors=errors,
        alpha=alpha,
        reference=Value(float(R_20), float(np.sqrt(covariance[1, 1]))),
    )


def resistance(record: Record, flux: Flux) -> tuple[float, float]:
    """Resistance of all operations of a record, (23), and its standard error [Ohm]."""
    i, inside = trapezoid(record.current), [operation.balanced for operation in flux.operations]
    charges = np.array([i[at].sum() for at in inside])
    charge, n = float(np.abs(charges.sum())), sum(i[at].size for at in inside)
    R = float(flux.resistances @ charges / charges.sum())
    factors = {"voltage": 1.0, "current": R}  # [V]
    noises = [factors[name] * max(noise(x), hidden(x)) for name, x in record.signals.items()]
    offsets = [factors[name] * offset.error for name, offset in record.offsets.items()]
    by_chance = float(np.hypot(np.sqrt(n) * np.linalg.norm(noises), n * np.linalg.norm(offsets)) / charge)
    count = charges.size
    by_spread = float(np.std(flux.resistances, ddof=1) / np.sqrt(count)) if count > 1 else 0.0
    return R, max(by_chance, by_spread, EXACT * R)


def temperature_tables(records: Sequence[Record], resistance: float, found: Coefficient | None) -> list[Table | str]:
    """The resistances and their temperatures, and what follows; nothing where no temperature is known."""
    if all(record.temperature is None for record in records):
        return []
    if found is None:
        return [f"No temperature coefficient of the resistance: {impossible(records)}"]
    told: list[Table | str] = [by_temperature(records, found), *temperature_notes(resistance, found)]
    if found.is_usual:
        return told
    return [
        *told,
        "No metal of which coils are wound has such a temperature coefficient: 0.0039 1/K are usual. The temperatures"
        " may not be those of the coil, which is warmer than its surroundings after some operations, or a resistance"
        " in series, which does not change, is taken for the coil's.",
    ]


def by_temperature(records: Sequence[Record], found: Coefficient) -> Table:
    """Resistance of each record beside the line through them."""
    rows = []
    for record, T, R, error in zip(records, *(x.tolist() for x in found[:3])):
        measured = f"{quantity(R, 'Ohm')} +- {quantity(error, 'Ohm')}"
        rows.append((record.name, f"{T:.4g} degC", measured, percent(R / found.at(T) - 1.0)))
    return table("Resistance by temperature", ("record", "temperature", "resistance", "off the line"), rows)


def temperature_notes(resistance: float, found: Coefficient | None) -> list[str]:
    """Sentences on the coefficient, if there is one; `resistance` is that of the parameter set."""
    if found is None:
        return []
    R, alpha = found.reference, found.alpha
    return [
        f"The resistance is {quantity(R.value, 'Ohm')} +- {quantity(R.error, 'Ohm')} at {REFERENCE:g} degC; its"
        f" temperature coefficient is {alpha.value:.4g} +- {alpha.error:.2g} 1/K.",
        f"`coil.resistance` is the mean of all records, {quantity(resistance, 'Ohm')} at"
        f" {found.temperature(resistance):.3g} degC; no component has a temperature.",
    ]
