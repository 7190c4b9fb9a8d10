"""Faults, devices and the course of the study of `Monitor`: tables that are laid over its scenario, values of runs."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from gapsense.cosim.scenario.read import Document
from gapsense.studies.devices import RTS_VALVE as VALVE
from gapsense.studies.runs import Values, overlaid

SCENARIO = Path(__file__).with_name("scenario.toml")
START, STEP, OPERATION = -1.01e-3, 20e-6, 10e-3  # of the scenario; duration of an operation [s]
CYCLE = 2  # operations; the resistance changes after each
BEFORE = 0.15e-3  # time before an operation at which a fault begins or ends, the mover being at rest [s]
WARMING, TIME = 0.15, 1.0  # share by which operations without a rest warm the coil, and its time constant [s]
NOISES = (0.5e-3, 10e-3)  # of the current, least and most [A]
WIDTHS = (0.05, 0.1)  # of the devices, in turn
SHORTED, STROKE = 0.05, VALVE.stop_upper - VALVE.stop_lower
SPREAD = ("coil.resistance", "core.eddy_conductance", "core.pinning", "gap.slope", "mover.mass", "spring.stiffness")


class Case(NamedTuple):
    """A fault: the causes that are right, what it does to which target, and whether it begins with an opening."""

    causes: tuple[str, ...]
    actions: Mapping[str, tuple[str, float]]
    is_closed: bool = False


def _shorted(share: float) -> dict[str, tuple[str, float]]:
    """Fewer turns, and a ring of the others."""
    ring = share * VALVE.coil_turns**2 / VALVE.coil_resistance
    turns, resistance = (f"actuator.coil.{name}" for name in ("turns", "resistance"))
    return {
        turns: ("scale", 1.0 - share),
        resistance: ("scale", 1.0 - share),
        "actuator.core.eddy_conductance": ("bias", ring),
    }


LOWER, UPPER, SPRING = "actuator.stop.lower", "actuator.stop.upper", "actuator.spring.stiffness"
CASES = {
    "stuck at the upper stop": Case(("stuck_upper",), {LOWER: ("set", VALVE.stop_upper - 1e-7)}),
    "stuck at the lower stop": Case(("stuck_lower",), {UPPER: ("set", VALVE.stop_lower + 1e-7)}, is_closed=True),
    "lower stop 30 % higher": Case(("lower_stop",), {LOWER: ("set", VALVE.stop_lower + 0.3 * STROKE)}),
    "upper stop 30 % lower": Case(("upper_stop",), {UPPER: ("set", VALVE.stop_upper - 0.3 * STROKE)}, is_closed=True),
    "spring broken": Case(("spring",), {SPRING: ("scale", 0.02)}),
    "spring 40 % weaker": Case(("spring",), {SPRING: ("scale", 0.6)}),
    "5 % of the turns shorted": Case(("turns",), _shorted(SHORTED)),
    "5 Ohm more": Case(("contact",), {"actuator.coil.resistance": ("bias", 5.0)}),
    "supply 20 % lower, unmeasured": Case(("supply",), {"actuator.voltage": ("scale", 0.8)}),
    "circuit open": Case(("open",), {"actuator.coil.resistance": ("set", 100e3)}),
    "current sensor 10 % low": Case(("gain",), {"sensor.current_measured": ("scale", 0.9)}),
    "friction 0.3 N": Case(("friction",), {"actuator.friction": ("set", 0.3)}),
    "mass 20 % higher": Case(("friction",), {"actuator.mover.mass": ("scale", 1.2)}),
    "damping x5": Case(("friction",), {"actuator.damping": ("scale", 5.0)}),
}
DEMANDED = 9  # the first ones
HEALTHY = Case((), {})


class Course(NamedTuple):
    """Operations of a run: rests [s] before some of them, spans with the fault, and how many there are."""

    rests: Mapping[int, float]
    spans: tuple[tuple[int, int], ...]
    operations: int

    def time(self, operation: int) -> float:
        """Begin of an operation [s]."""
        return operation * OPERATION + sum(rest for before, rest in self.rests.items() if before <= operation)


COURSE = Course(rests={60: 0.2, 100: 0.3, 150: 0.2}, spans=((80, 90), (110, 210)), operations=230)

LONG = Course(rests={60: 0.2, 200: 0.5, 330: 0.1, 470: 1.0, 640: 0.3, 800: 0.2}, spans=(), operations=880)


def on_grid(time: float) -> float:
    """The nearest base step [s]."""
    return round(START + round((time - START) / STEP) * STEP, 9)


def temperature(course: Course) -> dict[str, Any]:
    """Events that make the resistance follow a coil that warms in operations and cools in rests."""
    events, warm = {}, 0.0
    for k in range(0, course.operations, CYCLE):
        warm *= math.exp(-course.rests.get(k, 0.0) / TIME)
        begin = on_grid(course.time(k) - BEFORE) if k else START
        end = on_grid(course.time(k + CYCLE) - course.rests.get(k + CYCLE, 0.0) - BEFORE)
        events[f"warm_{k}"] = {
            "target": "actuator.coil.resistance",
            "action": "scale",
            "value": 1.0 + WARMING * warm,
            "at": begin,
            "until": min(end, on_grid(course.time(course.operations))),
        }
        warm += (1.0 - warm) * CYCLE * OPERATION / TIME
    return events


def switched(course: Course) -> dict[str, Any]:
    """The drive is off in rests."""
    times, values = [START], [1.0]
    for k, rest in sorted(course.rests.items()):
        times += [course.time(k) - rest - 1e-3, course.time(k) - 1e-3]
        values += [0.0, 1.0]
    return {"times": [*times, course.time(course.operations) + 1.0], "values": [*values, 1.0], "interpolation": "hold"}


def document(case: Case, names: Sequence[str], course: Course, decimation: int = 5) -> Document:
    """The scenario with a fault, in the course of a run."""
    faults = {
        f"fault_{n}_{k}": {"target": target, "action": action, "value": value, "at": begin, "until": end}
        for n, (begin, end) in enumerate(times(case, course))
        for k, (target, (action, value)) in enumerate(case.actions.items())
    }
    tables = {
        "experiment": {"stop": on_grid(course.time(course.operations))},
        "components": {"monitor": {"set": {"learn.windows": 60.0}}},
        "events": {"contact": {"enabled": False}, **temperature(course), **faults},
        "inputs": {"drive.enable": switched(course)},
        "record": {"signals": ["monitor.*"], "decimation": decimation},
        "page": {"first": []},  # which names other signals
    }
    return overlaid(SCENARIO, tables)


def times(case: Case, course: Course) -> list[tuple[float, float]]:
    """Begin and end of each span with the fault [s]."""
    shift = 1 if case.is_closed else 0
    return [tuple(on_grid(course.time(k + shift) - BEFORE) for k in span) for span in course.spans]  # type: ignore[misc]


def devices(count: int, seed: int) -> list[Values]:
    """Devices drawn evenly within `WIDTHS` in turn, with even logarithms of the noise, which `Mhe` is told."""
    rng = np.random.default_rng(seed)
    found: list[Values] = []
    for k in range(count):
        width = WIDTHS[k % len(WIDTHS)]
        factors = 1.0 + rng.uniform(-width, width, len(SPREAD) + 2)
        values = {name: getattr(VALVE, name.replace(".", "_")) for name in SPREAD}
        own = {name: value * factor for (name, value), factor in zip(values.items(), factors.tolist())}
        core = float(factors[-1])  # of both, so that the curve of the core stays as steep
        own |= {"core.magnetization": core * VALVE.core_magnetization, "core.shape": core * VALVE.core_shape}
        own["damping"] = float(factors[-2]) * VALVE.damping
        noise = float(np.exp(rng.uniform(*np.log(NOISES))))
        noises = {"sensor.noise.current": noise, "mhe.noise.current": noise}
        found.append({**{f"actuator.{name}": value for name, value in own.items()}, **noises})
    return found
