"""What an FMU must refuse, from its port table: by name a case for `drivers.refusals` and words of the answer."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from drivers import communication_step

from gapsense.fmi.ports import Component, Port

Case = tuple[dict[str, Any], list[str]]
KINDS = ("Real", "Integer", "Boolean", "String")
PLACE = ["t = ", "step = "]
MISSING = "für/100 %s %n.csv"
DISORDERED = Path(__file__).with_name("disordered.csv")


def refusals(component: Component) -> dict[str, Case]:
    """Cases by name."""
    cases: dict[str, Case] = {}
    for make in (_inputs, _parameters, _references, _settings, _steps, _samples):
        cases.update(make(component))
    return cases


def _inputs(component: Component) -> Iterator[tuple[str, Case]]:
    h = communication_step(component.step_size, component.stop_time)
    for port in () if component.survives else component.of("input"):
        for value in (math.nan, math.inf, -math.inf):
            words = [f"input `{port.name}` is not finite", *PLACE]
            yield f"{port.name} is {value}", ({"inputs": {port.name: value}, "step": (h, h)}, words)


def _parameters(component: Component) -> Iterator[tuple[str, Case]]:
    def at_start(**parameters: Any) -> dict[str, Any]:
        return {"parameters": parameters}

    parameters = component.of("parameter")
    wrong = {p.name: _wrong(p) for p in parameters if p.kind in ("Real", "Integer") or p.choices}
    if wrong:
        yield "all parameters out of range at once", (at_start(**wrong), [f"`{name}` is " for name in wrong])
    for port in parameters:
        if port.choices:
            words = [f"`{port.name}` is `%s für`", *port.choices]
            yield f"{port.name} is no choice", (at_start(**{port.name: "%s für"}), words)
        if port.columns:
            yield f"{port.name} is missing", (at_start(**{port.name: MISSING}), [f"`{port.name}`", MISSING])
            words = [f"`{port.name}`", DISORDERED.name, "row 3", "is `nan`", "row 5", "decreases from 2 to 1"]
            yield f"{port.name} is disordered", (at_start(**{port.name: str(DISORDERED)}), words)
    starts = {p.name: p.start for p in parameters}
    for low, high in component.rising:
        equal = {low: starts[high], high: starts[high]}
        yield f"{low} is not below {high}", (at_start(**equal), [f"`{low}` is", f"less than `{high}`"])
    for limit in component.limits:
        given = {p.name: p.start or p.nominal for p in parameters if p.name in dict(limit.powers)}
        product = math.prod(given[name] ** power for name, power in limit.powers)
        name, power = limit.powers[-1]
        at_limit = {**given, name: given[name] * (1.000001 * limit.below / product) ** (1 / power)}
        yield f"{limit.text()} is at its limit", (at_start(**at_limit), [limit.text(), limit.reason])


def _wrong(port: Port) -> Any:
    if port.choices:
        return "nonsense"
    return math.nan if port.min is None and port.max is None else port.max + 1 if port.min is None else port.min - 1


def _references(component: Component) -> Iterator[tuple[str, Case]]:
    value = {"Real": 0.0, "Integer": 0, "Boolean": False, "String": "0"}
    for kind in KINDS:
        for other in [k for k, p in enumerate(component.ports) if p.kind != kind][:1]:
            words = [f"no {kind} variable with value reference {other}"]
            yield f"get {kind} of another type", ({"call": [f"get{kind}", [other]]}, words)
            yield f"set {kind} of another type", ({"call": [f"set{kind}", [other], [value[kind]]]}, words)
        yield f"get unknown {kind}", ({"call": [f"get{kind}", [9999]]}, ["value reference 9999"])
        yield f"set unknown {kind}", ({"call": [f"set{kind}", [9999], [value[kind]]]}, ["value reference 9999"])
    yield "set the largest reference", ({"call": ["setReal", [2**32 - 1], [0.0]]}, ["value reference"])


def _settings(component: Component) -> Iterator[tuple[str, Case]]:
    first = len(component.of("input"))
    name = component.ports[first].name
    yield "set an output", ({"call": ["setReal", [first], [0.0]]}, [f"`{name}` is an output"])
    for k, port in enumerate(component.ports):
        if port.causality == "parameter" and port.variability == "fixed":
            words = [f"`{port.name}` is fixed", "reset"]
            yield f"{port.name} set during the run", ({"call": [f"set{port.kind}", [k], [port.start]]}, words)
        elif port.causality == "parameter":
            case = {"call": ["setReal", [k], [_wrong(port)]]}
            yield f"{port.name} tuned out of range", (case, [f"`{port.name}` is", "Correct"])


def _steps(component: Component) -> Iterator[tuple[str, Case]]:
    h = communication_step(component.step_size, component.stop_time)
    for step in (-h, 0.0, math.nan, math.inf):
        yield f"step of {step} s", ({"step": (h, step)}, ["communication step", "Give a positive one", *PLACE])
    yield "step from no time", ({"step": (math.nan, h)}, ["finite time", *PLACE])
    yield "step before the start", ({"phase": "before", "step": (0.0, h)}, ["`instantiated`", "initialise", *PLACE])


def _samples(component: Component) -> Iterator[tuple[str, Case]]:
    period = next((p.start for p in component.of("parameter") if p.name == "sample_time"), None)
    if period is None:
        return
    h = communication_step(component.step_size, component.stop_time)
    for factor in (0.4, 0.9999, 1.0001, 1.37, 2.5):
        words = ["neither a whole multiple nor a whole fraction of `sample_time`", "Change one of them", *PLACE]
        yield f"step of {factor} samples", ({"step": (h, factor * period)}, words)
    words = ["holds 3e+07 samples of `sample_time`", "Take shorter steps", *PLACE]
    yield "step of too many samples", ({"step": (h, 3e7 * period)}, words)
    halves = {"call": ["doStep", h, period / 2], "step": (h + period / 2, period)}
    yield "step past a sample", (halves, ["communication point", *PLACE])
