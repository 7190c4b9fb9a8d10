"""Component folders: find them, load their port tables, make the records of their kernels."""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

from gapsense.fmi.ports import Component
from gapsense.fmi.values import fields
from gapsense.kernels.kernel import Kernel
from gapsense.kernels.layout import names, record
from gapsense.problems import code, suggest
from gapsense.shipped import COMPONENTS, ROOT

HOLDS = "A component's folder holds component.py, page.md and reference.csv."


def find_checkout() -> Path | None:
    """The checkout that holds fmus/ and build_fmus.py: the working folder or one above it; None outside of one."""
    here = Path.cwd()
    return next((p for p in (here, *here.parents) if (p / "build_fmus.py").is_file() and (p / "fmus").is_dir()), None)


def components_folder(root: Path | None = None) -> Path:
    """The folder fmus/ below `root`, or in the checkout around the working folder, or what comes with this package."""
    return (root or find_checkout() or ROOT) / "fmus"


def own(name: str) -> Path:
    """Folder of a component that comes with this package."""
    return find_components(COMPONENTS, [name])[0]


def find_components(root: Path, names: Sequence[str] = ()) -> list[Path]:
    """Component folders below `root`, all or those named (by folder or by FMU, in any case)."""
    found = {p.parent.name: p.parent for p in sorted(root.glob("*/component.py"))}
    if not found:
        raise FileNotFoundError(f"{root}: no component in this folder. Correct the path.")
    known = {name.replace("_", "").lower(): folder for name, folder in found.items()}
    unknown = [n for n in names if n.replace("_", "").lower() not in known]
    if unknown:
        raise FileNotFoundError(f"there is no component `{unknown[0]}` in {root}. {suggest(unknown[0].lower(), found)}")
    return [known[n.replace("_", "").lower()] for n in names] if names else list(found.values())


def load_component(folder: Path) -> Component:
    """The `COMPONENT` of `folder/component.py`."""
    spec = importlib.util.spec_from_file_location(f"{folder.name}_component", folder / "component.py")
    if spec is None or spec.loader is None or not (folder / "component.py").is_file():
        raise FileNotFoundError(f"{folder}: no component.py. {HOLDS}")
    module = importlib.util.module_from_spec(spec)
    with code(folder / "component.py"):
        spec.loader.exec_module(module)
        component: Component = module.COMPONENT
    return component


def kernel_of(component: Component) -> Kernel:
    """The kernel of a component, which is traced at most once in a process."""
    return _kernel(importlib.import_module(component.kernel))


_kernel = cache(Kernel)


def kernel_parameters(folder: Path, given: Mapping[str, Any]) -> Any:
    """The `Parameters` of the kernel of the component in `folder`; a ValuesError tells all values it does not take."""
    component = load_component(folder)
    cls, values = kernel_of(component).module.Parameters, fields(component, given, folder)
    return record(cls, (values[name] for name in names(cls)))
