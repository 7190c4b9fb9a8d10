"""Records to run components on: the inputs that they have in an example scenario."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from host import ROOT

from gapsense import cosim
from gapsense.cosim.scenario.records import Record
from gapsense.fmi.components import find_components, kernel_of, load_component


class Given(NamedTuple):
    """What a component gets in a scenario."""

    folder: Path
    values: Mapping[str, Any]  # of parameters
    rows: list[list[float]]  # inputs of the kernel at its samples


@cache
def in_scenario(scenario: str, name: str, most: int = 2000, variant: str | None = None) -> Given:
    """What the component `name` gets, rounded to float, at no more than so many samples."""
    read, descriptions = cosim.prepare(ROOT / "scenarios" / scenario, variant)
    part, base = read.components[name], read.experiment.base_step
    count = min(read.experiment.count, most * part.step + part.offset)
    read = replace(
        read, experiment=replace(read.experiment, stop=read.experiment.start + count * base, count=count), events={}
    )
    folder = next(f for f in find_components(ROOT / "fmus") if load_component(f).name == part.fmu)
    ports = {port.field: port.name for port in load_component(folder).of("input")}
    record = Record(tuple(f"{name}.{port}" for port in ports.values()), 1)
    with cosim.Master(replace(read, record=record, metrics=()), descriptions) as master:
        result = cosim.run_once(master)
    step = part.step * base
    clock = {"time": result.times, "dt": np.full(len(result.times), step)}
    fields = kernel_of(load_component(folder)).module.Inputs._fields
    columns = [clock[f] if f in clock else result[f"{name}.{ports[f]}"] for f in fields]
    rows = np.array(columns).T[part.offset :: part.step][:most]
    return Given(folder, part.values, rows.astype(np.float32).astype(float).tolist())
