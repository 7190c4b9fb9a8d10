"""The saved state of an instance as bytes, and all that must hold before bytes become a state again.

A checksum finds damage.  Types, lengths and ranges are checked nevertheless: a state can be written by anybody.
Standard library only, because a copy travels in every FMU.
"""

from __future__ import annotations

import json
import math
from binascii import crc32
from collections.abc import Iterator
from typing import Any

from .life import PHASES
from .ports import Component
from .sentences import Refusal, say
from .tables import column_name
from .values import numbers, problems

# `par` and `state` are what a step needs, so that they are empty in all phases but `running`.
SAVED = ("build", "phase", "signals", "parameters", "par", "state", "start_time", "end", "elapsed")


def to_bytes(state: dict[str, Any]) -> bytes:
    """The checksum, then JSON."""
    text = json.dumps(state).encode()
    return b"%08x %b" % (crc32(text), text)


def from_bytes(data: bytes, component: Component, kernel: Any, build: str) -> dict[str, Any]:
    """The state of one's own build, if it is whole and unharmed; else a Refusal says what is wrong."""
    text = data[9:]
    if data[:9] != b"%08x " % crc32(text):
        raise Refusal(say("damaged_state", "checksum"))
    try:
        state = json.loads(text)
    except (ValueError, RecursionError):
        state = None
    if not isinstance(state, dict) or state.keys() != set(SAVED):
        raise Refusal(say("damaged_state", "list of parts"))
    if state["build"] != build:
        raise Refusal(say("other_build", state["build"], build))
    if wrong := next((part for part, is_right in _parts(state, component, kernel) if not is_right), ""):
        raise Refusal(say("damaged_state", wrong))
    return state


def _parts(state: dict[str, Any], component: Component, kernel: Any) -> Iterator[tuple[str, bool]]:
    """Parts, and whether they can be right; each relies on those before it."""
    inputs, outputs = len(component.of("input")), len(component.of("output"))
    ports, phase = component.of("parameter"), state["phase"]
    signals, parameters, elapsed = state["signals"], state["parameters"], state["elapsed"]
    yield "phase", phase in PHASES
    yield "signals", _are_numbers(signals, inputs + outputs) and all(map(math.isfinite, signals[inputs:]))
    yield "parameters", isinstance(parameters, list) and len(parameters) == len(ports)
    given = {port.name: value for port, value in zip(ports, parameters)}
    yield "parameters", all(_is_typed(port.kind, given[port.name]) for port in ports)
    yield "times", _are_numbers([state["start_time"], state["end"], elapsed], 3) and math.isfinite(state["start_time"])
    yield "times", not math.isinf(state["end"]) and (elapsed == 0.0 or 0.0 < elapsed < given.get("sample_time", 0.0))
    if phase != "running":
        yield "values", state["par"] == state["state"] == []
        return
    yield "parameters", not problems(component, given)
    yield "values", _is_par(state["par"], component, kernel, given)
    entries, sizes = state["state"], kernel.STATE
    yield "values", isinstance(entries, list) and len(entries) == len(sizes)
    pairs = [(entry if size else [entry], size or 1) for entry, size in zip(entries, sizes)]
    yield "values", all(_are_numbers(entry, size) for entry, size in pairs)
    yield "values", component.survives or all(math.isfinite(x) for entry, _ in pairs for x in entry)
    wholes = ((pairs[entry][0][first::every], least, most) for entry, first, every, least, most in kernel.WHOLES)
    yield "values", all(least <= x <= most and x % 1.0 == 0.0 for xs, least, most in wholes for x in xs)


def _are_numbers(values: Any, count: int) -> bool:
    return isinstance(values, list) and len(values) == count and all(type(value) is float for value in values)


def _is_typed(kind: str, value: Any) -> bool:
    is_typed = type(value) is {"Real": float, "Integer": int, "Boolean": bool, "String": str}[kind]
    return is_typed and (kind != "Integer" or -(2**31) <= value < 2**31)


def _is_par(par: Any, component: Component, kernel: Any, given: dict[str, Any]) -> bool:
    """True for the numbers that belong to the parameters, and for tables that can be."""
    if not isinstance(par, list) or len(par) != len(kernel.PARAMETERS):
        return False
    values = dict(zip(kernel.PARAMETERS, par))
    if any(values[name] != value for name, value in numbers(component, given).items()):
        return False
    tables = [[f"{p.field}_{column_name(c)}" for c in p.columns] for p in component.of("parameter") if p.columns]
    return all(_is_table([values[name] for name in names]) for names in tables)


def _is_table(columns: list[Any]) -> bool:
    """True for columns of numbers, equally long, of which the first does not decrease."""
    first = columns[0]
    if not isinstance(first, list) or len(first) < 2 or not all(_are_numbers(c, len(first)) for c in columns):
        return False
    return all(math.isfinite(x) for column in columns for x in column) and first == sorted(first)
