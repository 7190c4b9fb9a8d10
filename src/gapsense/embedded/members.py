"""The records of a component as members of C structs, each with its unit and its meaning."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterable, Iterator
from functools import cache
from typing import Any, NamedTuple, get_type_hints

from gapsense.embedded.code import quote
from gapsense.embedded.design import Design
from gapsense.fmi.ports import Port
from gapsense.fmi.tables import column_name
from gapsense.kernels.emit import Graph
from gapsense.kernels.emit.c import WHOLE
from gapsense.kernels.layout import fields, names
from gapsense.problems import format_limits

FIELD = re.compile(r"\s+(\w+): .*?(?:#\s*(.*))?$")
ENTRY = re.compile(r"_\d+$")
CLOCK = {"time": "[s] Time at the end of the step", "dt": "[s] Length of the step; 0 at the start"}
TITLES = {
    "inputs": "Inputs at a sample",
    "par": "Parameters; `{name}_defaults` gives the start values",
    "constants": "What a step needs of the parameters; `{name}_prepare` computes it",
    "state": "What is carried from step to step; a copy of it is a saved state",
    "outputs": "Outputs, valid at the end of the step",
}
SUFFIX = {"par": "parameters"}  # of the types; the others are called like the records


class Member(NamedTuple):
    """A member of a struct."""

    type: str
    name: str
    comment: str
    size: int = 0  # of an array


def members(design: Design) -> dict[str, list[Member]]:
    """Members of every record that a component has in C, by the record's name; empty ones are left out."""
    ports = {port.field: port for port in design.component.ports}
    signals = {
        record: [Member(design.real, n, CLOCK.get(n) or about(ports[n])) for n in design.kept[record]]
        for record in ("inputs", "outputs")
    }
    made = {
        "inputs": signals["inputs"],
        "par": [] if design.is_baked else [*_parameters(design)],
        "constants": [*_constants(design)] if design.prepare else [],
        "state": [*_state(design)],
        "outputs": signals["outputs"],
    }
    return {name: found for name, found in made.items() if found}


def arguments(design: Design, records: tuple[str, ...], written: tuple[str, ...], found: Any) -> str:
    """Arguments of a function: pointers to those of the records that there are."""
    texts = (
        f"{'' if name in written else 'const '}{type_name(design, name)} *{name}" for name in records if name in found
    )
    return ", ".join(texts)


def type_name(design: Design, record: str) -> str:
    """What the struct of a record is called."""
    return f"{design.name}_{SUFFIX.get(record, record)}"


def about(port: Port) -> str:
    """Unit, description and range of a port."""
    return f"[{port.unit}] {port.description}{_range(port)}"


def _range(port: Port) -> str:
    if port.choices:
        return f" ({', '.join(f'{k}: {choice}' for k, choice in enumerate(port.choices))})"
    if port.kind == "Boolean":
        return " (0: no, 1: yes)"
    return f"; {limits}" if (limits := format_limits(port.min, port.max)) else ""


def table_sizes(design: Design) -> dict[str, str]:
    """Of every table that is needed what holds its length: one for all columns of a file."""
    columns = {
        f"{port.field}_{column_name(column)}": f"{port.field}_size"
        for port in design.component.of("parameter")
        for column in port.columns
    }
    return {name: size for name, size in columns.items() if name in design.kept["par"]}


def _parameters(design: Design) -> Iterator[Member]:
    for port in design.component.of("parameter"):
        if port.field in design.kept["par"]:
            yield Member(design.real, port.field, about(port))
    yield from _tables(design, [*table_sizes(design)])


def _tables(design: Design, names: Iterable[str]) -> Iterator[Member]:
    sizes = table_sizes(design)
    for size in dict.fromkeys(sizes[name] for name in names):
        yield Member("int", size, "Length of the tables that follow")
        for name in names:
            if sizes[name] == size:
                yield Member(f"const {design.real} *", name, f"Column `{name.removeprefix(size[:-4])}`")


def _constants(design: Design) -> Iterator[Member]:
    (_, cls, symbols) = design.step.arguments[-1]
    comments = {member.name: member.comment for member in _parameters(design)}
    for name, node in zip(names(cls), symbols):
        if node.extra != "table":
            place = (design.step.tape.places or {}).get(node.id)
            kind = "int" if node.op in WHOLE else design.real
            yield Member(kind, name, comments.get(name) or (quote(place) if place else ""))
    yield from _tables(design, [name for name, node in zip(names(cls), symbols) if node.extra == "table"])


def _state(design: Design) -> Iterator[Member]:
    cls = design.kernel.module.State
    comments, layout, memories = field_comments(cls), fields(cls), design.memories()
    for name in design.kept["state"]:
        size = memories.get(name, 0)
        field = name if name in layout else ENTRY.sub("", name)
        yield Member(design.real, name, comments.get(field, ""), size)


@cache
def field_comments(cls: type) -> dict[str, str]:
    """The comments at the end of the lines that define the fields of a record, those of records in it included."""
    found: dict[str, str] = {}
    for kind in get_type_hints(cls).values():
        found |= field_comments(kind) if hasattr(kind, "_fields") else {}
    lines = inspect.getsource(cls).splitlines()
    return found | {match[1]: match[2] for line in lines if (match := FIELD.match(line)) and match[2]}


def graphs(design: Design) -> dict[str, Graph]:
    """All functions of a component, by their names in C."""
    known = {"initial": design.initial, "prepare": design.prepare, "step": design.step}
    return {name: graph for name, graph in known.items() if graph}
