"""What a component becomes in C: which outputs, which numbers, and the functions and records that these need."""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from gapsense.fmi.components import kernel_of, load_component
from gapsense.fmi.ports import Component
from gapsense.fmi.values import fields
from gapsense.kernels.emit import HARMLESS_IN_C, Graph, Python, needed, split
from gapsense.kernels.kernel import Kernel
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
        kept = [(name, at) for name, at in layout(self.kernel.module.State).items() if at.kind == "memory"]
        return {name: int(self.values[at.used]) if at.used else at.size for name, at in kept}


def designed(
    folder: Path, real: str = "float", outputs: Sequence[str] = (), given: Mapping[str, Any] | None = None,
    is_baked: bool = False,
    is_lean: bool = False,
) -> Design:  # fmt: skip
    """The component in `folder` with some of its outputs, or all, and other start values where they are `given`."""
    component = load_component(folder)
    kernel = (is_lean and lean_kernel(component)) or kernel_of(component)
    values = fields(component, given or {}, folder)
    wanted = [port.field for port in component.of("output") if port.name in outputs or not outputs]
    constants = values if is_baked else {name: values[name] for name in sizing(kernel)}
    initial, step, kept = needed(*kernel.traced(constants, with_places=True), wanted, Python)
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
