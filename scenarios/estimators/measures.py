"""All estimators on the same actuator: errors in motion, missed landings, latency and cost, from runs of `estimators`.

Errors count from the second cycle on, so that estimators which learn have learnt.  Estimates that are published later
are held against the truth at the samples that they are about.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from gapsense.cosim import Result
from gapsense.studies import refuse_unrecorded

from ..soft_landing.rts import motions
from .contenders import CONTENDERS, Contender

Vector = npt.NDArray[np.float64]
Index = npt.NDArray[np.intp]
QUANTITIES = ("position", "velocity", "flux_linkage", "resistance")
FAR = 0.1  # of the stroke: an estimate as far from the stop has missed the landing


class Samples(NamedTuple):
    """Rows at which estimates came, and the rows that they are about."""

    came: Index
    about: Index


def signals() -> list[str]:
    """What a run must have recorded."""
    own = [f"{c.source}.{signal}" for c in CONTENDERS for signal in c.signals()]
    return ["actuator.position", "actuator.flux_linkage", "actuator.mode", *own]


def require(recorded: Collection[str], scenario: str) -> None:
    """Refuse a scenario that does not record what the study needs, with all that is missing."""
    refuse_unrecorded(signals(), recorded, scenario, "estimators")


def measure(result: Result) -> dict[str, float]:
    """All numbers of a run, by `component.number`: what a sweep collects."""
    require(result.signals, result.run.scenario)
    return {f"{c.component}.{name}": value for c in CONTENDERS for name, value in numbers(result, c).items()}


def numbers(result: Result, contender: Contender) -> dict[str, float]:
    """The numbers of one estimator in a run; NaN where it does not give the quantity.

    Root mean square errors of position [m] and velocity [m/s] in motion, of flux linkage [Wb] and resistance [ohm]
    always; landings and those that were missed; age of the estimates when they come, and time from a landing until its
    motion is published completely [s]; cost per step [us].
    """
    samples = lined_up(result, contender)
    later = Samples(*(rows[result.times[samples.about] > learnt(result)] for rows in samples))
    moving = Samples(*(rows[is_moving(result)[later.about]] for rows in later))
    errors = {q: rmse(result, contender, q, moving if q in QUANTITIES[:2] else later) for q in QUANTITIES}
    landings, position = judged(result, samples), estimate(result, contender, "position")
    return {
        **errors,
        "landings": float(len(landings)),
        "missed": math.nan if position is None else float(missed(result, position, samples, landings)),
        "latency": median(result.times[samples.came] - result.times[samples.about]),
        "after_landing": after_landing(result.times, samples, motions(result["actuator.mode"])),
        "cost": result.timing[contender.source].microseconds,
    }


def learnt(result: Result) -> float:
    """End of the first cycle [s]; those of the soft landing are as long as those of the profile."""
    return 2.0 * float(result.parameters["drive.profile.half_period"])


def lined_up(result: Result, contender: Contender) -> Samples:
    """Rows at which estimates came and those that they are about; the initial values are no estimates."""
    came = np.flatnonzero(result.stepped(f"{contender.source}.{next(iter(contender.gives.values()))}"))
    if not contender.published:
        return Samples(came, came)
    came = came[result[f"{contender.source}.{contender.published}"][came] > 0.5]
    time = result[f"{contender.source}.{contender.time}"][came]
    about = np.rint((time - result.times[0]) / (result.base_step * result.run.decimation)).astype(np.intp)
    return Samples(came, about)


def is_moving(result: Result) -> npt.NDArray[np.bool_]:
    """Rows at which the mover is on no stop."""
    return np.asarray(result["actuator.mode"] == 2.0)


def estimate(result: Result, contender: Contender, quantity: str) -> Vector | None:
    """Estimates of a quantity as they came, in the direction of the actuator; None if there are none."""
    if quantity not in contender.gives:
        return None
    values = result[f"{contender.source}.{contender.gives[quantity]}"]
    if not contender.is_lift:
        return values
    return float(result.parameters["actuator.stop.upper"]) - values if quantity == "position" else -values


def truth(result: Result, quantity: str) -> Vector:
    """What the estimates of a quantity should be; the velocity is the mean since the sample before, as most give it."""
    if quantity == "resistance":
        return np.full(result.times.size, float(result.parameters["actuator.coil.resistance"]))
    if quantity == "velocity":
        return np.diff(result["actuator.position"], prepend=math.nan) / result.base_step
    return result[f"actuator.{quantity}"]


def rmse(result: Result, contender: Contender, quantity: str, samples: Samples) -> float:
    """Root mean square error over some samples; NaN if there are none."""
    values = estimate(result, contender, quantity)
    if values is None or not samples.came.size:
        return math.nan
    return float(np.sqrt(np.mean((values[samples.came] - truth(result, quantity)[samples.about]) ** 2)))


def rests(result: Result) -> list[int]:
    """Rows half-way through the rests, from the second cycle on, that the mover leaves again."""
    found = motions(result["actuator.mode"])
    between = [(landed, taken_off) for (_, landed), (taken_off, _) in zip(found, found[1:])]
    return [(landed + end) // 2 for landed, end in between if result.times[landed] > learnt(result)]


def judged(result: Result, samples: Samples) -> list[int]:
    """The rests, but for those at the end of the run whose landing is not published yet, though others took as long."""
    longest = float(np.max(result.times[samples.came] - result.times[samples.about], initial=0.0))
    known, end = np.max(samples.about, initial=-1), result.times[-1] - longest
    landed = {row: max(last for _, last in motions(result["actuator.mode"]) if last <= row) for row in rests(result)}
    return [row for row, last in landed.items() if last <= known + 1 or result.times[last] < end]


def missed(result: Result, position: Vector, samples: Samples, at: list[int]) -> int:
    """Landings that an estimate missed: half-way through the rest it is more than a tenth of the stroke from the stop.

    A smoother has no estimates of the rest: its last one of the motion counts then, if it was published.
    """
    low, high = (float(result.parameters[f"actuator.stop.{end}"]) for end in ("lower", "upper"))
    true, lost = result["actuator.position"], 0
    for row in at:
        before = np.flatnonzero(samples.about <= row)
        k = before[np.argmax(samples.about[before])] if before.size else None
        lost += k is None or not abs(position[samples.came[k]] - true[row]) < FAR * (high - low)
    return lost


def after_landing(times: Vector, samples: Samples, found: list[tuple[int, int]]) -> float:
    """Median time from a landing until all of its motion has been estimated, of motions of which it has [s]."""
    waits = []
    for first, landed in found:
        inside = (samples.about >= first) & (samples.about < landed)
        if np.unique(samples.about[inside]).size == landed - first:
            waits.append(max(0.0, float(times[samples.came[inside].max()] - times[landed])))
    return median(waits)


def median(values: Sequence[float] | Vector) -> float:
    """The median, NaN of none."""
    return float(np.median(values)) if len(values) else math.nan
