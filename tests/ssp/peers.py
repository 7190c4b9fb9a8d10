"""Run a package in other tools: `python peers.py TOOL PACKAGE START STEPS OUT` writes the signals as a CSV file.

`libcosim` is a process of its own, since what goes wrong there may end it; `fmpy` is here and elsewhere the same.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np


def in_fmpy(package: Path, start: float, count: int, step: float, repaired: bool = False):
    """Signals after each step; `time` is summed up, so the end is half a step early."""
    from fmpy.ssp import simulation
    from fmpy.ssp.ssd import read_ssv

    plain = simulation.set_value
    if repaired:
        simulation.set_value = with_texts(plain)
    try:
        values = read_ssv(str(package), "resources/parameters.ssv")
        rows = simulation.simulate_ssp(str(package), start, start + (count - 0.5) * step, step, values)
    finally:
        simulation.set_value = plain
    return {name: np.asarray(rows[name], dtype=float) for name in rows.dtype.names}


def with_texts(plain):
    """What docs/ssp.md shows: texts, false, and values of components whose names begin alike."""

    def set_value(component, name, value):
        variable = component.variables.get(name)
        if variable is None:
            return
        if variable.type == "String":
            component.fmu.setString([variable.valueReference], [value])
        else:
            plain(component, name, {"true": 1.0, "false": 0.0}.get(value, value))

    return set_value


def in_libcosim(package: Path, names: list[str], count: int):
    """Real signals after each step."""
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
    from libcosimpy.CosimObserver import CosimObserver

    log_output_level(CosimLogLevel.ERROR)
    execution = CosimExecution.from_ssp_file(str(package))
    parts = dict.fromkeys(name.partition(".")[0] for name in names)
    index = {part: execution.slave_index_from_instance_name(part) for part in parts}
    known = {part: {v.name.decode(): v.reference for v in execution.slave_variables(index[part])} for part in parts}
    references = {name: known[name.partition(".")[0]][name.partition(".")[2]] for name in names}
    observer = CosimObserver.create_last_value()
    execution.add_observer(observer)
    found = {name: np.empty(count) for name in names}
    for k in range(count):
        assert execution.step()
        for name, reference in references.items():
            found[name][k] = observer.last_real_values(index[name.partition(".")[0]], [reference])[0]
    return found


if __name__ == "__main__":
    names = json.loads(sys.argv[2])
    made = in_libcosim(Path(sys.argv[1]), names, int(sys.argv[3]))
    Path(sys.argv[4]).write_text(json.dumps({name: values.tolist() for name, values in made.items()}))
