"""What `Mhe` knows of the valve after commissioning: from voltage and current of one run for each device.

The runs have noise of their own.  `python -m gapsense.scenarios.estimators.commissioned scenarios/estimators` writes
the parameter sets.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from gapsense.cosim import Result, load, run
from gapsense.fmi.components import kernel_parameters, own
from gapsense.identification.actuator.fit import Commissioned, commission
from gapsense.identification.actuator.show import write_actuator
from gapsense.identification.measurements.record import Columns, Record, to_record

from .contenders import COMMISSIONED, MHE
from .core import SEED
from .parameters import DEVICES
from .scenario import set_file

ORIGIN = "python -m gapsense.scenarios.estimators.commissioned"


def write(folder: Path) -> None:
    """Write the parameter sets into the folder of the scenario."""
    for variant in (None, *DEVICES):
        given = load(folder, variant).components[MHE.component].values
        write_actuator(folder / set_file(COMMISSIONED, variant), of_scenario(folder, variant), given, ORIGIN)


def of_scenario(folder: Path, variant: str | None = None) -> Commissioned:
    """Commissioning from a run of the scenario."""
    known = kernel_parameters(own("mhe"), load(folder, variant).components[MHE.component].values)
    return commission([measured(run(folder, variant, seed_shift=SEED))], known)


def measured(result: Result) -> Record:
    """Voltage and current of the sensor."""
    signals = {name: result[f"sensor.{name}_measured"] for name in ("voltage", "current")}
    return to_record(Columns("sensor", np.arange(result.times.size), {"time": result.times, **signals}))


if __name__ == "__main__":
    write(Path(sys.argv[1]))
