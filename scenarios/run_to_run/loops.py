"""The loop of each law: drive, plant, sensor, estimator and controller as a chain, and their parameters as columns."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from importlib import import_module
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

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
from .conditions import Condition, Disturbance, piece

SCENARIO = SCENARIOS / "run_to_run"  # what its components are told, the loops are told
RECENT = 0.9  # of a cycle: age of a smoothed sample that the estimator still tells
ESTIMATING = ("model", "both")  # kinds with `Mhe`


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
ESTIMATED = {  # inputs of the controller that `Mhe` feeds
    c.target.variable: str(c.source)
    for c in load(SCENARIO).connections
    if (c.source.component, c.target.component) == ("mhe", "controller")
}


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


def controller(condition: Condition) -> Parameters:
    """What a controller is told under a condition."""
    par = _law(condition, "contact")
    return Parameters(**{name: condition.changes.get(name, value) for name, value in par.items()})


def _column(value: Any) -> Any:
    return value if isinstance(value, list) else np.atleast_2d(np.asarray(value, float))


def chain_of(kind: str, condition: Condition) -> Chain:
    """The chain of a kind of law under a condition."""
    return made_chain(kind, condition.plant, piece(condition), condition.fine, condition.disturbance is not None)


@cache
def made_chain(kind: str, plant: str, count: int, fine: int, is_disturbed: bool) -> Chain:
    """Parts in their order; an estimator is there for some laws only, a converter if samples have parts."""
    reference = VOLTAGE if kind == "forward" else "law.voltage_reference"
    actuator, drive = Kernel(import_module(f"gapsense.actuators.{plant}")), "drive.voltage_mean"
    supplied = "supply.voltage" if is_disturbed else drive
    volts, amperes = ("converter.voltage", "converter.current") if fine > 1 else (supplied, "plant.current")
    seen = {"voltage": volts, "current": amperes, "position": "plant.position", "mode": "plant.mode"}
    heard = {"voltage": supplied, "current": "plant.current"}
    told = {"voltage": volts, "current": "sensor.current_measured"}
    parts = [
        Part("drive", Kernel(drive_voltage), {"enable": ENABLE if is_disturbed else 1.0, "reference": reference}, True)
    ]
    parts += [Part("supply", Kernel(disturbed), {"voltage": drive}, True)] if is_disturbed else []
    parts += [Part("plant", actuator, {"voltage": supplied}, True)]
    parts += [Part("converter", Kernel(converter), heard, True)] if fine > 1 else []
    parts += [Part("sensor", Kernel(sensor), seen)]
    parts += [Part("reading", Kernel(disturbed), {**told, "added": ADDED})] if is_disturbed else []
    read = {name: f"reading.{name}" for name in told} if is_disturbed else told
    parts += [] if kind == "forward" else _controlling(kind, {**read, "command": COMMAND})
    recorded = (*RECORDED, volts, *(() if kind == "forward" else OF_LAW))
    return Chain(parts, recorded, tuple(AT_REST) if is_disturbed else (COMMAND, VOLTAGE), count, fine)


def _controlling(kind: str, seen: Mapping[str, str]) -> list[Part]:
    estimator = [Part("mhe", Kernel(mhe), seen)] if kind in ESTIMATING else []
    contact = [] if kind == "model" else [Part("late", Kernel(late), {"mode": "sensor.mode_measured"})]
    kernel = Kernel(given if kind == "given" else run_to_run)
    wires = {**seen, **(ESTIMATED if estimator else {}), **({"mode": "late.mode"} if contact else {})}
    return [*estimator, *contact, Part("law", kernel, {"enable": 1.0, **wires})]


def _parameters(part: str, kind: str, condition: Condition, seed: int, runs: range) -> dict[str, Any]:
    """Flat parameters of a part."""
    if part == "plant":
        par = drawn(condition.plant, seed, runs, condition.width, condition.drawn)
    elif part == "law":
        par = _law(condition, kind)
    else:
        par = PARAMETERS[part](condition)
    par |= {"seed": 1000.0 * seed + np.array(runs)} if part == "sensor" else {}
    changes = condition.changes
    own_changes = {name: changes[f"{part}.{name}"] for name in par if f"{part}.{name}" in changes}
    return {**par, **{name: value for name, value in changes.items() if name in par}, **own_changes}


@cache
def stated(component: str, fmu: str, variant: str | None = None) -> Mapping[str, Any]:
    """Flat parameters of a component of the scenario; its sets, which several share, have more."""
    folder, values = own(fmu), load(SCENARIO, variant).components[component].values
    ports = {port.name for port in load_component(folder).of("parameter")}
    par = kernel_parameters(folder, {name: value for name, value in values.items() if name in ports})
    return MappingProxyType(par._asdict())


def _sensor(condition: Condition) -> dict[str, Any]:
    return {**stated("sensor", "sensor"), "sample_time": condition.sample_time}


def _reading(condition: Condition) -> dict[str, Any]:
    error = condition.disturbance or Disturbance()
    return {"gain": error.gain, "offset": error.offset}


def _late(condition: Condition) -> dict[str, Any]:
    return {"samples": round(condition.late / condition.sample_time)}


def _estimator(condition: Condition) -> dict[str, Any]:
    par = stated("mhe", "mhe", "play" if condition.plant == "play_actuator" else None)
    wider = {name: condition.prior * value for name, value in par.items() if name.startswith("prior_")}
    return {**par, **wider, "sample_time": condition.sample_time, "publish_within": RECENT * condition.period}


def _law(condition: Condition, kind: str) -> dict[str, Any]:
    """Nothing but nominal numbers; a law that is given from outside gets it before each cycle."""
    par = stated("controller", "run_to_run", "model" if kind == "model" else None)
    outside = names(given.Parameters)[len(par) :] if kind == "given" else ()
    return {**par, "sample_time": condition.sample_time, **dict.fromkeys(outside, 0.0)}


PARAMETERS: dict[str, Callable[[Condition], dict[str, Any]]] = {
    "drive": lambda _: {**stated("drive", "drive_voltage")},
    "converter": lambda condition: {"parts": condition.fine},
    "supply": lambda _: {"gain": 1.0, "offset": 0.0},
    "sensor": _sensor,
    "reading": _reading,
    "late": _late,
    "mhe": _estimator,
}
