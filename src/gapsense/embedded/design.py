"""What a component becomes in C: its outputs and numbers, and the functions and records that these need."""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Collection, Iterable, Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Annotated, Any, NamedTuple

from gapsense.fmi.components import kernel_of, load_component
from gapsense.fmi.ports import Component
from gapsense.fmi.values import fields
from gapsense.kernels.emit import HARMLESS_IN_C, Graph, Printer, Python, split
from gapsense.kernels.kernel import Kernel
from gapsense.kernels.layout import Field, names
from gapsense.kernels.layout import fields as layout
from gapsense.problems import InputError, suggest

REALS = ("float", "double")


class Design(NamedTuple):
    """A component for a microcontroller."""

    name: str  # prefix of everything in C
    folder: Path
    component: Component
    kernel: Kernel
    real: str  # one of `REALS`
    values: Mapping[str, Any]  # of the fields of `Parameters`
    is_baked: bool  # the parameters are constants of the code
    kept: Mapping[str, Sequence[str]]  # entries that are left of every record
    initial: Graph
    prepare: Graph | None  # what follows from the parameters alone
    step: Graph

    def memories(self) -> dict[str, int]:
        """Numbers of every array memory of the state, no more than are used."""
        kept = {name: at for name, at in layout(self.kernel.module.State).items() if at.kind == "memory"}
        return {
            name: int(int(self.values[at.used]) * self.per(name)) if at.used else at.size for name, at in kept.items()
        }

    def per(self, memory: str) -> Fraction:
        """Numbers of an array memory for each unit of the parameter that says how many are used."""
        at = layout(self.kernel.module.State)[memory]
        start = next(port.start for port in self.component.of("parameter") if port.field == at.used)
        return Fraction(at.size, int(start))


def make_design(
    folder: Path, real: str = "float", outputs: Sequence[str] = (), given: Mapping[str, Any] | None = None,
    is_baked: bool = False,
    is_lean: bool = False,
) -> Design:  # fmt: skip
    """Make the design of a component, with some of its outputs or all, and other start values if `given`."""
    component = load_component(folder)
    kernel = (is_lean and lean_kernel(component)) or kernel_of(component)
    values = fields(component, given or {}, folder)
    wanted = [port.field for port in component.of("output") if port.name in outputs or not outputs]
    constants = values if is_baked else {name: values[name] for name in sizing(kernel)}
    initial, step, kept = prune_graphs(*kernel.trace(constants, with_places=True), wanted, Python)
    has_parameters = bool(kept["par"]) and not is_baked
    prepare, step = split(step, Python, HARMLESS_IN_C) if has_parameters else (None, step)
    return Design(
        name=folder.name,
        folder=folder,
        component=component,
        kernel=kernel,
        real=real,
        values=values,
        is_baked=is_baked,
        kept=kept,
        initial=initial,
        prepare=prepare,
        step=step,
    )


# Of a kernel's functions, keep what some outputs need.


def prune_graphs(
    initial: Graph, step: Graph, outputs: Collection[str], printer: type[Printer]
) -> tuple[Graph, Graph, dict[str, list[str]]]:
    """Prune the functions to these outputs; with them, the entries that are left of every record, by its name.

    Other outputs are dropped, and so is dead state: neither a wanted output nor the next value of a live state depends
    on it.  Both functions get the same inputs and parameters, in records that hold no others.
    """
    state, published = (names(cls) for cls, _ in step.results)
    wanted = [name for name in published if name in outputs]
    alive: set[str] = set()  # states that the outputs depend on, today or later
    while (found := _find_used(_returning(step, (alive, wanted)), printer)["state"] & {*state}) - alive:
        alive |= found
    graphs = [_returning(graph, (alive, wanted)) for graph in (initial, step)]
    used = [_find_used(graph, printer) for graph in graphs]
    kept = {"state": [n for n in state if n in alive], "outputs": wanted}
    for name, cls, _ in initial.arguments:
        kept[name] = [entry for entry in names(cls) if any(entry in found[name] for found in used)]
    taken = ([(n, *_part(cls, symbols, kept[n])) for n, cls, symbols in graph.arguments] for graph in graphs)
    first, second = (graph._replace(arguments=arguments) for graph, arguments in zip(graphs, taken))
    return first, second, kept


def _find_used(graph: Graph, printer: type[Printer]) -> dict[str, set[str]]:
    """Find the entries of every argument that the results depend on."""
    uses = printer(graph).uses
    return {
        name: {entry for entry, symbol in zip(names(cls), symbols) if symbol.id in uses}
        for name, cls, symbols in graph.arguments
    }


def _returning(graph: Graph, wanted: Iterable[Collection[str]]) -> Graph:
    """The function with some of the entries of each record that it returns."""
    results = [_part(cls, entries, kept) for (cls, entries), kept in zip(graph.results, wanted)]
    return graph._replace(results=results)


def _part(cls: type, values: list[Any], kept: Collection[str]) -> tuple[type, list[Any]]:
    """A record class with some of the flat entries of another, and their values."""
    special = {name: field for name, field in layout(cls).items() if field.kind in ("memory", "table")}
    pairs = [(name, value) for name, value in zip(names(cls), values) if name in kept]
    entries = [(name, Annotated[Any, special.get(name, Field())]) for name, _ in pairs]
    made = NamedTuple(cls.__name__, entries)  # type: ignore[misc]  # its fields are what this is about
    return made, [value for _, value in pairs]


# Which numbers and which outputs there are.


def sizing(kernel: Kernel) -> list[str]:
    """Parameters that say how much of an array memory is used: always constants of the code."""
    return [*dict.fromkeys(at.used for at in layout(kernel.module.State).values() if at.used)]


def lean_kernel(component: Component) -> Kernel | None:
    """The kernel that does the same with fewer operations, for components that have one."""
    name = f"{component.kernel}_lean"
    return Kernel(importlib.import_module(name)) if importlib.util.find_spec(name) else None


def check_lean(folders: Sequence[Path]) -> None:
    """Refuse components of which none has a lean form."""
    if not any(lean_kernel(load_component(folder)) for folder in folders):
        names = ", ".join(f"`{folder.name}`" for folder in folders)
        raise InputError([f"--lean: {names}: only `semera` has such a form. Leave it out."])


def check_outputs(folders: Sequence[Path], outputs: Sequence[str]) -> None:
    """Refuse names that no component has, and components that have none of them."""
    if not outputs:
        return
    known = {folder.name: {port.name for port in load_component(folder).of("output")} for folder in folders}
    every = set().union(*known.values())
    here = ", ".join(f"`{name}`" for name in known)
    problems = [f"--outputs: {here}: no output `{n}`. {suggest(n, every)}" for n in outputs if n not in every]
    for name, own in known.items():
        if not problems and not own.intersection(outputs):
            problems.append(f"--outputs: `{name}` does not have these. {suggest('', own)}")
    if problems:
        raise InputError(problems)
