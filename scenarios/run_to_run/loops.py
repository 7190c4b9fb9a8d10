"""The loop of each law: drive, plant, sensor, estimator and controller as a chain, and their parameters as columns."""

from __future__ import annotations

from collections.abc import Container, Mapping
from functools import cache
from importlib import import_module
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from gapsense.actuators import reluctance_actuator
from gapsense.control import run_to_run
from gapsense.control.records import Parameters
from gapsense.cosim import load
from gapsense.drive import drive_voltage
from gapsense.estimators.mhe import mhe
from gapsense.fmi.components import kernel_parameters, load_component, own
from gapsense.kernels.kernel import Kernel
from gapsense.kernels.layout import names
from gapsense.sensor import sensor
from gapsense.shipped import SCENARIOS

from . import converter, disturbed, given, late
from .actuators import drawn
from .chain import Chain, Part
from .conditions import Condition, Disturbance

SCENARIO = SCENARIOS / "run_to_run"  # what its components are told, the loops are told
RECENT = 0.9  # of a cycle: age of a smoothed sample that the estimator still tells
COMPONENTS = {"plant": "actuator", "law": "controller"}  # parts that the scenario calls otherwise


class Kind(NamedTuple):
    """A law for people, and the kind of its loop: `forward`, `given`, `contact`, `model` or `both`."""

    title: str
    kind: str


COMMAND, VOLTAGE = "command", "voltage"  # what is given at every sample
ENABLE, ADDED = "enable", "added"  # the same where signals are disturbed
AT_REST = {COMMAND: 0.0, VOLTAGE: 0.0, ENABLE: 1.0, ADDED: 0.0}
RECORDED = tuple(f"plant.{name}" for name in ("position", "mode", "current", "impact_speed"))  # and the voltage
OF_LAW = ("law.state", "law.warnings")  # recorded too, where there is a controller
LAWS = {
    "ordinary": Kind("ordinary", "forward"),
    "nominal": Kind("nominal", "forward"),
    "nelder-mead": Kind("Nelder-Mead", "given"),
    "fisher": Kind("Fisher basis", "given"),
    "contact": Kind("RunToRun, contact", "contact"),
    "model": Kind("RunToRun, model", "model"),
    "both": Kind("RunToRun, contact and Mhe", "both"),
}
KERNELS = {  # in the order of their steps
    "drive": drive_voltage,
    "supply": disturbed,
    "plant": reluctance_actuator,  # or that of the condition
    "converter": converter,
    "sensor": sensor,
    "reading": disturbed,
    "mhe": mhe,
    "late": late,
    "law": run_to_run,
}
FINE = ("drive", "supply", "plant", "converter")
ABSENT = {"forward": ("mhe", "late", "law"), "given": ("mhe",), "contact": ("mhe",), "model": ("late",), "both": ()}
BETWEEN = {  # what signals go through on their way to the parts behind it, by the input and output of this
    "supply": {"voltage": "drive.voltage_mean"},
    "converter": {"voltage": "drive.voltage_mean", "current": "plant.current"},
    "reading": {"voltage": "drive.voltage_mean", "current": "sensor.current_measured"},
    "late": {"mode": "sensor.mode_measured"},
}

CONSTANT: dict[str, dict[str, str | float]] = {"reading": {"added": ADDED}, "law": {"enable": 1.0}}


class Loop(NamedTuple):
    """The chain of a law under a condition, and its flat parameters by `part.parameter`, columns (1, runs) or lists."""

    chain: Chain
    par: dict[str, Any]


def loop_of(law: str, condition: Condition, seed: int, runs: range) -> Loop:
    """The loop of a law, for some of the actuators of a seed."""
    kind = LAWS[law].kind
    made = chain_of(kind, condition)
    columns = {
        f"{part.name}.{name}": _column(value)
        for part in made.parts
        for name, value in _parameters(part.name, kind, condition, seed, runs).items()
    }
    return Loop(made, columns)


def _column(value: Any) -> Any:
    return value if isinstance(value, list) else np.atleast_2d(np.asarray(value, float))


def chain_of(kind: str, condition: Condition) -> Chain:
    """The chain of a kind of law under a condition."""
    return made_chain(kind, condition.plant, condition.fine, condition.disturbance is not None)


@cache
def made_chain(kind: str, plant: str, fine: int, is_disturbed: bool) -> Chain:
    """The wires of the scenario, between its components and what is between these."""
    absent = {*ABSENT[kind], *(() if is_disturbed else ("supply", "reading")), *(() if fine > 1 else ("converter",))}
    modules = {**KERNELS, "plant": import_module(f"gapsense.actuators.{plant}")}
    modules |= {"law": given} if kind == "given" else {}
    reference: dict[str, str | float] = {"reference": VOLTAGE} if kind == "forward" else {}
    constant = {"drive": {**reference, "enable": ENABLE if is_disturbed else 1.0}, **CONSTANT}
    by, parts = {"command.voltage": COMMAND}, dict[str, Part]()
    for name, module in ((name, module) for name, module in modules.items() if name not in absent):
        sources = BETWEEN.get(name) or wires(name, absent)
        heard = {target: by.get(source, source) for target, source in sources.items()}
        parts[name] = Part(name, Kernel(module), {**heard, **constant.get(name, {})}, name in FINE)
        by |= {source: f"{name}.{signal}" for signal, source in sources.items() if name in BETWEEN}
    recorded = (*RECORDED, str(parts["sensor"].wires["voltage"]), *(() if kind == "forward" else OF_LAW))
    return Chain([*parts.values()], recorded, tuple(AT_REST) if is_disturbed else (COMMAND, VOLTAGE), fine)


def wires(part: str, absent: Container[str]) -> dict[str, str]:
    """Sources of the inputs of a component of the scenario, without those that are absent; none has a contact then."""
    parts = {component: name for name, component in COMPONENTS.items()}
    found = {
        c.target.variable: f"{parts.get(c.source.component, c.source.component)}.{c.source.variable}"
        for c in load(SCENARIO).connections
        if c.target.component == COMPONENTS.get(part, part)
    }
    if part == "law" and "late" in absent:
        del found["mode"]
    return {target: source for target, source in found.items() if source.partition(".")[0] not in absent}


def controller(condition: Condition) -> Parameters:
    """What a controller is told under a condition."""
    par = _told("law", "contact", condition)
    return Parameters(**{name: condition.changes.get(name, value) for name, value in par.items()})


def _parameters(part: str, kind: str, condition: Condition, seed: int, runs: range) -> dict[str, Any]:
    """Flat parameters of a part."""
    if part == "plant":
        par = drawn(condition.plant, seed, runs, condition.width, condition.drawn)
    else:
        par = _told(part, kind, condition)
    par |= {"seed": 1000.0 * seed + np.array(runs)} if part == "sensor" else {}
    changes = condition.changes
    return {name: changes.get(f"{part}.{name}", changes.get(name, value)) for name, value in par.items()}


def _told(part: str, kind: str, condition: Condition) -> dict[str, Any]:
    """Flat parameters of a part that all actuators share, by the scenario and by the condition."""
    error, dt = condition.disturbance or Disturbance(), condition.sample_time
    between: dict[str, dict[str, Any]] = {
        "supply": {"gain": 1.0, "offset": 0.0},
        "converter": {"parts": condition.fine},
        "reading": {"gain": error.gain, "offset": error.offset},
        "late": {"samples": round(condition.late / dt)},
    }
    if part in between:
        return between[part]
    is_other = condition.plant == "play_actuator"
    variants = {"law": "model" if kind == "model" else None, "mhe": "play" if is_other else None}
    par = {**stated(COMPONENTS.get(part, part), variants.get(part))}
    if part == "mhe":
        par |= {name: condition.prior * value for name, value in par.items() if name.startswith("prior_")}
        par |= {"publish_within": RECENT * condition.period}
    if part == "law" and kind == "given":  # what is given comes before each cycle
        par |= dict.fromkeys(names(given.Parameters)[len(par) :], 0.0)
    return {**par, "sample_time": dt} if "sample_time" in par else par


@cache
def stated(component: str, variant: str | None = None) -> Mapping[str, Any]:
    """Flat parameters of a component of the scenario; its sets, which several share, have more."""
    found = load(SCENARIO, variant).components[component]
    ports = {port.name for port in load_component(own(found.fmu)).of("parameter")}
    par = kernel_parameters(own(found.fmu), {name: value for name, value in found.values.items() if name in ports})
    return MappingProxyType(par._asdict())
