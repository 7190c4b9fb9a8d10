"""The experiment of [RTS] Section IV-F in simulation: errors of four estimators over many voltage profiles.

Of every motion that lands the EKF's estimates and the smoothed ones are held against the plant's position, sample by
sample, and against its velocity since the sample before, which is what a position sensor gives.  Both are normalised.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from gapsense.cosim import Result
from gapsense.estimators.ekf import Parameters
from gapsense.fmi.components import kernel_parameters, own

from ..soft_landing.rts import Estimates, Floats, motions, smooth_record

FILTER, SMOOTHERS = "EKF", {"ERTSS": "ertss", "ERTSS\\e_i": "no_current_error", "ERTSS\\e_F": "no_force_error"}
ESTIMATORS = (FILTER, *SMOOTHERS)
OPERATIONS = ("making", "breaking")
SIGNALS = (
    *(f"sensor.{signal}_measured" for signal in ("voltage", "current", "mode")),
    *("actuator.position", "ekf.position", "ekf.velocity"),
    *(f"{name}.smoothed_{s}" for name in SMOOTHERS.values() for s in ("published", "time", "position")),
)
HALF = 20e-3  # the making has the first half of the cycle, the breaking the second [s]


class Motion(NamedTuple):
    """Samples `first` to `landed - 1` are in motion."""

    first: int
    landed: int
    operation: str
    returns: bool  # to the stop that it left
    published: bool  # completely, by the smoother of the co-simulation


class Curve(NamedTuple):
    """Normalised position [1] and velocity [1/s] at every sample; NaN where there is no estimate."""

    position: Floats
    velocity: Floats


class Profile(NamedTuple):
    """One run, with all estimates at the samples that they are about."""

    time: Floats
    mode: Floats
    true: Curve
    estimates: dict[str, Curve]
    motions: list[Motion]
    difference: float  # largest between what the smoothers published and the same computed from the record


class Errors(NamedTuple):
    """Absolute errors of all samples in motion, by estimator and operation."""

    position: dict[tuple[str, str], Floats]
    velocity: dict[tuple[str, str], Floats]


def line_up(result: Result) -> Profile:
    """Put the estimates of a run at the samples that they are about.

    The smoothers of a co-simulation publish a motion late, sample by sample, and the last one not before the run ends.
    So all motions are smoothed from the recorded measurements, by the same algorithm with the parameters of the FMUs,
    and held against what was published.
    """
    low, high = (float(result.parameters[f"actuator.stop.{end}"]) for end in ("lower", "upper"))

    def curve(position: Floats, velocity: Floats) -> Curve:
        return Curve((position - low) / (high - low), velocity / (high - low))

    position, mode = result["actuator.position"], result["sensor.mode_measured"]
    velocity = np.diff(position, prepend=position[0]) / result.base_step
    estimates = {FILTER: curve(result["ekf.position"], result["ekf.velocity"])}
    published, difference = np.ones(mode.size, dtype=bool), 0.0
    for label, name in SMOOTHERS.items():
        smoothed = from_record(result, name)
        seen, worst = compared(result, name, smoothed)
        published &= seen
        difference = max(difference, worst / (high - low))
        estimates[label] = curve(smoothed.position, smoothed.velocity)
    found = [
        Motion(
            first=a,
            landed=b,
            operation=OPERATIONS[int(result.times[a] > HALF)],
            returns=mode[a - 1] == mode[b],
            published=bool(published[a:b].all()),
        )
        for a, b in motions(mode, float(result.parameters["ertss.contact.debounce"]) / result.base_step)
    ]
    return Profile(
        time=result.times,
        mode=mode,
        true=curve(position, velocity),
        estimates=estimates,
        motions=found,
        difference=difference,
    )


def from_record(result: Result, name: str) -> Estimates:
    """Smoothed estimates from the recorded measurements, with the parameters of a component."""
    start = f"{name}."
    known = {key[len(start) :].replace(".", "_"): v for key, v in result.parameters.items() if key.startswith(start)}
    if known["gap_law"] != "fringing":
        raise ValueError(f"`{name}.gap.law` is `{known['gap_law']}`; this study needs the law `fringing`. Change it.")
    ekf: Parameters = kernel_parameters(own("ekf"), {})
    numbers = {field: float(value) for field, value in known.items() if field in ekf._fields and field != "gap_law"}
    voltage, current, mode = (result[f"sensor.{signal}_measured"] for signal in ("voltage", "current", "mode"))
    return smooth_record(voltage, current, mode, ekf._replace(**numbers), float(known["contact_debounce"])).smoothed


def compared(result: Result, name: str, smoothed: Estimates) -> tuple[npt.NDArray[np.bool_], float]:
    """Which samples a smoother published, and how far they are from these at most [m]."""
    rows = result[f"{name}.smoothed_published"] > 0.5
    samples = np.rint(result[f"{name}.smoothed_time"][rows] / result.base_step).astype(np.intp)
    seen = np.zeros(rows.size, dtype=bool)
    seen[samples] = True
    difference = np.abs(result[f"{name}.smoothed_position"][rows] - smoothed.position[samples])
    return seen, float(np.max(difference, initial=0.0))


def errors(profiles: Sequence[Profile]) -> Errors:
    """Absolute errors over all samples in motion of all profiles."""
    found = Errors({}, {})
    for (k, of_quantity), estimator, operation in product(enumerate(found), ESTIMATORS, OPERATIONS):
        parts = [
            np.abs(profile.estimates[estimator][k] - profile.true[k])[m.first : m.landed]
            for profile in profiles
            for m in moved(profile, operation)
        ]
        of_quantity[estimator, operation] = np.concatenate([*parts, np.zeros(0)])
    return found


def moved(profile: Profile, operation: str) -> list[Motion]:
    """The motions of one operation."""
    return [m for m in profile.motions if m.operation == operation]
