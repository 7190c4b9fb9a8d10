"""Whether the model of `Mhe` explains a record, and what the usual cause is where it does not."""

from __future__ import annotations

import numpy as np

from gapsense.identification.actuator.drive import Drive
from gapsense.identification.residual import EXPLAINED, Residual
from gapsense.identification.residual import residual as of_all
from gapsense.identification.valve.model import Trajectory

CAUSES = {
    "edges": "pulses that are shorter than a sampling period, so that samples miss some: record more samples or, with"
    " a filter, the mean voltage",
    "motion": "the mechanics: stops, turns, spring or gap law that are not as given, dry friction, or bounces",
    "hold": "a voltage that is not the coil's (drops of the driver, a supply that sags, PWM sampled in step), or a coil"
    " that gets warm",
    "decay": "a drop in the path of the falling current, or a core that remembers otherwise",
    "rest": "an offset of the current, or flux from an operation before",
}


def residual(drive: Drive, model: Trajectory, model_error: float) -> Residual:
    """What the model leaves of the currents that count; its own error explains as much as `Mhe` takes it to be [A]."""
    counts, current = drive.weights > 0.0, drive.record.current.copy()
    current[drive.first :][~counts] = model.current[~counts]
    found = of_all(drive.record._replace(current=current), model, drive.first)
    floor = found.limit if found.limit > EXPLAINED * found.noise else 0.0  # of the largest current
    return found._replace(
        rms=found.rms * float(np.sqrt(counts.size / max(1, counts.sum()))),
        noise=drive.noise,
        limit=max(EXPLAINED * drive.noise, floor, float(model_error)),
    )
